"""The main brain as a board: its table of robot.md N3.8, its traffic on the link, its errors and its limits."""

import pathlib
import re

import pytest

from ranger_sim.boards.main_brain import controllers, programs
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.main_brain.error_distribution import ErrorDistribution, ErrorRing
from ranger_sim.boards.modules.error_module import ErrorModule, error_word
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.ssp_link import corrupted_copy, empty_segment
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.generated.all_variables import TABLE_SIZE
from ranger_sim.datatable.packing import parts_of_error_word
from ranger_sim.datatable.store import LABVIEW, SSP, DataStore
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import SSP_LOAD, SSP_SEGMENT
from ranger_sim.foundation.numbers import float_of_word, word_of_float
from ranger_sim.foundation.user_error import UserError

PERIOD_NS = 200_000


def segment_of(*frames):
    """A valid segment with up to six frames (id, word, stamp)."""
    segment = empty_segment()
    words = []
    for number, word, stamp in frames:
        words += [0x7800 | number, word >> 16, word & 0xFFFF, stamp >> 16, stamp & 0xFFFF]
    segment.used = len(words)
    segment.words = [*words, *[0] * (30 - len(words)), (1 + sum(words)) & 0xFFFF]
    return segment


def frames_of(segment):
    words = [segment.words[i] for i in range(31)]
    assert words[30] == (1 + sum(words[:30])) & 0xFFFF
    frames = []
    for i in range(0, 30, 5):
        if words[i] >> 11 != 0x0F:
            break
        frames.append((words[i] & 0x7FF, words[i + 1] << 16 | words[i + 2], words[i + 3] << 16 | words[i + 4]))
    return frames


class Router:
    """The other end of the wire, by hand: an exchange every 200 us, the time once per ms."""

    def __init__(self, board) -> None:
        self.board = board
        self.tick = 0
        self.loaded = None
        self.waiting = []
        self.received = []  # (ms, id, word, stamp)

    def send(self, *frames) -> None:
        self.waiting.extend(frames)

    def run_ms(self, ms) -> None:
        for _ in range(5 * ms):
            self.tick += 1
            now = self.tick * PERIOD_NS
            frames = self.waiting[:5]
            del self.waiting[:5]
            if self.tick % 5 == 0:
                frames.insert(0, (0, self.tick // 5, self.tick // 5))
            self.board.inbox.push(now, 2 * 256, SSP_SEGMENT, 0, ref=segment_of(*frames))
            if self.loaded is not None:
                self.received.extend((self.tick / 5, *frame) for frame in frames_of(self.loaded))
                self.loaded = None
            self.board.advance(now + PERIOD_NS)
            while self.board.outbox.take():
                if self.board.outbox.kind == SSP_LOAD:
                    self.loaded = self.board.outbox.ref

    def take(self):
        taken, self.received = self.received, []
        return taken


@pytest.fixture
def board():
    return MainBrainBoard(Crystal(), Quirks(), 137_000)


@pytest.fixture
def router(board):
    return Router(board)


def press(router, key) -> None:
    router.send((table.UI_BUTTONS, 1 << key, 0))
    router.run_ms(10)
    router.send((table.UI_BUTTONS, 0, 0))
    router.run_ms(10)


def test_the_schedule_is_that_of_the_firmware(board):
    schedule = board.scheduler.schedule
    assert schedule.slot_ns == 2_000_000
    assert schedule.divider == 2
    assert len(schedule.rows) == 11 == table.ROWS
    every = [task.name for task in schedule.every]
    assert every == ["update_errors", "heartbeat", "parse_ssp", "estimator", "controller", "send_ssp", "send_data"]
    extras = {row: [task.name for task in tasks] for row, tasks in enumerate(schedule.rows) if tasks}
    assert extras == {
        0: ["parse_packets"],
        1: ["swap_receive_dma"],
        2: ["build_lists"],
        3: ["distribute_errors"],
        10: ["execution_time"],
    }


def test_slots_come_every_2_ms_and_stay_far_below_their_length(board, router):
    press(router, 1)
    router.run_ms(480)
    scheduler = board.scheduler
    assert scheduler.slot_count in (250, 251)
    assert scheduler.overruns == 0
    assert all(task.hits == 0 for task in scheduler.schedule.all_tasks())
    # 416 000 cycles are one slot
    assert 60_000 < scheduler.max_slot_cycles < 150_000


def test_received_frames_overwrite_value_and_stamp(board, router):
    router.run_ms(2)  # the first segment is junk
    router.send((table.MCH_ANGLE, word_of_float(0.25), 77), (table.MCFI_ANKLE_RATE, word_of_float(-2.0), 78))
    router.run_ms(10)
    assert board.store.get_float(table.MCH_ANGLE) == 0.25
    assert board.store.stamp(table.MCH_ANGLE) == 77
    assert board.store.get_float(table.MCFI_ANKLE_RATE) == -2.0
    assert board.time.ms in (11, 12)


def test_at_boot_every_command_is_sent_once_and_most_are_zero(board, router):
    router.run_ms(20)
    first = {}
    for _, number, word, _ in router.take():
        first.setdefault(number, word)
    assert sorted(first) == sorted(table.SEND)
    commands = [getattr(table, f"{b}_{w}") for b in ("MCH", "MCFO", "MCFI") for w in ("COMMAND_CURRENT", "SHUTDOWN")]
    assert [first[number] for number in commands] == [0] * 6


@pytest.mark.parametrize("keys", [(), (1,), (1, 2)])
def test_three_commands_per_motor_board_go_out_in_every_slot_and_nothing_else(board, router, keys):
    router.run_ms(40)
    for key in keys:
        press(router, key)
    router.run_ms(200)
    router.take()
    router.run_ms(2000)
    counts = {}
    for _, number, _, _ in router.take():
        counts[number] = counts.get(number, 0) + 1
    motors = [
        getattr(table, f"{b}_{w}")
        for b in ("MCH", "MCFO", "MCFI")
        for w in ("COMMAND_CURRENT", "STIFFNESS", "DAMPNESS")
    ]
    assert sorted(counts) == sorted(motors)
    # 1000 slots in 2 s; one may fall on either side of the window
    assert all(abs(count - 1000) <= 1 for count in counts.values())


def test_commands_leave_in_the_order_of_the_table(board, router):
    router.run_ms(100)
    router.take()
    router.run_ms(100)
    numbers = [number for _, number, _, _ in router.take()]
    first = numbers.index(table.MCH_COMMAND_CURRENT)
    assert numbers[first : first + 9] == [18, 19, 20, 45, 46, 47, 73, 74, 75]


def test_the_walk_key_makes_the_start_states_command_hip_and_feet(board, router):
    router.run_ms(40)
    press(router, 1)
    router.take()
    router.run_ms(4)
    sent = {number: float_of_word(word) for _, number, word, _ in router.take()}
    assert sent[table.MCH_COMMAND_CURRENT] == pytest.approx(10.5)
    assert sent[table.MCFO_STIFFNESS] == 30.0
    assert board.modes.machine.current.name == "walk"


def test_a_spoilt_segment_is_dropped_and_reported(board, router):
    router.run_ms(10)
    spoilt = corrupted_copy(segment_of((table.MCH_ANGLE, word_of_float(9.0), 5)), 1, 0x0100)
    before = board.errors.totals[codes.MB_SSP_CHKSUM]
    board.inbox.push(router.tick * PERIOD_NS + 100_000, 2 * 256, SSP_SEGMENT, 0, ref=spoilt)
    router.run_ms(10)
    assert board.errors.totals[codes.MB_SSP_CHKSUM] == before + 1
    assert board.store.get_float(table.MCH_ANGLE) == 0.0


def test_the_board_is_the_same_whatever_the_steps_of_advancing(board):
    other = MainBrainBoard(Crystal(), Quirks(), 137_000)
    board.advance(50_000_000)
    for k in range(1, 2001):
        other.advance(k * 25_000)
    assert board.scheduler.slot_count == other.scheduler.slot_count == 25
    assert list(board.store.words) == list(other.store.words)


def test_parameters_come_from_the_chosen_set():
    robust = MainBrainBoard(Crystal(), Quirks(), 0, "robust")
    assert robust.store.get_float(table.P_FI_PP_THEIGHT) == pytest.approx(
        controllers.load("robust").values["P_FI_PP_THEIGHT"]
    )
    robust.load_controller("record-2011")
    assert robust.store.get_float(table.P_FI_PP_THEIGHT) == pytest.approx(0.012)


def test_an_unknown_set_is_a_users_mistake():
    with pytest.raises(UserError, match="unknown"):
        MainBrainBoard(Crystal(), Quirks(), 0, "nobody")


def test_the_execution_time_is_that_of_the_slot_or_folds_at_1_ms_by_quirk():
    times = []
    for folds in (False, True):
        board = MainBrainBoard(Crystal(), Quirks(main_brain_execution_time_folds=folds), 0)
        board.scheduler.find("heartbeat").cost = 290_000  # 1.39 ms in a slot of 2
        board.scheduler.find("heartbeat").limit = 0
        board.advance(60_000_000)
        times.append(board.store.get_float(table.MB_EXECUTION_TIME))
    assert 1.4e-3 < times[0] < 1.9e-3
    assert times[1] == pytest.approx(times[0] - 1e-3, abs=2e-6)


@pytest.mark.parametrize("checked", [True, False])
def test_an_overrun_is_an_error_unless_the_quirk_of_2016_says_so(checked):
    board = MainBrainBoard(Crystal(), Quirks(main_brain_overrun_check=checked), 0)
    board.scheduler.find("heartbeat").cost = 500_000
    board.advance(20_000_000)
    assert (board.errors.totals[codes.ASCHED_DNF] > 0) is checked


def test_a_slot_near_its_limit_and_a_task_over_its_own_are_errors(board):
    board.scheduler.find("heartbeat").cost = 340_000
    board.advance(20_000_000)
    assert board.errors.totals[codes.SCHED_SLOT_NEAR_LIMIT] > 0
    assert board.errors.totals[codes.SCHED_TASK_LIMIT] > 0


def test_the_heartbeat_lights_for_50_ms_every_512(board, router):
    lit = []
    for _ in range(1100):
        router.run_ms(1)
        lit.append(board.heartbeat_on)
    starts = [i for i in range(1, len(lit)) if lit[i] and not lit[i - 1]]
    assert [b - a for a, b in zip(starts, starts[1:], strict=False)] == pytest.approx([512], abs=2)
    assert sum(lit[starts[0] : starts[0] + 100]) == pytest.approx(50, abs=3)


# --- errors of the whole robot ----------------------------------------------------------------------


def error_frame(number, code, board, count, stamp):
    return (number, error_word(code, board, count), stamp)


def test_errors_of_all_boards_are_merged_and_passed_on_one_at_a_time(board, router):
    router.run_ms(40)
    base = dict(board.distribution.totals)
    router.send(error_frame(table.ERROR_MCH, codes.AE_SPIKE, 3, 2, 50))
    router.run_ms(30)
    router.send(error_frame(table.ERROR_MCH, codes.AE_SPIKE, 3, 5, 80), error_frame(table.ERROR_UI, 53, 8, 1, 81))
    router.run_ms(60)
    totals = board.distribution.totals
    assert totals[3, codes.AE_SPIKE] - base.get((3, codes.AE_SPIKE), 0) == 7
    assert totals[8, 53] == 1
    router.run_ms(5000)
    code, number, count = parts_of_error_word(board.store.get_word(table.ERROR_LABVIEW))
    assert (code, number, count) == (53, 8, 1)  # the last one of the ring


def test_own_errors_take_the_same_way(board, router):
    router.run_ms(40)
    board.report(codes.EST_ROBOT_FALL)
    router.run_ms(60)
    assert board.distribution.totals[1, codes.EST_ROBOT_FALL] == 1
    assert parts_of_error_word(board.store.get_word(table.ERROR_MB)) == (codes.EST_ROBOT_FALL, 1, 1)


def distribution(inverted=False):
    store = DataStore(TABLE_SIZE)
    return store, ErrorDistribution(store, ErrorModule(1, NetworkTime()), inverted)


def test_the_next_error_waits_until_the_computer_has_read_the_last():
    store, errors = distribution()
    errors.computer.add(3, 109, 1, 10)
    errors.computer.add(4, 105, 2, 11)
    store.set_word(0, 100, 100)
    assert errors.distribute() == 0  # no board has told of one
    assert parts_of_error_word(store.get_word(table.ERROR_LABVIEW)) == (109, 3, 1)
    errors.distribute()
    assert parts_of_error_word(store.get_word(table.ERROR_LABVIEW)) == (109, 3, 1)
    store.mark_read(table.ERROR_LABVIEW, LABVIEW)
    errors.distribute()
    assert parts_of_error_word(store.get_word(table.ERROR_LABVIEW)) == (105, 4, 2)


def test_the_display_gets_the_next_error_when_the_link_took_the_last():
    store, errors = distribution()
    errors.display.add(3, 109, 1, 10)
    errors.display.add(4, 105, 2, 11)
    store.mark_read(table.ERROR_LCD, SSP)
    errors.distribute()
    errors.distribute()
    assert parts_of_error_word(store.get_word(table.ERROR_LCD)) == (109, 3, 1)
    store.mark_read(table.ERROR_LCD, SSP)
    errors.distribute()
    assert parts_of_error_word(store.get_word(table.ERROR_LCD)) == (105, 4, 2)


def test_by_quirk_the_computers_error_is_marked_new_although_it_is_absent():
    store, errors = distribution(inverted=True)
    store.mark_read(table.ERROR_LABVIEW, LABVIEW)
    errors.distribute()
    assert store.is_unread(table.ERROR_LABVIEW, LABVIEW)
    errors.computer.add(3, 109, 1, 10)
    errors.display.add(3, 109, 1, 10)
    store.mark_read(table.ERROR_LABVIEW, LABVIEW)
    store.mark_read(table.ERROR_LCD, SSP)
    errors.distribute()
    assert not store.is_unread(table.ERROR_LABVIEW, LABVIEW)
    assert store.get_word(table.ERROR_LCD) == 0


def test_a_full_ring_drops_its_oldest_error():
    ring = ErrorRing(2)
    for code in (1, 2, 3):
        ring.add(3, code, 1, code)
    assert ring.dropped == 1
    assert parts_of_error_word(ring.take()[0])[0] == 2


def test_by_quirk_each_report_carries_the_error_before():
    board = MainBrainBoard(Crystal(), Quirks(errors_reported_one_late=True), 0)
    board.report(codes.EST_ROBOT_FALL)
    assert board.errors.totals[codes.EST_ROBOT_FALL] == 0
    assert board.errors.totals[codes.DEFAULT] == 1
    board.report(codes.EST_STUTTER_STEP)
    assert board.errors.totals[codes.EST_ROBOT_FALL] == 1


# --- declarations -------------------------------------------------------------------------------------


def test_every_table_number_that_a_compiled_class_declares_is_filled_in(board):
    folder = pathlib.Path(controllers.__file__).parent
    modes = board.modes
    reflex = programs.program("reflex").build(board.store, Quirks())
    owners = {
        "estimator": board.estimator,
        "mode_machine": modes,
        "leg_machine": modes.leg,
        "hip_machine": modes.hip,
        "foot_machines": modes.inner_foot,
        "steering_machine": modes.steering,
        "reflex_leg": reflex.leg,
        "reflex_hip": reflex.hip,
        "reflex_feet": reflex.inner_foot,
    }
    for name, owner in owners.items():
        source = (folder / f"{name}.py").read_text(encoding="utf-8")
        declared = re.findall(r"^    ([A-Z][A-Z0-9]*_[A-Z0-9_]+|TIMESTAMP): cython.longlong$", source, re.MULTILINE)
        assert declared
        for variable in declared:
            assert getattr(owner, variable) == getattr(table, variable), f"{name}.py: {variable}"


def test_an_error_that_waits_already_is_counted_and_keeps_its_place_with_the_newest_stamp():
    ring = ErrorRing(2)
    ring.add(3, 109, 5, 10)
    ring.add(4, 105, 2, 11)
    ring.add(3, 109, 7, 12)
    word, stamp = ring.take()
    assert (parts_of_error_word(word), stamp) == ((109, 3, 12), 12)
    word, stamp = ring.take()
    assert (parts_of_error_word(word), stamp) == ((105, 4, 2), 11)
    assert ring.take() is None
