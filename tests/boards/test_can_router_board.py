"""The router board whole: time, forwarding, load, slots, errors; alone on the table with its wires."""

import pathlib
import subprocess
import sys

import pytest

from ranger_sim.boards.can_router import ANALOG, CanRouterBoard, supply_pins_V
from ranger_sim.boards.modules.ssp_link import corrupted_copy
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import csr as table
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import CAN_STATUS, FLAG_SINGLE_SHOT, SSP_SEGMENT
from ranger_sim.foundation.numbers import float_of_word
from tests.boards.wires import Wires, quiet_brain

MS = 1_000_000


def build(quantum=25_000, phase_ns=0, crystal=None, **quirks):
    board = CanRouterBoard(crystal or Crystal(), Quirks.named(**quirks), phase_ns)
    brain, said = quiet_brain()
    wires = Wires(board, brain, quantum)
    wires.said = said
    return wires


# --- time ---------------------------------------------------------------------------------------------


def test_every_millisecond_all_four_buses_get_the_count_in_both_words():
    wires = build().run(20 * MS + 500_000)
    for bus in (1, 2, 3, 4):
        sync = wires.of(0, bus)
        assert [(w0, w1) for _, w0, w1 in sync] == [(n, n) for n in range(1, 21)]
        # the interrupt's latency, 12 cycles, after the millisecond
        assert [t for t, _, _ in sync] == [n * MS + 200 for n in range(1, 21)]
    assert {s[3] for s in wires.sent if s[2] == 0} == {8 | FLAG_SINGLE_SHOT}


def test_the_count_follows_the_routers_own_crystal():
    wires = build(crystal=Crystal(10_000_000, 40_000)).run(100 * MS)
    # 40 ppm fast: the hundredth ms comes 4 us early, and its 12 cycles of latency are a little shorter
    assert wires.of(0, 1)[-1] == (100 * MS - 4000 + 199, 100, 100)


def test_turns_of_the_main_loop_take_as_long_as_the_crystals_new_rate_makes_them():
    board = build().board
    # idle, a pair of 60 and 25 cycles has a quarter of the 20 of a turn of four: 90 cycles of 60 MHz, then of 66 MHz
    assert (board.pair_ns, board.route_ns[0]) == (1500, 1000)
    board.retune(100_000_000, 0)
    assert (board.pair_ns, board.route_ns[0]) == (1363, 909)


def errors_but_the_first(board):
    """Errors of the router other than the SSP_LOW_RATE of its first tick, before which no exchange can have been."""
    assert board.errors.totals[errors.SSP_LOW_RATE] == 1
    return sum(board.errors.totals) - 1


def test_a_busy_third_buffer_skips_the_millisecond_silently():
    wires = build()
    wires.dead.add(3)
    wires.run(10 * MS + 500_000)
    board = wires.board
    assert len(wires.of(0, 3)) == 1
    assert list(board.clock.skipped) == [0, 0, 0, 9, 0]
    assert len(wires.of(0, 2)) == 10
    assert errors_but_the_first(board) == 0


def test_the_count_wraps_after_two_to_the_thirty_two():
    wires = build()
    wires.board.time.ms = 2**32 - 2
    wires.run(3 * MS + 500_000)
    assert [w1 for _, _, w1 in wires.of(0, 1)] == [2**32 - 1, 0, 1]


def test_the_main_brain_gets_its_copy_of_the_time_every_millisecond():
    wires = build().run(50 * MS)
    stamps = [w1 for i, _, w1 in wires.heard if i == 0]
    assert stamps == list(range(0, 49)) or stamps == list(range(0, 50))


# --- tables of the firmware -----------------------------------------------------------------------------


def test_the_schedule_is_that_of_the_firmware():
    schedule = build().board.scheduler.schedule
    assert [task.name for task in schedule.every] == [
        "send_time", "update_errors", "count_load", "update", "show_load", "beat",
    ]  # fmt: skip
    assert [len(row) for row in schedule.rows] == [1] + [0] * 9
    assert [task.name for task in schedule.rows[0][0].tasks] == [
        "ERROR_CSR", "CSR_MCU_POWER", "CSR_MCU_CURRENT", "CSR_MCU_VOLTAGE",
        "CSR_CAN1_LOAD", "CSR_CAN2_LOAD", "CSR_CAN3_LOAD", "CSR_CAN4_LOAD",
    ]  # fmt: skip


def test_timer_link_and_buses_are_fast_interrupts_in_the_order_of_the_firmware():
    vic = build().board.vic
    assert [source.name for source in vic.fiq_list] == [
        "timer1", "ssp", "can1 receive", "can2 receive", "can3 receive", "can4 receive",
    ]  # fmt: skip
    assert {n: s.name for n, s in enumerate(vic.irq_list) if s} == {0: "slot timer", 10: "can error"}


# --- forwarding ---------------------------------------------------------------------------------------


def test_a_sensor_frame_is_in_the_links_ring_within_thirty_microseconds():
    wires = build()
    for n in range(40):
        wires.run(10 * MS + n * 217_000 + 50_000)
        router = wires.board.router
        wires.frame(wires.time + 1000, 1, 14, n, n)
        wires.run(wires.time + 1000 + 30_000)
        assert wires.board.can1.received == n + 1
        assert router.rx_read == router.rx_write
        assert router.table.sources[14] == 1
    wires.run(wires.time + MS)
    assert [(w0, w1) for i, w0, w1 in wires.heard if i == 14] == [(n, n) for n in range(40)]


def test_a_frame_reaches_the_main_brain_within_two_segment_periods_and_an_exchange():
    wires = build()
    wires.run(5 * MS + 300_000)
    wires.frame(wires.time + 1000, 4, 65, 1, 2)
    arrival = wires.time + 1000
    while (65, 1, 2) not in wires.heard:
        wires.run(wires.time + 25_000)
    # heard is filled when the exchange starts: at most one period after the frame was routed
    assert wires.time - arrival <= 200_000 + 30_000 + 25_000


def test_a_command_leaves_within_tens_of_microseconds_of_the_tick_that_frees_its_segment():
    wires = build()
    wires.run(5 * MS + 10_000)
    wires.brain.send(134, 0x123456, 99)
    wires.brain.flush()
    wires.run(7 * MS)
    (time, word0, word1), *rest = wires.of(134, 2)
    assert (word0, word1, rest) == (0x123456, 99, [])
    # loaded at the exchange of 5.2 ms, through at 5.365, free at the tick of 5.4
    assert 5_400_000 < time <= 5_440_000


def test_six_commands_of_a_segment_go_to_their_buses_in_order():
    wires = build()
    wires.run(5 * MS + 10_000)
    for identifier, bus in ((13, 1), (36, 3), (134, 2), (135, 2), (136, 2), (137, 2)):
        wires.brain.send(identifier, identifier, bus)
    wires.brain.flush()
    wires.run(7 * MS)
    sent = [(s[1], s[2]) for s in wires.sent if s[2] != 0]
    assert sorted(sent) == [(1, 13), (2, 134), (2, 135), (2, 136), (2, 137), (3, 36)]
    assert [i for b, i in sent if b == 2] == [134, 135, 136, 137]


def test_the_lag_quirk_holds_every_frame_until_the_next_one_comes():
    got = {}
    for lag in (False, True):
        wires = build(router_one_frame_lag=lag)
        for n, identifier in enumerate((14, 21, 15, 37)):
            wires.frame((n + 1) * 5 * MS, 1, identifier, 7, n)
        arrived = []
        for n in range(4):
            wires.run((n + 1) * 5 * MS + 2 * MS)
            arrived.append([i for i, _, _ in wires.heard if i in (14, 21, 15, 37)])
            wires.heard.clear()
        got[lag] = arrived
    assert got[False] == [[14], [21], [15], [37]]
    assert got[True] == [[], [14], [21], [15]]


def nominal_load(wires, seconds):
    """Frames per second up on the four buses (robot.md N1.10), 7500 down in 500 bundles; returns what was sent."""
    plan = []
    rates = {1: 1864, 2: 956, 3: 1956, 4: 3750}
    first = {1: 14, 2: 142, 3: 37, 4: 65}
    for bus, rate in rates.items():
        gap = 10**9 // rate
        for n in range(int(seconds * rate) - 20):
            plan.append((2 * MS + n * gap + bus * 7919, bus, first[bus], n))
    down = [13, 16, 17, 36, 42, 43, 64, 71, 72, 134, 135, 136, 137, 138, 139]
    plan.sort()
    for time, bus, identifier, n in plan:
        wires.frame(time, bus, identifier, n, 0)

    def commands(now, until):
        if now % (2 * MS) == 0 and now < (seconds - 0.02) * 1e9:
            for identifier in down:
                assert wires.brain.send(identifier, now, identifier)
            wires.brain.flush()

    wires.feeds.append(commands)
    wires.run(int(seconds * 1e9))
    return plan, down


def test_the_robots_load_passes_without_loss_lateness_or_reordering():
    wires = build()
    plan, down = nominal_load(wires, 0.3)
    board = wires.board
    for identifier in (14, 142, 37, 65):
        expected = [n for _, _, i, n in plan if i == identifier]
        assert [w0 for i, w0, _ in wires.heard if i == identifier] == expected
    for identifier in down:
        assert len(wires.of(identifier)) == 140
    assert sum(board.router.transmit_lost) == 0
    assert board.router.receive_lost == 0
    assert board.scheduler.overruns == 0
    assert board.scheduler.max_slot_cycles < 30_000
    assert errors_but_the_first(board) == 0
    assert wires.said == []


def test_sync_frames_keep_their_millisecond_under_the_robots_load():
    wires = build()
    nominal_load(wires, 0.1)
    for bus in (1, 2, 3, 4):
        times = [t for t, _, _ in wires.of(0, bus)]
        # at most four other FIQs are ahead of the timer's or in progress
        assert all(200 <= t % MS < 10_000 for t in times)
        assert len(times) in (99, 100)


def test_four_full_buses_overload_the_link_which_is_reported_and_survived():
    wires = build()
    for n in range(2500):
        for bus in (1, 2, 3, 4):
            wires.frame(2 * MS + n * 37_000 + bus * 9000, bus, (14, 142, 37, 65)[bus - 1], n, 0)
    wires.run(110 * MS)
    board = wires.board
    assert board.errors.totals[errors.SSP_TX_BUF_OF] > 1000
    assert board.link.transmit_lost == board.errors.totals[errors.SSP_TX_BUF_OF]
    # 30 frames per ms are what the link carries, and nothing of it is wasted
    assert 29.0 < len([1 for i, _, _ in wires.heard if i != 0]) / (2500 * 37_000 / MS) < 34.0
    assert wires.said == []
    # what the main brain heard is still in order
    for identifier in (14, 142, 37, 65):
        order = [w0 for i, w0, _ in wires.heard if i == identifier]
        assert order == sorted(order) and order
    # and afterwards everything flows again
    wires.heard.clear()
    wires.frame(wires.time + 1000, 1, 14, 77, 0)
    wires.run(wires.time + 5 * MS)
    assert (14, 77, 0) in wires.heard


def test_a_bus_that_takes_no_frames_fills_its_ring_of_seven_and_the_loss_is_reported():
    wires = build()
    wires.dead.add(2)
    wires.run(2 * MS)
    for n in range(12):
        wires.brain.send(134, n, 0)
    wires.brain.flush()
    wires.run(8 * MS)
    board = wires.board
    # two in the hardware buffers, seven in the ring, three lost
    assert [w0 for _, w0, _ in wires.of(134)] == [0, 1]
    assert board.router.transmit_lost[2] == 3
    assert board.errors.totals[errors.CAN_TX_QUEUE_FULL] == 3


def test_as_on_the_robot_that_loss_is_silent_with_the_quirk():
    wires = build(full_queues_reported=False)
    wires.dead.add(2)
    wires.run(2 * MS)
    for n in range(12):
        wires.brain.send(134, n, 0)
    wires.brain.flush()
    wires.run(8 * MS)
    assert wires.board.router.transmit_lost[2] == 3
    assert errors_but_the_first(wires.board) == 0


# --- what it publishes --------------------------------------------------------------------------------


def test_each_occasional_variable_comes_eleven_times_a_second():
    wires = build()
    for pin, volts in zip(ANALOG.values(), supply_pins_V(0.2, 25.0), strict=True):
        wires.board.analog.set_pair(pin, 0, volts, 1, volts)
    wires.run(990 * MS)
    count = {}
    for identifier, _, _ in wires.heard:
        count[identifier] = count.get(identifier, 0) + 1
    # nine calls at 100 Hz: 11.11 Hz, of which 0.99 s holds exactly 11
    published = {i: n for i, n in count.items() if i in table.SEND and i not in (0, table.ERROR_CSR)}
    assert published == dict.fromkeys((160, 161, 162, 163, 164, 167, 168), 11)


def test_supply_readings_are_those_of_the_converter():
    wires = build()
    for pin, volts in zip(ANALOG.values(), supply_pins_V(0.2, 25.0), strict=True):
        wires.board.analog.set_pair(pin, 0, volts, 1, volts)
    wires.run(200 * MS)
    last = {i: float_of_word(w0) for i, w0, _ in wires.heard}
    assert last[168] == pytest.approx(0.2, abs=0.000501)
    assert last[167] == pytest.approx(25.0, abs=0.03046)
    assert last[164] == pytest.approx(last[167] * last[168], rel=1e-6)


def test_the_load_variables_count_sent_and_received_frames_of_the_worst_millisecond():
    wires = build()
    for n in range(9):
        wires.frame(150 * MS + 200_000 + n * 40_000, 1, 14, n, 0)
    wires.run(400 * MS)
    loads = {i: [float_of_word(w0) for j, w0, _ in wires.heard if j == i] for i in (160, 161, 162, 163)}
    assert max(loads[160]) == 10.0  # nine received and one sync sent
    assert max(loads[161]) == 1.0
    assert loads[160][-1] == 1.0  # the peak was reported once


def test_the_bus_lights_show_traffic_and_warn_from_twenty_frames_per_millisecond():
    wires = build().run(3 * MS + 100_000)
    assert list(wires.board.can_leds) == [0, 1, 1, 1, 1]
    for n in range(19):
        wires.frame(3 * MS + 200_000 + n * 37_000, 4, 65, n, 0)
    wires.run(4 * MS + 100_000)
    assert list(wires.board.can_leds) == [0, 1, 1, 1, 2]


def test_the_heartbeat_flashes_every_512_milliseconds():
    wires = build().run(1600 * MS)
    assert wires.board.heartbeat.beats == 3


# --- errors -------------------------------------------------------------------------------------------


def error_frames(wires):
    return [(w0 & 0xFFFF, w0 >> 16 & 63, w0 >> 22) for i, w0, _ in wires.heard if i == table.ERROR_VARIABLE]


def break_checksums(wires, times):
    """Put a damaged segment into the exchanges whose end comes next after each of `times`."""
    original = wires.brain.next_segment
    pending = list(times)

    class Brain:
        def __getattr__(self, name):
            return getattr(wires_brain, name)

        def exchanged(self, segment):
            wires_brain.receive(segment)
            down = original()
            if pending and wires.time >= pending[0]:
                pending.pop(0)
                wires_brain.send(134, 1, 1)
                wires_brain.flush()
                return corrupted_copy(original(), 1, 0x40)
            return down

    wires_brain = wires.brain
    wires.brain = Brain()


def test_a_damaged_segment_is_reported_with_board_and_count():
    wires = build()
    break_checksums(wires, [10 * MS, 11 * MS, 12 * MS])
    wires.run(200 * MS)
    first, damaged = error_frames(wires)
    assert first == (errors.SSP_LOW_RATE, table.BOARD_NUMBER, 1)
    assert damaged == (errors.SSP_BAD_CHKSM, table.BOARD_NUMBER, 3)
    assert wires.of(134) == []


def test_with_the_quirk_each_report_carries_the_error_before_it():
    wires = build(errors_reported_one_late=True)
    break_checksums(wires, [10 * MS, 150 * MS])
    wires.run(400 * MS)
    assert [code for code, _, _ in error_frames(wires)] == [errors.DEFAULT, errors.SSP_LOW_RATE, errors.SSP_BAD_CHKSM]


def test_a_silent_main_brain_is_a_low_rate():
    board = CanRouterBoard(Crystal(), Quirks(), 0)
    Wires(board).run(3 * MS)
    # ticks at 0.2, 0.4 ... 2.8 ms: before the first there was no exchange, and the others' has not ended
    assert board.errors.totals[errors.SSP_LOW_RATE] == 14


def test_a_controller_that_is_bus_off_is_restarted_and_reported():
    wires = build()
    wires.run(5 * MS)
    # EI, 256 transmit errors, bus-off
    wires.board.inbox.push(wires.time + 100, 512, CAN_STATUS, 3, 4, 256, 0, 1)
    wires.run(6 * MS)
    assert wires.board.errors.totals[errors.CAN3_TX_BUSOFF] == 1
    assert wires.board.can3.MOD == 0
    wires.board.inbox.push(wires.time + 100, 512, CAN_STATUS, 4, 4, 96, 0, 0)
    wires.run(7 * MS)
    assert wires.board.errors.totals[errors.CAN4_ERR_WARN] == 1


def test_a_frame_of_another_length_is_forwarded_and_arrives_as_eight_bytes():
    wires = build()
    wires.frame(MS, 1, 14, 0x11, 0, flags=4)
    wires.run(3 * MS)
    assert (14, 0x11, 0) in wires.heard


def test_the_segment_interrupt_is_charged_per_half_word():
    wires = build().run(100 * MS)
    source = wires.board.vic.source(SSP_SEGMENT, 0)
    assert source.served == 499
    assert source.total_cycles == 499 * (12 + 240 + 31 * 14)


# --- the same run whatever the steps ------------------------------------------------------------------


def trace(quantum):
    wires = build(quantum=quantum, crystal=Crystal(10_000_000, -17_333), phase_ns=123_457)
    for n in range(300):
        wires.frame(MS + n * 61_003, 1 + n % 4, (14, 142, 37, 65)[n % 4], n, n)
    wires.brain.send(134, 1, 2)
    wires.brain.flush()
    wires.run(20 * MS)
    board = wires.board
    return wires.sent, wires.heard, board.router.routed, board.scheduler.total_slot_cycles


def test_the_run_does_not_depend_on_the_size_of_its_steps():
    assert trace(25_000) == trace(5_000) == trace(1_237)


def test_compiled_and_interpreted_runs_are_equal_to_the_bit():
    script = (
        "import hashlib, tests.boards.test_can_router_board as t\n"
        "print(hashlib.sha256(repr(t.trace(25_000)).encode()).hexdigest())\n"
    )
    answers = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={"RANGER_SIM_INTERPRETED": forced, "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
            cwd=pathlib.Path(__file__).parents[2],
        ).stdout
        for forced in ("0", "1")
    }
    assert len(answers) == 1
