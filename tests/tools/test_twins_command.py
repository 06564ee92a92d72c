"""`ranger-sim twins` from its tasks to its file, with made-up walks in place of the emulator's."""

import json

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.twins import features, twin_file
from ranger_sim.tools import cli
from ranger_sim.tools.twins import building, making
from ranger_sim.tools.twins.causes import BY_KEY
from ranger_sim.tools.twins.walking import Walked

STEPS = 20
SPRING = BY_KEY["spring_value@hip_spring@stiffness_Nm_per_rad"]
EFFECT = generator(5, "effect of a made-up spring").normal(size=len(features.NAMES))


def made_up(task):
    """Noise, which a floor makes larger, and an effect in proportion to the size; a robot far beyond falls at once."""
    draw = generator(task.seed, "made-up twin")
    count = 0 if task.size > 4.0 else STEPS
    found = (1.0 + 500.0 * task.floor_m) * draw.normal(size=(count, len(EFFECT))) + task.size * EFFECT
    return Walked(np.arange(count) % 2, found, found, count == 0)


@pytest.fixture
def walked(monkeypatch):
    """The tasks that walked, in order; of one cause alone."""
    asked = []

    def make(wanted, folder, jobs, progress):
        missing = [each for each in wanted if not making.path_of(folder, each).exists()]
        folder.mkdir(exist_ok=True)
        for task in missing:
            asked.append(task)
            making.keep(task, folder)
        progress(len(wanted), len(wanted))

    monkeypatch.setattr(making, "TWINS", (SPRING,))
    monkeypatch.setattr(building, "TWINS", (SPRING,))
    monkeypatch.setattr(making, "walk", made_up)
    monkeypatch.setattr(making, "make", make)
    return asked


def test_the_command_makes_every_walk_and_the_file_with_far_twins_in_one_go(walked, tmp_path, capsys):
    command = ["twins", "--share", "0.1", "--work", str(tmp_path / "walks"), "--out", str(tmp_path / "a.npz")]
    assert cli.main([*command, "--json", "-"]) == 0
    made_of = json.loads(capsys.readouterr().out)
    assert made_of["walks"] == len(walked) == len(set(walked))
    file = twin_file.read(tmp_path / "a.npz")
    for view in file.views.values():
        (spring,) = view.directions
        assert (spring.low, spring.high) == (-1.1, 1.1)
        assert [(knot.size, knot.steps > 0) for knot in spring.far] == [
            (-4.4, True),
            (-2.2, True),
            (2.2, True),
            (4.4, False),
        ]
    assert [len(view.floors_m) for view in file.views.values()] == [3, 3, 3]

    # after a kill the same command continues, and makes the same bytes
    made = (tmp_path / "a.npz").read_bytes()
    (making.path_of(tmp_path / "walks", walked[5])).unlink()
    again = list(walked)
    walked.clear()
    assert cli.main(command) == 0
    assert walked == [again[5]]
    assert (tmp_path / "a.npz").read_bytes() == made
