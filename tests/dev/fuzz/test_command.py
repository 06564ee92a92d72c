"""`python -m dev.fuzz`: one target after the other, and what becomes of a finding."""

import json

import pytest

from dev.fuzz import Finding, profiles
from dev.fuzz import __main__ as command


def test_targets_are_fuzzed_with_the_seed_and_the_cases_asked_for(capsys, monkeypatch):
    monkeypatch.setattr(profiles, "run", lambda cases, seed: {"cases": cases, "seed": seed})
    assert command.main(["profiles", "--cases", "7", "--seed", "3"]) == 0
    assert capsys.readouterr().out == "profiles: cases 7, seed 3\n"


def test_the_same_seed_gives_the_same_cases_and_another_others(capsys):
    found = []
    for seed in ("1", "1", "2"):
        assert command.main(["profiles", "--cases", "40", "--seed", seed, "--json", "-"]) == 0
        found.append(json.loads(capsys.readouterr().out)["fuzz"])
    assert found[0] == found[1] != found[2]


def test_a_finding_is_named_with_its_seed_and_is_exit_code_1(capsys, monkeypatch):
    def finds(cases, seed):
        raise Finding("board MCH has stopped at 5 ns (case 3)")

    monkeypatch.setattr(profiles, "run", finds)
    assert command.main(["profiles", "--seed", "4"]) == 1
    assert capsys.readouterr().err == "python -m dev.fuzz: profiles, seed 4: board MCH has stopped at 5 ns (case 3)\n"


def test_a_target_that_there_is_not_gets_one_line(capsys):
    with pytest.raises(SystemExit) as left:
        command.main(["walls"])
    assert left.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "python -m dev.fuzz: error: unknown target 'walls' (available: can, channel, firmware, gdb, interfaces, panel, "
        "profiles, requests, serial, xcp)"
    )


def test_help_names_every_target_with_a_line(capsys):
    with pytest.raises(SystemExit):
        command.main(["--help"])
    out = capsys.readouterr().out
    for name, text in command.TARGETS.items():
        assert f" {name} {text} " in " ".join([*out.split(), ""])  # folded at the terminal's width
