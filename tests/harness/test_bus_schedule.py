"""Named bus schedules: what is thinned is sent as seldom as it says, nothing else changes, and the bounds hold."""

import contextlib
import dataclasses

import pytest

from ranger_sim import datatable
from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.can_bus.bounds import utilisation
from ranger_sim.datatable.generated import all_variables, mb
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.scheduler import Occasional, Task
from ranger_sim.foundation.events import CAN_REQUEST, CAN_TX_DONE, STAGE_BUS, TX_SENT
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import bus_schedule, profile
from ranger_sim.harness.outside.bus_schedule import BusSchedule
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

TABLE = datatable.load()
BUSES = profile.BUSES
HIL = "hil-1mbit"
ROUTER_RING = 7 + 2  # frames that a bus's ring and two hardware buffers hold (boards/modules/routing.py)


def with_schedule(**changes):
    """The default profile with one schedule on every bus."""
    schedule = dataclasses.replace(profile.default().buses["can1"].schedule, **changes)
    buses = {name: dataclasses.replace(bus, schedule=schedule) for name, bus in profile.default().buses.items()}
    return dataclasses.replace(profile.default(), buses=buses)


def bounds(chosen):
    return {
        name: bus_schedule.bounds_of(
            TABLE, name, bus.bit_rate, bus_schedule.streams(TABLE, name, chosen.schedules(), chosen.absent())
        )
        for name, bus in chosen.buses.items()
    }


# ---- rows


def test_rows_are_laid_out_over_passes_with_what_is_not_due_left_out():
    def nothing():
        return None

    angle, rate, power = (Task(nothing, name=name) for name in ("angle", "rate", "power"))
    listed = Occasional((Task(nothing, name="error"),))
    rows = [[angle], [rate], [power], [listed]]
    schedule = BusSchedule("x", "", "", {"MCH_ANG_RATE": 2, "MCH_BATT_POWER": 3}, {"MCH": 2}, 0)
    laid_out = bus_schedule.thinned_rows(TABLE.board("MCH"), rows, schedule)
    a, r, p, o = [angle], [rate], [power], [listed]
    assert laid_out == [
        a, [], [], [],  # rate in the odd passes (row 1), power in passes 2 and 5 (row 2), the list in odd ones (row 3)
        a, r, [], o,
        a, [], p, [],
        a, r, [], o,
        a, [], [], [],
        a, r, p, o,
    ]  # fmt: skip


def test_a_schedule_that_thins_nothing_leaves_the_board_alone():
    board = HipBoard(Crystal(), Quirks(), 0)
    rows = board.scheduler.schedule.rows
    bus_schedule.apply(board, profile.default().schedules())
    assert board.scheduler.schedule.rows is rows


def test_a_board_that_runs_already_is_refused():
    board = HipBoard(Crystal(), Quirks(), 0)
    board.advance(2_000_000)
    with pytest.raises(UserError, match="MCH: a bus schedule is given before the first slot"):
        bus_schedule.apply(board, profile.load(HIL).schedules())


def sent_by_the_hip(chosen, until_ns):
    """(time, name) of every frame that the hip board alone puts out."""
    board = HipBoard(Crystal(), Quirks(), 0)
    bus_schedule.apply(board, chosen.schedules())
    found = []
    for time in range(25_000, until_ns, 25_000):
        board.advance(time)
        while board.outbox.take():
            out = board.outbox
            if out.kind == CAN_REQUEST:
                found.append((out.time, all_variables.NAMES[out.c]))
                board.inbox.push(
                    max(out.time, time - 25_000) + 37_000, STAGE_BUS * 256, CAN_TX_DONE, out.a, out.b, TX_SENT
                )
    return found


def test_a_thinned_board_sends_every_nth_frame_and_the_others_as_before():
    chosen = with_schedule(every={"MCH_ANGLE": 4, "MCH_BATT_POWER": 5}, occasional={"MCH": 3})
    before, after = sent_by_the_hip(profile.default(), 400_000_000), sent_by_the_hip(chosen, 400_000_000)

    def count(frames, name):
        return sum(1 for _, each in frames if each == name)

    for name, n in (("MCH_ANGLE", 4), ("MCH_BATT_POWER", 5), ("MCH_ANG_RATE", 1), ("MCH_STATUS", 3)):
        assert abs(count(before, name) / n - count(after, name)) <= 1, name
    gaps = {round((b - a) / 1e6) for a, b in zip(*(
        [time for time, name in after if name == "MCH_ANGLE"][start:] for start in (0, 1)
    ), strict=False)}  # fmt: skip
    assert gaps == {8}  # ms: every fourth pass of 2 ms


def test_commands_leave_in_their_slots_and_the_others_one_at_a_time_in_turn():
    board = MainBrainBoard(Crystal(), Quirks(), 0)
    chosen = with_schedule(every={"MCH_COMMAND_CURRENT": 2, "MCFI_STIFFNESS": 3}, commands_in_turn=2)
    bus_schedule.apply(board, chosen.schedules())
    io, store = board.io, board.store
    command, stiffness = mb.MCH_COMMAND_CURRENT, mb.MCFI_STIFFNESS
    assert set(io.send_ids) == {command, stiffness}
    assert sorted([*io.send_ids, *io.turn_ids]) == sorted(mb.SEND)
    sent = []
    for number in mb.SEND:
        store.mark_unread(number)
    for slot in range(1, 2 * len(mb.SEND) + 3):
        store.mark_unread(command)
        waiting = {n for n in mb.SEND if store.is_unread(n, io.subscriber)}
        count = io.send()
        gone = [n for n in mb.SEND if n in waiting and not store.is_unread(n, io.subscriber)]
        assert count == len(gone)
        while board.link.queue_count:
            board.link.next_segment()
        rare = [n for n in gone if n not in (command, stiffness)]
        assert (command in gone) == (slot % 2 == 0)
        assert stiffness not in gone or slot % 3 == 0
        assert len(rare) <= (1 if slot % 2 == 1 else 0)
        sent += rare
    assert sorted(sent) == sorted(set(mb.SEND) - {command, stiffness})  # each once, none starved


def test_buses_with_different_schedules_each_have_their_own():
    hil, full = profile.load(HIL), profile.default()
    mixed = dataclasses.replace(full, buses={**full.buses, "can1": hil.buses["can1"]})
    commands = bus_schedule.sort_commands(TABLE, mixed.schedules())
    turns = {variable.name: n for variable, n in commands.regular}
    assert (turns["MCH_STIFFNESS"], turns["MCFI_STIFFNESS"]) == (2, 1)
    names = {variable.name for variable in commands.in_turn}
    assert {"MB_STATUS", "MCH_SHUTDOWN"} <= names and "MCFI_SHUTDOWN" not in names
    assert {variable.name for variable in commands.at_once} >= {"MCFI_SHUTDOWN", "UI_SET_LED_1"}
    assert commands.turn_every == 2
    assert all(found.met for found in bounds(mixed).values())


# ---- bounds


@pytest.mark.parametrize("name", [None, HIL])
def test_every_frame_of_the_robot_meets_its_deadline(name):
    chosen = profile.default() if name is None else profile.load(name)
    for bus, found in bounds(chosen).items():
        late = [bound.message.name for bound in found.bounds if not bound.met]
        assert found.met and not late, f"{bus}: {late}"
        if name == HIL:
            assert all(count <= ROUTER_RING for count in found.waiting.values())  # so no ring ever overflows


def test_the_full_schedule_does_not_fit_one_megabit():
    full = profile.default()
    buses = {name: dataclasses.replace(bus, bit_rate=1_000_000) for name, bus in full.buses.items()}
    found = bounds(dataclasses.replace(full, buses=buses))
    assert not found["can4"].met
    assert utilisation((s.message for s in found["can4"].streams), 1_000_000) > 1


def test_absent_boards_send_nothing():
    found = bus_schedule.streams(TABLE, "can4", profile.default().schedules(), absent=("MCSI",))
    assert {stream.board for stream in found} == {"CSR", "MB", "MCFI"}
    found = bus_schedule.streams(TABLE, "can1", profile.default().schedules(), absent=("MB", "CSR"))
    assert {stream.board for stream in found} == {"MCH"}


def test_every_variable_on_a_bus_that_is_ever_sent_is_in_one_of_its_streams():
    for bus in BUSES:
        streamed = {v for s in bus_schedule.streams(TABLE, bus, profile.default().schedules()) for v in s.variables}
        for variable in TABLE.on_bus(bus.upper()):
            sent = variable.period_ms is not None or variable.publisher == "MB"
            assert (variable.name in streamed) == sent, variable.name


@pytest.fixture(scope="module", params=[None, HIL], ids=["robot", HIL])
def walked(request):
    """Two seconds of the robot, with the profile's rates and schedules; and the bounds of its buses."""
    chosen = profile.default() if request.param is None else profile.load(request.param)
    with contextlib.closing(Ranger(Scenario(), log="full", profile=chosen)) as robot:
        robot.run_for(2.0)
        frames = robot.logbook.frames()
        columns = [frames[name].tolist() for name in ("time_ns", "bus", "identifier")]
        yield robot, bounds(chosen), list(zip(*columns, strict=True))


def test_no_frame_of_the_robot_waits_longer_than_its_bound(walked):
    """From the transmit buffer on; the bounds count from the slot's beginning and include the rings."""
    robot, found, _ = walked
    for number, bus in enumerate(BUSES):
        for stream, bound in zip(found[bus].streams, found[bus].bounds, strict=True):
            for name in stream.variables:
                longest = robot.buses[number].counters.response_max_ns[all_variables.ID_OF[name]]
                assert longest <= bound.response_ns - bound.message.jitter_ns, f"{bus} {name}"


def test_no_stream_of_the_robot_sends_more_than_the_bounds_assume(walked):
    """After power-up, whose first slot sends every command once."""
    _, found, frames = walked
    for number, bus in enumerate(BUSES):
        for stream, bound in zip(found[bus].streams, found[bus].bounds, strict=True):
            own = {all_variables.ID_OF[name] for name in stream.variables}
            same = [s for s in found[bus].streams if own & {all_variables.ID_OF[v] for v in s.variables}]
            times = [t for t, b, i in frames if b == number and i in own and t > 100_000_000]
            one = stream.message
            for window in (one.period_ns, 10 * one.period_ns, 500_000_000):
                allowed = sum(-(-(window + bound.response_ns) // s.message.period_ns) + 1 for s in same)
                start = 0
                for end in range(len(times)):
                    while times[end] - times[start] > window:
                        start += 1
                    assert end - start + 1 <= allowed, f"{bus} {one.name}: {end - start + 1} in {window / 1e6} ms"


def test_no_queue_overflows_and_no_slot_overruns_at_one_megabit():
    with contextlib.closing(Ranger(Scenario(), profile=profile.load(HIL))) as robot:
        robot.run_for(2.0)
        summary = robot.summary()
    assert all(bus["lost"] == bus["queue_full"] == bus["single_shot_skipped"] == 0 for bus in summary["can"].values())
    assert all(board["overruns"] == 0 for board in summary["slots"].values())
    assert summary["profile"] == HIL and max(bus["load_mean"] for bus in summary["can"].values()) < 0.45


def test_a_name_that_is_not_a_variable_cannot_be_sent():
    io = MainBrainBoard(Crystal(), Quirks(), 0).io
    for numbers, dividers, turns in (([1, 99999], [1, 1], []), ([1], [1], [-1]), ([1, 2], [1], [])):
        with pytest.raises(UserError):
            io.thin(numbers, dividers, turns)
