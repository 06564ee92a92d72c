"""What the plant's step of 250 us and its friction smoothing cost, as plant/EQUATIONS.md 15 states it."""

import math

import numpy as np
import pytest

from ranger_sim.plant.mechanics.body import FLIGHT, Body
from ranger_sim.plant.ranger import STEP_NS, RangerPlant
from ranger_sim.plant.walking import handling
from ranger_sim.plant.walking.motion import advance
from tests.plant.mechanics import benchmarks as bm
from tests.plant.walking.small_controllers import (
    SLOT,
    STEP_S,
    TICK,
    ElectricWalker,
    PaperGait,
    RecordGait,
    Walker,
    mid_stance_start,
)

START = ("outer", 0.09, 0.35, 1.825, 2.175)  # the record set's operator script
HELD_SLOTS = 3000  # 1.5 s


def test_errors_of_the_step_are_those_of_the_table():
    found = {(step, smoothing): error for step, smoothing, error in bm.step_errors((500.0, 250.0, 125.0, 62.5))}
    table = {
        (500.0, 0.05): 2.6e-6,
        (250.0, 0.05): 1.2e-8,
        (125.0, 0.05): 5.6e-9,
        (62.5, 0.05): 4.6e-10,
        (500.0, 0.01): 1.0e-4,
        (250.0, 0.01): 1.7e-5,
        (125.0, 0.01): 1.5e-6,
        (62.5, 0.01): 1.6e-8,
    }
    for key, error in table.items():
        # the table is rounded to two digits; the last bit of sin and tanh may differ between machines
        assert found[key] == pytest.approx(error, rel=0.2), key


def test_smoothing_of_friction_costs_what_the_table_says():
    for smoothing, difference in bm.smoothing_errors():
        expected = {0.1: 1.7e-3, 0.05: 8.2e-4, 0.02: 3.2e-4, 0.01: 1.5e-4}[smoothing]
        assert difference == pytest.approx(expected, rel=0.1)


def first_strike(parts):
    """Time (ns) of the first strike of the robust gait with each step cut in `parts`."""
    body = Body()
    mid_stance_start(body)
    walker = Walker(body, PaperGait())
    while body.record.steps < 1:
        if walker.count % TICK == 0:
            walker.controller.tick(walker)
        for part in range(parts):
            body.step_start_ns = walker.count * STEP_NS + part * STEP_NS // parts
            advance(body, STEP_S / parts)
        walker.count += 1
    return body.record.strike_time_ns


def test_a_strike_is_timed_within_a_microsecond():
    fine = first_strike(32)
    assert abs(first_strike(1) - fine) < 1000
    assert abs(first_strike(4) - fine) < 100


def test_touch_is_located_inside_a_step():
    """A robot dropped from 2 mm in flight lands when free fall says so: t = sqrt(2 gap / g)."""
    body = Body()
    handling.place(body, 0.0, 0.0)
    body.outer.angle, body.inner.angle = 0.1, -0.2
    body.outer.foot_angle, body.inner.foot_angle = 0.1, -0.2
    body.outer.motor_angle = body.inner.motor_angle = 0.0
    body.hip_y = body.outer.chain_y(body.outer.foot_angle, body.outer.angle) + 0.002
    body.hip.k = 0.0  # nothing turns: no spring, no cable stretch, centres of mass fall with the hip
    body.mode = FLIGHT
    body.standing = False
    body.outer.armed = body.inner.armed = True
    body.update_pose()
    count = 0
    while body.mode == FLIGHT:
        body.step_start_ns = count * STEP_NS
        advance(body, STEP_S)
        count += 1
    landed = body.record.touch_time_ns
    # the inertia of a falling body without rotation does not matter; 1 ns is the stamp's own unit
    assert abs(landed - math.sqrt(2 * 0.002 / 9.81) * 1e9) < 2.0


class Written(ElectricWalker):
    """A walk that keeps what it writes to the three bridges, slot after slot."""

    def __init__(self, plant):
        super().__init__(plant, RecordGait(RecordGait.ROBUST))
        self.writes = []

    def obey(self):
        super().obey()
        self.writes.append([round(count) for count in self.counts])


def answer(writes, parts):
    """Angles at the ends of the slots after the release, with these writes and each step cut in `parts`."""
    plant = RangerPlant()
    plant.step_ns = STEP_NS // parts
    plant.step_s = plant.step_ns * 1e-9
    body = plant.body
    plant.hold(*START)
    angles = []
    for slot, counts in enumerate(writes):
        if slot == HELD_SLOTS:
            plant.release(0.8)
        for motor, count in zip(plant.motors, counts, strict=False):
            count *= int(motor.mounting)
            motor.drive.write_pwm(plant.time_ns, max(count, 0), max(-count, 0), 600)
            motor.drive.watchdog_edge(plant.time_ns)
        for _ in range(SLOT * parts):
            plant.step()
        if slot >= HELD_SLOTS:
            angles.append((body.outer.foot_angle, body.outer.angle, body.inner.angle, body.inner.foot_angle))
    return np.array(angles)


def test_windings_and_body_together_answer_commands_as_in_finer_steps():
    """The first 0.3 s after the release: a heel-strike, push-off and the swing (measured here: 1.8e-5 rad)."""
    plant = RangerPlant()
    walker = Written(plant)
    plant.hold(*START)
    walker.run(1, HELD_SLOTS * 0.0005)
    plant.release(0.8)
    walker.run(10, (HELD_SLOTS + 600) * 0.0005)
    assert plant.steps == 1 and len(walker.writes) == HELD_SLOTS + 600
    fine = answer(walker.writes, 8)
    assert np.abs(answer(walker.writes, 1) - fine).max() < 5e-5
