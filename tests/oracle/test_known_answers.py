"""Figures of the summary that a run's files do not have, each with an answer that is known beforehand."""

import contextlib
import hashlib
import json
import types

import numpy as np
import pytest

from ranger_sim import loading
from ranger_sim.can_bus.bus import Bus
from ranger_sim.firmware_sim.board import Board
from ranger_sim.harness.outside import profile
from ranger_sim.plant.mechanics.walk_record import WalkRecord
from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.ranger.records.strike_watch import StrikeWatch
from ranger_sim.ranger.records.summary import energy, motor_powers, oddities
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule


@pytest.fixture
def powered_up():
    """A robot that ran for 60 ms; it is held on its stand."""
    with contextlib.closing(Ranger(Scenario(), log="full")) as robot:
        robot.run(StopRule(time_s=0.06), 1.0)
        yield robot


# --- what was asked for ---------------------------------------------------------------------------------------


def test_options_are_reported_as_they_were_given(tmp_path):
    model = tmp_path / "model.toml"
    model.write_text("", encoding="utf-8")
    asked = {
        "controller": "robust",
        "body": "appendix",
        "seed": 77,
        "slope_rad": 0.0125,
        "floor_roughness_m": 0.0015,
        "model_file": str(model),
    }
    wanted = Scenario(**asked, battery_charge=0.625, battery_capacity_Wh=493.0, electronics_off=("left-outer-ankle",))
    with contextlib.closing(Ranger(wanted, profile=profile.load("hil-1mbit"))) as robot:
        robot.run(StopRule(time_s=0.01), 1.0)
        reported = json.loads(json.dumps(robot.summary()))
    assert {name: reported[name] for name in asked} == asked
    assert reported["electronics_off"] == ["left-outer-ankle"]
    assert reported["battery"]["capacity_Wh"] == 493.0 and reported["battery"]["charge_at_start"] == 0.625
    assert reported["profile"] == "hil-1mbit"
    assert reported["oddities"]["contact"] == "sticking"  # plant/bodies/appendix.toml
    assert reported["steps"] == 0 and reported["fell"] is False and reported["fall_cause"] is None
    # methods of compiled classes are no Python functions
    assert reported["compiled"] is not isinstance(Bus.advance, types.FunctionType)
    assert reported["compiled"] is loading.RUNS_COMPILED


def test_a_run_without_options_says_so():
    with contextlib.closing(Ranger()) as robot:
        reported = robot.summary()
    assert reported["profile"] is None and reported["model_file"] is None and reported["electronics_off"] == []


def test_paces_are_virtual_time_over_that_of_the_clocks(powered_up):
    powered_up.wall_s, powered_up.cpu_s = 0.03, 0.24
    reported = powered_up.summary()
    assert reported["realtime_factor"] == pytest.approx(2.0) and reported["cpu_factor"] == pytest.approx(0.25)
    powered_up.cpu_s = 0.0
    assert powered_up.summary()["cpu_factor"] is None


# --- energy ---------------------------------------------------------------------------------------------------


def test_empty_batteries_are_reported():
    # 5.15 W of electronics empty 5 mWh in 3.5 s, before the motors have walked any far
    with contextlib.closing(Ranger(Scenario(battery_capacity_Wh=0.005))) as robot:
        robot.run(StopRule(time_s=10.0), 10.0)
        reported = robot.summary()
    assert reported["battery"]["empty"] is True and reported["battery"]["charge"] == 0.0
    assert reported["fell"] is True and reported["fall_cause"] == "battery empty"
    # what the packs held is what they gave and lost: the curve's charge at its own voltage, 3.0 to 4.2 V, mean 3.72
    assert reported["battery"]["delivered_Wh"] + reported["battery"]["lost_inside_Wh"] == pytest.approx(0.005, rel=0.01)


def test_what_motors_took_before_the_robot_was_let_go_is_nobodys_walk():
    plant = RangerPlant()
    robot = types.SimpleNamespace(plant=plant, walked_s=10.0)
    for motor in plant.motors:
        motor.drawn_J = 100.0
    plant.begin()
    for number, motor in enumerate(plant.motors, start=1):
        motor.drawn_J += 36.0 * number
    plant.record.begin(2_000_000_000, 0.0)
    plant.time_ns = 12_000_000_000
    powers = motor_powers(robot)
    assert powers == pytest.approx({"hip": 3.6, "outer_ankle": 7.2, "inner_ankle": 10.8, "steering": 14.4})
    parts = energy(robot)
    assert [parts[name] for name in powers] == pytest.approx([0.01, 0.02, 0.03, 0.04])
    electronics = plant.electronics_power_W * 10.0 / 3600.0
    assert parts["electronics"] == pytest.approx(electronics)
    assert parts["total"] == pytest.approx(0.1 + electronics)


# --- the walk -------------------------------------------------------------------------------------------------


class Brain(Board):
    """As much of the main brain as is watched: which leg swings, and since when its slot runs."""

    leg = 0
    slot_ns = 0

    def watched(self):
        return self.leg

    def latest_slot(self):
        return self.slot_ns


def noticed(watch, brain, slot_ms):
    """The main brain flips the swing leg in the slot that began at `slot_ms`."""
    brain.leg, brain.slot_ns = 1 - brain.leg, slot_ms * 1_000_000
    watch.observe()


def test_delays_of_strikes_have_a_known_mean_and_deviation():
    plant, brain = RangerPlant(), Brain("MB")
    watch = StrikeWatch(plant, brain)
    assert watch.statistics() == {"mean": None, "std": None, "count": 0, "unmatched": 0, "missed": 0}
    noticed(watch, brain, 5)  # before any step: the reset on entering the walk
    # of the seven strikes the third, the fifth and the sixth go unnoticed
    for steps, strike_ms, slot_ms in [(1, 1000, 1010), (2, 2000, 2016), (4, 4000, 4010), (7, 7000, 7016)]:
        plant.steps = steps
        plant.strike_time_ns = strike_ms * 1_000_000
        noticed(watch, brain, slot_ms)
    noticed(watch, brain, 7400)  # no new strike
    watch.observe()  # no flip
    reported = watch.statistics()
    assert reported == {"mean": pytest.approx(13.0), "std": pytest.approx(3.0), "count": 4, "unmatched": 1, "missed": 3}


def touch(record, ms, leg, strike=True, ahead=0.3, x=0.0, push=1.0, gap=0.01):
    record.touch(ms * 1_000_000, leg, strike, ahead, x, 0.0, (0.0, push, 0.0, 0.0), 0.0, True, gap, 0.0)


def test_means_and_deviations_of_steps_leave_out_the_first_five():
    record = WalkRecord()
    record.begin(0, 1.0)
    lengths = [9.0, 9.0, 9.0, 9.0, 9.0, 0.3, 0.5, 0.4, 0.4]
    times_ms = [9000, 9000, 9000, 9000, 9000, 500, 700, 600, 600]
    assert (record.mean_step_length_m(), record.step_length_deviation_m()) in ((0.0, 0.0), (None, None))
    x, ms = 1.0, 0
    for number, (length, time_ms) in enumerate(zip(lengths, times_ms, strict=True)):
        x, ms = x + length, ms + time_ms
        touch(record, ms, number % 2, x=x)
        # the trailing foot leaves 40 ms later, from the sixth step on 10, 20, 30, 40 ms
        record.leave((ms + (40 if number < 5 else 10 * (number - 4))) * 1_000_000, 1 - number % 2, False)
    assert record.steps == 9 and record.distance_m == pytest.approx(46.6)
    assert record.mean_step_length_m() == pytest.approx(0.4) and record.mean_step_time_s() == pytest.approx(0.6)
    # sqrt((0.1^2 + 0.1^2) / 4): of the walk itself, not an estimate from a sample of it
    assert record.step_length_deviation_m() == pytest.approx(0.1 / 2**0.5)
    assert record.step_time_deviation_s() == pytest.approx(0.1 / 2**0.5)
    assert record.mean_double_stance_s() == pytest.approx(0.025)


def test_touches_and_departures_of_feet_count_for_what_they_are():
    record = WalkRecord()
    record.begin(0, 0.0)
    touch(record, 100, 0, gap=0.001)  # the first step starts anywhere in the swing: its gap says nothing
    touch(record, 110, 0, strike=False, ahead=0.2)  # the leading foot came back
    touch(record, 120, 0, strike=False, ahead=-0.2)  # it lies behind
    touch(record, 130, 1, strike=False, ahead=0.2)  # not its turn
    record.leave(140_000_000, 1, False)
    record.leave(150_000_000, 0, True)  # the leading foot, and no foot on the floor
    touch(record, 700, 1, push=-0.25, gap=0.02)
    touch(record, 1300, 0, push=-0.125, gap=0.03)
    record.brush(False)
    record.brush(True)
    record.brush(True)
    assert (record.touches, record.steps, record.bounces, record.recontacts) == (6, 3, 1, 2)
    assert (record.lift_offs, record.flights, record.lead_lifts) == (2, 1, 1)
    assert (record.brushes, record.scuffs) == (1, 2)
    assert (record.tensile_strikes, record.tensile_impulse_min_Ns, record.tensile_impulse_Ns) == (2, -0.25, -0.125)
    assert record.min_clearance_m == 0.02


def test_every_count_of_the_record_is_reported_under_its_own_name():
    counts = (
        "touches", "lift_offs", "bounces", "recontacts", "scuffs", "flights", "slides", "jams", "lead_lifts",
        "tensile_strikes",
    )  # fmt: skip
    record = WalkRecord()
    record.steps = 2
    for number, name in enumerate(counts, start=11):
        setattr(record, name, number)
    record.tensile_impulse_min_Ns, record.min_clearance_m = -0.5, 0.0075
    seen = types.SimpleNamespace(friction_ratio_max=0.7, slip_s=0.25, normal_force_min=-3.0, pull_s=0.125)
    body = types.SimpleNamespace(seen=seen, compliant=False)
    plant = types.SimpleNamespace(record=record, body=body, parameters=types.SimpleNamespace(contact="coulomb"))
    reported = oddities(plant)
    assert {name: reported[name] for name in counts} == {name: number for number, name in enumerate(counts, start=11)}
    assert reported["tensile_impulse_min_Ns"] == -0.5 and reported["min_clearance_m"] == 0.0075
    assert (reported["friction_ratio_max"], reported["slip_s"]) == (0.7, 0.25)
    assert (reported["normal_force_min_N"], reported["pull_s"], reported["contact"]) == (-3.0, 0.125, "coulomb")
    record.steps = 1  # the first step starts anywhere in the swing
    assert oddities(plant)["min_clearance_m"] is None and oddities(plant)["tensile_strikes"] == 20
    body.compliant = True  # strikes that last have no impulse
    assert oddities(plant)["tensile_strikes"] is oddities(plant)["tensile_impulse_min_Ns"] is None


# --- boards ---------------------------------------------------------------------------------------------------


def test_the_longest_slot_is_reported_in_the_boards_own_cycles(powered_up):
    # a function of many cycles in every board: its slot is that long, in cycles of 60 MHz or the main brain's 208 MHz
    tasks = {"MB": ("parse_ssp", 208.0), "CSR": ("send_time", 60.0), "MCH": ("dn_safety", 60.0)}
    before = powered_up.summary()["slots"]
    cycles = {"MB": 300_000, "CSR": 45_000, "MCH": 10_000}
    for board, (task, _) in tasks.items():
        powered_up.replace(board, task, lambda: None, cost=cycles[board], limit=10**6)
    powered_up.run(StopRule(time_s=0.08), 1.0)
    after = powered_up.summary()["slots"]
    for board, (_, MHz) in tasks.items():
        alone_us = cycles[board] / MHz
        # with what its slot did before, and interrupts that go on in the meantime: below half of its time
        most_us = 1.5 * alone_us + before[board]["max_execution_us"]
        assert alone_us < after[board]["max_execution_us"] <= most_us
        assert after[board]["max_execution_us"] < after[board]["budget_us"]
    assert after["UI"]["max_execution_us"] == before["UI"]["max_execution_us"]


def test_the_digest_is_that_of_the_bytes_that_were_kept(powered_up):
    kept = powered_up.logbook.frames()
    total = hashlib.blake2b(b"ranger-sim trace 3\n", digest_size=32)
    for bus in range(4):
        rows = [kept[name][kept["bus"] == bus] for name in ("time_ns", "word0", "flags", "word1", "identifier")]
        time, word0, flags, word1, identifier = (row.astype(np.int64) for row in rows)
        packed = np.column_stack([time, word0 << 12 | flags << 4 | bus, word1 << 29 | identifier])
        total.update(hashlib.blake2b(packed.astype("<i8").tobytes(), digest_size=32).digest())
    samples = powered_up.logbook.samples().astype("<f8").tobytes()
    total.update(hashlib.blake2b(samples, digest_size=32).digest())
    assert powered_up.summary()["trace_digest"] == total.hexdigest()
