"""The tool that repeats the system tests: what it calls the same, and that it notices what is not."""

import json

from dev import repeats

REPORT = """<testsuites><testsuite>
<testcase classname="tests.a" name="one"/><testcase classname="tests.a" name="two"><failure/></testcase>
<testcase classname="tests.a" name="three"><skipped/></testcase><testcase classname="tests.a" name="four"><error/>
</testcase></testsuite></testsuites>"""


def row(seed, digest="abc", **outcomes):
    return {"hash_seed": seed, "digest": digest, "outcomes": outcomes}


def test_a_report_has_the_outcome_of_every_test():
    names = {"one": "passed", "two": "failed", "three": "skipped", "four": "error"}
    assert repeats.outcomes(REPORT) == {f"tests.a::{name}": outcome for name, outcome in names.items()}


def test_the_same_every_time_is_not_a_difference_and_everything_else_is():
    assert repeats.differences([row(1, one="passed", two="skipped"), row(2, one="passed", two="skipped")]) == []
    assert repeats.differences([row(1), row(2, "abd")]) == ["2 digests: abc; abd"]
    assert repeats.differences([row(1, one="passed"), row(2, one="failed")]) == ["one: passed 1 times, failed 1 times"]
    assert repeats.differences([row(1, one="failed"), row(2, one="failed")]) == ["one: failed 2 times"]
    assert repeats.differences([row(1, one="passed"), row(2)]) == ["one: passed 1 times, missing 1 times"]


def test_tests_with_a_clock_are_left_out():
    makefile = "A = b\nWITH_A_CLOCK = tests/system/test_daq.py tests/x.py \\\n\ttests/vm\n# Run by\n"
    assert repeats.with_a_clock(makefile) == ["tests/system/test_daq.py", "tests/x.py", "tests/vm"]
    chosen = repeats.system_tests()
    assert "tests/system/test_determinism.py" in chosen and "tests/system/test_processes.py" not in chosen


def test_a_series_goes_on_where_it_was_interrupted_and_a_digest_that_differs_ends_it_with_1(
    tmp_path, monkeypatch, capsys
):
    digests = iter(["abc", "abc", "abd"])
    monkeypatch.setattr(repeats, "once", lambda seed, tests: row(seed, next(digests), one="passed"))
    kept = tmp_path / "rows"
    assert repeats.main(["--times", "1", "--keep", str(kept)]) == 0
    assert repeats.main(["--times", "2", "--keep", str(kept)]) == 0
    assert len(kept.read_text().splitlines()) == 2  # the first seed of two is that of one
    assert repeats.main(["--times", "3", "--keep", str(kept)]) == 1
    assert "2 digests: abc; abd" in capsys.readouterr().out
    assert len({json.loads(line)["hash_seed"] for line in kept.read_text().splitlines()}) == 3
