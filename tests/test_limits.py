"""A test that waits for something that never comes ends, and says what it was."""

import pathlib
import subprocess
import sys

import pytest

from tests.can_bus import hosting

ROOT = pathlib.Path(__file__).resolve().parents[1]


def test_a_run_with_a_test_that_hangs_ends_and_names_the_line(tmp_path):
    """Also where no Python runs: in a read of a compiled wait, say."""
    still = tmp_path / "test_still.py"
    still.write_text("import os\n\n\ndef test_still():\n    os.eventfd_read(os.eventfd(0))\n")
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-c", ROOT / "pyproject.toml", "-p", "no:cacheprovider"]
        + ["-o", "faulthandler_timeout=1", still],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 1 and 'test_still.py", line 5 in test_still' in run.stderr


@pytest.mark.parametrize("how", [{"together": True}, {"terminal": True}])
def test_a_program_that_never_ends_is_not_waited_for_for_ever(monkeypatch, how):
    monkeypatch.setattr(hosting, "PATIENCE_S", 0.01)
    with hosting.Program("-c", "import threading; threading.Event().wait()", **how) as program:
        with pytest.raises(subprocess.TimeoutExpired):
            program.ended()
        monkeypatch.undo()
