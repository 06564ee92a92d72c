"""Faults of battery, supplies and processors of the whole robot: what they take, what becomes of it, their end."""

from contextlib import closing

import pytest

from ranger_sim.boards.quirks import Quirks
from ranger_sim.can_bus.node import OPERATING
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import wiring_points
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

START, END = "60 ms", "70 ms"
START_NS, END_NS = 60_000_000, 70_000_000


@pytest.fixture
def robot():
    with closing(Ranger(Scenario(seed=1))) as one:
        yield one


# ---- battery


def test_a_sagging_battery_takes_what_its_resistance_and_its_drop_take(robot):
    fault = robot.inject("battery", "sag", START, END, ohm=0.5, drop=2.0)
    battery = robot.plant.electrics.battery
    healthy_V = battery.open_voltage_V
    robot.run_for(0.065)
    # E(q) - 2 V - (0.5 / 7 + 0.5) ohm times the current, which is that of this voltage
    expected_V = battery.open_circuit_V(battery.charge) - (0.5 / 7 + 0.5) * battery.current_A
    assert battery.voltage_V == pytest.approx(expected_V, abs=1e-6)
    assert fault.largest_difference == pytest.approx(2.0 + 0.5 * battery.current_A, rel=0.1)
    assert battery.open_voltage_V == pytest.approx(healthy_V - 2.0, abs=0.01)
    robot.run_for(0.01)
    assert fault.acted_count == 40 and END_NS < fault.cleared_ns <= END_NS + 500_000
    assert battery.open_voltage_V == pytest.approx(healthy_V, abs=0.01)


def test_a_pack_that_is_lost_leaves_its_current_to_the_others_and_comes_back_with_its_charge(robot):
    fault = robot.inject("battery", "pack_lost", START, END, packs=6)
    battery = robot.plant.electrics.battery
    robot.run_for(0.06)
    charge = battery.charge
    robot.run_for(0.01 - 0.0005)
    assert battery.resistance_ohm == pytest.approx(0.5)
    used = charge - battery.charge
    robot.run_for(0.005)
    assert battery.resistance_ohm == pytest.approx(0.5 / 7)
    # six packs kept what they had: a seventh of the last one's loss is what is missing, and what was used since
    assert charge - battery.charge == pytest.approx(used / 7, rel=0.15 + 0.005 / 0.01)
    assert fault.acted and fault.largest_difference > 0.0 and fault.cleared_ns > END_NS
    with pytest.raises(UserError, match="one has to be left"):
        robot.inject("battery", "pack_lost", packs=7)


# ---- boards that begin anew


def test_a_brown_out_opens_the_bridge_at_once_and_the_board_begins_anew(robot):
    robot.run_for(0.05)
    drive = robot.plant.motors[wiring_points.HIP].drive
    before, node = robot.board("MCH"), robot.buses[0].nodes[1]
    assert drive.powered and not drive.is_open
    fault = robot.inject("MCH.supply", "brown_out", START, off_ms=20)
    robot.run_for(0.0115)
    assert drive.is_open and not drive.powered and node.mode != OPERATING
    assert robot.loop.board("MCH") is not before
    robot.run_for(0.05)
    # 20 ms without power and 1 ms until the program starts
    assert fault.ended_ns == START_NS + 21_000_000
    assert fault.acted_count == 1 and fault.ended_ns < fault.cleared_ns < fault.ended_ns + 2_000_000
    after = robot.board("MCH")
    assert after is robot.loop.board("MCH") is not before
    assert after.crystal.ppb == before.crystal.ppb
    assert drive.powered and not drive.is_open  # its watchdog line toggles again
    assert after.scheduler.slot_count == pytest.approx((111.5 - 81) / 0.5, abs=2)
    sent = node.sent
    robot.run_for(0.01)
    assert node.mode == OPERATING and node.sent > sent + 10


@pytest.mark.parametrize("name", ["MCSI", "UI", "CSR", "MB"])
def test_every_board_comes_back_from_a_reset(robot, name):
    fault = robot.inject(f"{name}.processor", "reset", START)
    robot.run_for(0.1)
    assert fault.acted and fault.cleared_ns > fault.ended_ns == START_NS + 1_000_000
    board = robot.board(name)
    assert board.scheduler.slot_count > 10
    if name == "CSR":  # its time begins at 0 when its program starts
        assert board.time.ms == pytest.approx(39, abs=2)
    for bus in robot.buses:
        assert all(node.mode == OPERATING for node in bus.nodes)


def test_a_router_that_begins_anew_sends_each_board_its_new_time(robot):
    robot.inject("CSR.supply", "brown_out", START, off_ms=2)
    robot.run_for(0.1)
    times = {name: robot.board(name).time.ms for name in ("MCH", "MCFO", "MCFI", "MCSI", "UI")}
    assert all(value == pytest.approx(37, abs=3) for value in times.values())


# ---- processors


def test_extra_cycles_are_charged_to_their_function_and_to_no_other(robot):
    task = robot.board("MCH").scheduler.find("hb_beat")
    fault = robot.inject("MCH.processor", "extra_cycles", START, END, task="hb_beat", cycles=6000)
    robot.run_for(0.1)
    assert task.noted_most == 6000 + 2 * 21  # its own cost, boards/hip.py
    assert fault.acted_count == pytest.approx(20, abs=1) and fault.cleared_ns > END_NS
    assert task.cost == 2 * 21
    with pytest.raises(UserError, match="did you mean 'hb_beat'|available: .*hb_beat"):
        robot.inject("MCH.processor", "extra_cycles", task="hb_beet")


def test_a_function_that_does_not_return_drops_the_slots_of_its_time(robot):
    scheduler = robot.board("MCH").scheduler
    robot.run_for(0.05)
    overruns = scheduler.overruns
    fault = robot.inject("MCH.processor", "stall", START, task="hb_beat", ms=4)
    robot.run_for(0.05)
    assert fault.acted and fault.ended_ns - fault.acted_ns == pytest.approx(4e6, abs=0.5e6)
    # eight slots of 0.5 ms find the row unfinished
    assert scheduler.overruns - overruns == pytest.approx(8, abs=1)
    assert robot.board("MCH").errors.totals[codes.ASCHED_DNF] >= 7
    assert fault.cleared_ns > fault.ended_ns
    assert scheduler.max_slot_cycles >= 4e-3 * 60e6


def test_a_function_may_be_held_until_the_fault_ends(robot):
    fault = robot.inject("UI.processor", "stall", START, "75 ms", task="beat", ms=0)
    robot.run_for(0.1)
    assert fault.ended_ns == 75_000_000 and fault.largest_difference == pytest.approx(15e6, abs=2e6)
    assert fault.cleared_ns > fault.ended_ns


@pytest.mark.parametrize("kills", [True, False])
def test_a_full_receive_ring_kills_the_board_where_it_does_so_on_the_robot(kills):
    with closing(Ranger(Scenario(seed=1), quirks=Quirks(full_receive_ring_kills=kills))) as robot:
        fault = robot.inject("MCH.processor", "full_ring", START)
        robot.run_for(0.12)
        board = robot.board("MCH")
        assert fault.acted_count == 1 and fault.largest_difference == 63 and fault.ended_ns == fault.acted_ns
        slots = board.scheduler.slot_count
        served = board.can_controller.rx_source.served
        robot.run_for(0.01)
        if kills:
            # 18,800 interrupts in 20 ms and nothing else (robot.md T4.1)
            assert board.can_controller.rx_source.served - served == pytest.approx(9400, rel=0.02)
            assert board.scheduler.slot_count == slots and fault.cleared_ns < 0
            assert "power cycle" in fault.permanent
            cure = robot.inject("MCH.supply", "brown_out", off_ms=1)
            robot.run_for(0.02)
            assert cure.cleared_ns > 0 and robot.board("MCH").scheduler.slot_count > 10
        else:
            assert board.scheduler.slot_count - slots == pytest.approx(20, abs=1)
            assert fault.cleared_ns > fault.ended_ns and not fault.permanent


def test_the_ring_of_a_board_that_is_not_a_satellite_is_refused(robot):
    with pytest.raises(UserError, match="no ring of a satellite"):
        robot.inject("CSR.processor", "full_ring")


@pytest.mark.parametrize("ppm", [5000, -10_000])
def test_a_crystal_that_is_far_off_changes_the_slots_of_its_board_by_so_much(robot, ppm):
    fault = robot.inject("MCH.processor", "crystal", START, "160 ms", ppm=ppm)
    robot.run_for(0.061)
    first = robot.board("MCH").scheduler
    begin_ns, begun = first.slot_time, first.slot_count
    robot.run_for(0.09)
    took_ns, slots = first.slot_time - begin_ns, first.slot_count - begun
    # slots of 0.5 ms by a crystal that is off by its own 30 ppm at most and `ppm` more
    measured_ppm = (500_000 * slots / took_ns - 1.0) * 1e6
    assert measured_ppm == pytest.approx(ppm, abs=31 + 1e-4 * abs(ppm))
    robot.run_for(0.02)
    assert fault.acted and fault.largest_difference == ppm and fault.cleared_ns > 160_000_000


def test_a_router_whose_crystal_is_slow_slows_everybodys_time(robot):
    robot.run_for(0.06)
    before = {name: robot.board(name).time.ms for name in ("CSR", "MCH")}
    robot.inject("CSR.processor", "crystal", ppm=-10_000)
    robot.run_for(0.3)
    for name, ms in before.items():
        assert robot.board(name).time.ms - ms == pytest.approx(300 * 0.99, abs=1.5)


def test_an_interrupt_that_asks_for_ever_leaves_its_board_no_time(robot):
    board = robot.board("UI")
    fault = robot.inject("UI.processor", "stuck_interrupt", START, "62 ms", interrupt="slot timer")
    robot.run_for(0.062)
    # a service takes 180 cycles with its latency (boards/firmware_board.py), 3 us; the rest is other interrupts'
    assert 0.8 * 2e-3 < fault.acted_count * 180 / 60e6 <= 2e-3 + 3e-6
    robot.run_for(0.03)
    assert fault.cleared_ns > 62_000_000 and board.errors.totals[codes.ASCHED_DNF] > 0
    with pytest.raises(UserError, match="available: |did you mean"):
        robot.inject("UI.processor", "stuck_interrupt", interrupt="nothing")


# ---- two at a time


@pytest.mark.parametrize(
    ("first", "second", "common"),
    [
        (("battery", "sag", {}), ("battery", "pack_lost", {}), "battery"),
        (("battery", "sag", {}), ("battery", "sag", {"drop": 1.0}), "battery"),
        (("can1", "noise", {}), ("can1", "noise", {"rate": 1e-3}), "can1"),
        (("MCH.can1", "bit_rate", {}), ("MCH.can1", "bit_rate", {"rate": 5e5}), "MCH.can1"),
        (("MCH.can1", "loss", {}), ("MCH.can1", "loss", {}), "MCH.can1:loss of frame any"),
        (("CSR.ssp", "missing", {}), ("MB.ssp", "checksum", {}), "the link of router and main brain"),
        (
            ("MCH.processor", "extra_cycles", {"task": "MCH_ANGLE"}),
            ("MCH.processor", "stall", {"task": "MCH_ANGLE"}),
            "MCH.processor, MCH_ANGLE",
        ),
        (("MCH.processor", "crystal", {}), ("MCH.processor", "crystal", {"ppm": -5000}), "MCH.processor, its crystal"),
        (("MCH.supply", "brown_out", {}), ("MCH.processor", "reset", {}), "MCH, which is not back yet"),
        (("MCH.supply", "brown_out", {}), ("MCH.processor", "crystal", {}), "MCH, which is not back yet"),
        (("MCH.adc_external", "gain", {}), ("MCH.supply", "brown_out", {}), "MCH, which would be taken away"),
    ],
)
def test_a_second_fault_of_what_the_first_one_has_is_refused_and_may_come_when_that_is_clear(
    robot, first, second, common
):
    one = robot.inject(first[0], first[1], "10 ms", "12 ms", **first[2])
    robot.inject(second[0], second[1], "11 ms", "13 ms", **second[2])
    with pytest.raises(UserError, match=f"still works at {common}.*; one fault at a time"):
        robot.run_for(0.02)
    robot.loop.watchers.remove(robot.faults.pop())
    robot.run_for(0.15)
    assert one.cleared_ns > 0
    later = robot.inject(second[0], second[1], **second[2])
    robot.run_for(0.001)
    assert later.activated_ns > one.cleared_ns


def test_separate_parts_of_one_place_may_be_at_fault_side_by_side(robot):
    faults = [
        robot.inject("MCH.processor", "extra_cycles", "10 ms", "20 ms", task="MCH_ANGLE"),
        robot.inject("MCH.processor", "extra_cycles", "10 ms", "20 ms", task="motor_encoder_rezero"),
        robot.inject("MCH.processor", "crystal", "10 ms", "20 ms"),
        robot.inject("CSR.can1", "loss", "10 ms", "20 ms", frame="MCH_ANGLE"),
        robot.inject("CSR.can1", "loss", "10 ms", "20 ms", frame="MCH_ANG_RATE"),
    ]
    robot.run_for(0.06)
    assert [fault.acted and fault.cleared_ns > 0 for fault in faults] == [True] * 5
