"""What a model leaves that goes with one signal, and what becomes of names that leave too much of it."""

import dataclasses

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import api, left_over
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Equation, Recording
from ranger_sim.sysid.machines.positioning import FORCE_N_PER_V, Positioning
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.regression import Noise, Regression, Whitening
from tests.blind.generator.motor_bench import MOTOR_BENCH

COUNT = 2000


class Sliding:
    """A force by a rate, which is drawn as white noise, looked over by it and by time."""

    def __init__(self, bend):
        draw = generator(5, "left over")
        rate, noise = draw.normal(size=COUNT), draw.normal(size=COUNT)
        time_s = np.arange(COUNT) * 0.01
        force = 2.0 * rate + bend * np.abs(rate) + noise
        equation = Equation("force", "M", "mechanical", "N", force, {"viscous": rate}, np.ones(COUNT, dtype=bool))
        table = Table(time_s, {"force_N": force}, (slice(0, COUNT),), "sliding")
        self.recording = Recording(table, {"v": rate, "t": time_s}, {"force": equation})

    def generic(self, recording):
        return {"force": recording.signals}

    def left(self):
        regression = Regression([self.recording], noise=Noise({"force": Whitening(np.zeros(0), 1.0)}))
        return left_over.look(self, regression, [self.recording], seed=1)


def test_a_force_that_bends_with_the_rate_is_left_over_it():
    """|v| less its mean has a variance of 1 - 2/pi, and with the mean 1: ten cells see all but a few per cent of it."""
    found = Sliding(0.5).left()
    assert (found.equation, found.features) == ("force", "over v") and found.p < 1e-6
    assert found.chi2 == pytest.approx(COUNT * 0.5**2, rel=0.15)


def test_noise_alone_is_left_over_nothing():
    assert Sliding(0.0).left().p > 0.01


def test_a_load_cell_that_creeps_has_no_name_though_friction_under_load_explains_a_part(tmp_path):
    bench = MOTOR_BENCH.lasting(5.0)
    (case,) = bench.plan(6, 1, ["outside"], list(bench.CAUSES))
    case.effects = [("load_cell_creep", 4.0)]
    ((_, files, holdout, _),) = bench.generate(6, [case], tmp_path)
    found = api.diagnose(
        [tmp_path / each for each in files], "motor-bench", holdout=[tmp_path / each for each in holdout]
    )
    assert found.detected and found.abstained and not found.causes
    assert found.evidence.explained < 0.88


class Screw(Positioning):
    """A guide whose ripple has another phase in each run, so that further harmonics belong to it."""

    def effects(self, recordings):
        return [
            dataclasses.replace(each, phase_is_free=each.cause == "once_per_turn")
            for each in super().effects(recordings)
        ]


def test_a_ripple_in_few_rows_is_named_without_its_further_harmonics():
    """900 rows for a base of four numbers, and 59 pitches that could be harmonics, of two numbers each."""
    t = 0.01 * np.arange(900)
    x = 0.05 * np.sin(1.1 * t) + 0.03 * np.sin(2.3 * t + 1.0)
    v = 0.055 * np.cos(1.1 * t) + 0.069 * np.cos(2.3 * t + 1.0)
    a = -0.0605 * np.sin(1.1 * t) - 0.1587 * np.sin(2.3 * t + 1.0)
    force = 95.0 * a + 200.0 * v + 20.0 * np.sign(v) + 6.0 * np.cos(2.0 * np.pi * x / 0.02)
    noise = generator(5, "a ripple in few rows").normal(size=900)
    columns = {"position_m": x, "voltage_V": (force + 0.3 * noise) / FORCE_N_PER_V}
    found = diagnose(Screw(), [Table(t, columns, (slice(0, 900),), "ripple")]).result
    assert found.causes[0].name == "once_per_turn"
