"""Other projects' suites are run by `make test-suites`: here is what needs no network."""

import sys

import pytest

from dev.suites import __main__ as suites


def test_an_unknown_suite_is_refused_before_anything_is_installed(capsys, tmp_path):
    with pytest.raises(SystemExit, match="2"):
        suites.main(["canopeen", "--folder", str(tmp_path / "none")])
    assert "unknown suite 'canopeen' (available: python-can, canopen," in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_a_suite_is_counted_by_its_outcomes(tmp_path):
    (tmp_path / "test").mkdir()
    (tmp_path / "test" / "test_own.py").write_text(
        "import can, pytest\n"
        "def test_right(): pass\n"
        "def test_wrong(): assert False\n"
        "@pytest.mark.skip\ndef test_left_out(): pass\n"
        "def test_bus():\n"
        "    with can.Bus('x', interface='virtual') as bus:\n"
        "        assert type(bus).__name__ == 'Substitute'\n"
    )
    suite = suites.Suite("own", "1.0")
    virtual, ours = (suites.run(sys.executable, suite, tmp_path, on_ours) for on_ours in (False, True))
    assert {name.rpartition("::")[2] for name in virtual.passed} == {"test_right"}
    assert {name.rpartition("::")[2] for name in ours.failed} == {"test_wrong"}
    assert {name.rpartition("::")[2] for name in ours.passed} == {"test_right", "test_bus"}
