"""The matrix of cells by known answers, and a sample; all of it by `python -m tests.sysid.matrix`."""

import ast
import dataclasses
import itertools
import json
import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from tests.sysid.matrix import __main__ as command
from tests.sysid.matrix import bodies, cases, drives, tables
from tests.sysid.matrix.cells import CELLS, FACTORS, Cell, pairs
from tests.sysid.matrix.judged import answer

HERE = pathlib.Path(__file__).parent / "matrix"
RAMP = Cell("axis", "point", 100, "steps", "white", "stick")


@pytest.mark.parametrize("name", ["bodies", "drives", "cases", "cells"])
def test_the_generator_of_the_matrix_shares_nothing_with_the_diagnosis(name):
    imported = set()
    for node in ast.walk(ast.parse((HERE / f"{name}.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            imported |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(node.module)
    ours = {each for each in imported if each.startswith(("ranger_sim", "tests"))}
    assert ours <= {
        "ranger_sim.foundation.random_arrays",
        "tests.sysid.matrix",
        "tests.sysid.matrix.bodies",
        "tests.sysid.matrix.drives",
    }


def test_any_two_levels_of_two_factors_meet_in_a_cell():
    wanted = set().union(*map(pairs, itertools.product(*FACTORS.values())))
    assert set().union(*(pairs(dataclasses.astuple(each)) for each in CELLS)) == wanted
    assert len(set(CELLS)) == len(CELLS) >= 40
    assert min(sum(each.machine == name for each in CELLS) for name in FACTORS["machine"]) >= 9


def test_true_friction_holds_up_to_its_limit_and_a_smooth_one_creeps():
    assert bodies.rubbed(0.0, 0.9, 1.0, 2.0, 0.0) == 0.0
    assert bodies.rubbed(0.0, 1.5, 1.0, 2.0, 0.0) == pytest.approx(0.25 * drives.H_S)
    assert bodies.rubbed(1e-9, -0.5, 1.0, 2.0, 0.0) == 0.0  # it stops, and does not turn round
    assert 0.0 < bodies.rubbed(0.0, 0.9, 1.0, 2.0, 0.01) < 0.45 * drives.H_S


def test_a_mean_lies_in_the_middle_of_its_sample_and_a_multiplexer_a_tenth_behind():
    """A ramp of 1 a second, without noise: the second channel of a multiplexer is a tenth of a sample late."""
    ramp = np.arange(3000) * drives.H_S
    shown = {
        kind: cases.shown(
            dataclasses.replace(RAMP, sampling=kind), generator(1, "ramp"), {"voltage_V": ramp, "current_A": ramp}
        )
        for kind in ("point", "mean", "multiplexed")
    }
    assert shown["point"]["t_s"] == pytest.approx(np.arange(29) / 100.0)
    bare = {
        kind: each["current_A"] - shown["point"]["current_A"] for kind, each in shown.items()
    }  # the same noise in all three
    assert bare["mean"] == pytest.approx(np.full(29, 0.00495))
    assert bare["multiplexed"] == pytest.approx(np.full(29, 0.001))


def test_noise_of_every_kind_has_the_deviation_that_it_is_meant_to_have():
    still = {"current_A": np.full(2_000_000, 1.2345)}
    for noise in FACTORS["noise"]:
        cell = dataclasses.replace(RAMP, rate_hz=1000, noise=noise)
        parts = [cases.shown(cell, generator(seed, noise), still)["current_A"] for seed in range(3)]
        if noise == "quantised":  # a constant is between two counts
            assert all(len(np.unique(part)) <= 3 for part in parts)
        else:
            assert np.std(np.concatenate(parts)) == pytest.approx(cases.NOISE["axis"]["current_A"], rel=0.03)


def test_the_strength_of_an_effect_is_its_length_over_the_noise(monkeypatch):
    """Half of the noise, half of the size; what the base parameters take up has no strength at all."""
    cell = Cell("positioning", "point", 100, "multisine", "white", "stick")
    monkeypatch.setattr(cases, "seconds", lambda cell: 5.0)
    drag = bodies.HIDDEN["positioning"]["direction"]
    size = cases.size_of(cell, 5, drag, {})
    monkeypatch.setitem(cases.NOISE, "positioning", {name: 0.5 * v for name, v in cases.NOISE["positioning"].items()})
    assert cases.size_of(cell, 5, drag, {}) == pytest.approx(0.5 * size)
    viscous = bodies.Hidden(lambda size, numbers: lambda rate, place, t: size * rate, ())
    assert cases.size_of(cell, 5, viscous, {}) > 50.0 * size


def record(strength, **more):
    return {
        "cell": CELLS[0].name, "seed": 1, "hidden": "drag", "strength": strength, "refused": "", "detected": True,
        "causes": ["drag at w"], "right": True, "tied": False, "bic": 10.0 * strength**2, "cpu_s": 1.0, "errors": {},
    } | more  # fmt: skip


def test_a_larger_effect_with_a_worse_answer_is_found():
    rising = [record(each) for each in (1.0, 2.0, 4.0)]
    assert list(tables.worse(rising)) == []
    unseen = record(8.0, detected=False, causes=[], right=False, bic=0.0)
    wrong = record(8.0, right=False, causes=["stribeck at w"])
    lower = record(8.0, bic=20.0)
    for other, how in ((unseen, "not seen"), (wrong, "named stribeck at w"), (lower, "score 160, then 20")):
        assert [each[-1] for each in tables.worse([*rising, other])] == [how]
    assert list(tables.worse([*rising, record(8.0, right=False, tied=True)])) == []


def test_a_sound_recording_above_its_noise_floor_is_an_alarm():
    sound = {"hidden": "", "detected": False, "causes": [], "right": False}
    quiet, loud = record(0.0, **sound), record(0.0, unexplained=True, **sound)
    [row] = tables.alarms_by_cell([quiet, loud, quiet]).values()
    assert row == [1, 3, {"above its noise floor": 1}]
    assert {each[2:] for each in tables.by_level([quiet, loud])} == {(1, 2)}


def test_limits_of_rates_are_those_of_the_binomial_law():
    assert tables.at_most(0, 200) == pytest.approx(1.0 - 0.025 ** (1.0 / 200))
    assert tables.at_most(3, 3) == 1.0


def test_a_run_goes_on_where_it_was_stopped_and_prints_its_seed(tmp_path, capsys):
    path = tmp_path / "matrix.json"
    cell = next(each for each in CELLS if each.machine == "positioning" and each.rate_hz == 100)
    chosen = ["--out", str(path), "--cells", cell.name, "--sound", "1"]
    command.main([*chosen, "--seed", "3"])
    assert f"seed 3, 1 of {len(CELLS)} cells" in capsys.readouterr().out
    kept = json.loads(path.read_text())
    ((key, first),) = kept["answers"].items()
    assert key == f"{cell.name} | sound | 0" and first["seed"] == 3
    kept["answers"][key]["causes"] = ["from the file"]
    path.write_text(json.dumps(kept))
    command.main(chosen)
    shown = capsys.readouterr().out
    assert "seed 3" in shown and f"| {cell.name} | {int(tables.alarm(first))} of 1 |" in shown
    with pytest.raises(SystemExit):
        command.main(["--out", str(path), "--cells", "no such cell"])
    assert "no cell has these words" in capsys.readouterr().err


def test_a_sample_of_sound_recordings_raises_no_alarm():
    """Of three, with alarms in 2 % of them, more than one comes in one of 800. The documentation has the cells in which
    there are more."""
    chosen = [each for each in CELLS if each.machine == "axis" and each.rate_hz <= 250][:3]
    assert sum(tables.alarm(answer(dataclasses.astuple(each), 11)) for each in chosen) <= 1
