"""A belt axis that a user wrote after the documentation, and sound recordings of it by an independent simulation."""

import json
import pathlib

import pytest

from ranger_sim.tools import cli

DATA = pathlib.Path(__file__).resolve().parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.skipif(
    not (DATA / "sound_axis_machine.py").is_file(), reason="the recordings of an independent axis are not here"
)


def diagnosed(capfd, train, *holdout):
    command = ["diagnose", str(DATA / f"sound_axis_{train}.csv"), "--experiment", "sound_axis_machine:Belt"]
    for each in holdout:
        command += ["--holdout", str(DATA / f"sound_axis_{each}.csv")]
    code = cli.main([*command, "--json", "-"])
    return code, json.loads(capfd.readouterr().out)


@pytest.mark.parametrize("parts", [("train", "holdout"), ("holdout", "train"), ("train",)])
def test_sound_recordings_of_a_user_s_own_axis_raise_no_alarm(parts, capfd, monkeypatch):
    monkeypatch.syspath_prepend(str(DATA))
    code, answer = diagnosed(capfd, *parts)
    assert (code, answer["causes"], answer["evidence"]["above_noise_floor"]) == (0, [], [])
    # what would have been named is printed: friction that differs by a newton between the directions, of 7 N
    assert answer["evidence"]["smallest_visible"]["direction_friction at guide"]["force_N"] < 1.0
