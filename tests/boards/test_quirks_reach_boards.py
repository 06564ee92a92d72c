"""Switches set through `Quirks` on a whole board change what that board does; one line per switch and value."""

import pytest

from ranger_sim.boards.can_router import CanRouterBoard
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.modules.buzzer import TUNE
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.user_interface import UserInterfaceBoard
from ranger_sim.datatable.generated import mb
from ranger_sim.datatable.store import LABVIEW
from ranger_sim.firmware_sim.clock import Crystal
from tests.boards.motor_bench import BOARDS as MOTOR_BOARDS
from tests.boards.motor_bench import Bench

BOARDS = MOTOR_BOARDS | {"UI": UserInterfaceBoard, "CSR": CanRouterBoard, "MB": MainBrainBoard}
JOINTS = ("MCH", "MCFO", "MCFI")
# errors that no board raises by itself while it lies on the table
ONE, OTHER = 900, 901


def board_with(name, **switches):
    return BOARDS[name](Crystal(), Quirks.named(**switches), 0)


# --- motor boards ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.parametrize("sign", [-1, 1])
def test_the_gains_pull_back_or_push_on_by_the_sign(name, sign):
    bench = Bench(name, Quirks.named(compliant_gain_sign=sign))
    encoder = bench.board.encoder
    if name == "MCH":  # the others stand at 1.5 rad
        bench.board.words[0] = encoder.zero + 400
    bench.run(ms=3)
    bench.command("STIFFNESS", 0.5)
    bench.command("COMMAND_CURRENT", 0.0)
    bench.run(ms=2)
    position = bench.board.controlled_position()
    assert position > 0
    target = bench.board.compliance.target / 65536
    assert target == pytest.approx(sign * 0.5 * position / 65536, abs=1e-4)  # fixed point rounds at 1.5e-5


@pytest.mark.parametrize("name", MOTOR_BOARDS)
@pytest.mark.parametrize("derating", [True, False])
def test_a_warm_motor_gets_less_current_only_with_derating(name, derating):
    limits = board_with(name, thermal_derating=derating).limits
    limits.thermal = limits.thermal_limit * 9 // 10
    limits.monitor(0)
    allowed = limits.limit_target(limits.target_max, 0) / limits.target_max
    # six tenths of the way from the soft limit (0.75) to the hard one
    assert allowed == pytest.approx(0.4 if derating else 1.0, abs=0.01)


@pytest.mark.parametrize("name", MOTOR_BOARDS)
@pytest.mark.parametrize("peak", [True, False])
def test_twice_the_peak_current_halves_the_duty_at_once_only_with_the_limiter(name, peak):
    limits = board_with(name, peak_current_limiter=peak).limits
    duty = limits.limit_duty(100 << 16, 2 * limits.current_max) >> 16
    assert duty == (50 if peak else 100)


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.parametrize("exponent", [2, 4, 6])
def test_the_rate_follows_by_its_share_per_slot(name, exponent):
    board = board_with(name, rate_filter_exponent=exponent)
    for decoder in (board.cap01, board.cap23):
        decoder.filtered = 0
        for _ in range(2):
            decoder.edge(1, 10_000)
        decoder.update_rate()
        # unfiltered: two counts, 10 000 cycles each
        assert decoder.speed == 2 * (0x7FFFFFFF // 20_000)
        assert decoder.filtered == (decoder.speed << 16) >> exponent


# --- every board with an error module --------------------------------------------------------------------------


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("per_event", [True, False])
def test_three_errors_of_a_slot_count_three_or_one(name, per_event):
    errors = board_with(name, errors_counted_per_event=per_event).errors
    for _ in range(3):
        errors.report(ONE)
    errors.update()
    assert errors.take()
    assert (errors.word & 0xFFFF, errors.word >> 22) == (ONE, 3 if per_event else 1)


@pytest.mark.parametrize("name", BOARDS)
@pytest.mark.parametrize("lost", [True, False])
def test_a_new_error_after_a_repeated_one_waits_or_is_lost(name, lost):
    errors = board_with(name, new_errors_lost_after_repeat=lost).errors
    errors.report(ONE)
    errors.update()
    errors.report(ONE)
    errors.report(OTHER)
    errors.update()
    assert errors.waiting == (1 if lost else 2)


# --- user interface, router, main brain ------------------------------------------------------------------------


@pytest.mark.parametrize("for_ever", [True, False])
def test_the_tune_ends_unless_it_repeats_for_ever(for_ever):
    buzzer = board_with("UI", song_repeats_for_ever=for_ever).buzzer
    buzzer.start_tune()
    for _ in range(sum(ms for _, ms in TUNE) + 1):
        buzzer.update()
    assert buzzer.playing == for_ever


@pytest.mark.parametrize("straddle", [True, False])
def test_a_frame_that_is_still_being_pushed_is_cut_or_waits(straddle):
    link = board_with("CSR", ssp_frames_may_straddle=straddle).link
    link.push(14, 8, 0x11112222, 0x33334444, 0)
    link.next_segment(2 * link.push_step_ns)  # two or three of five half-words are there
    left = link.half_words_waiting()
    assert 0 < left < 5 if straddle else left == 5


@pytest.mark.parametrize("inverted", [True, False])
def test_the_computers_error_counts_as_new_with_nothing_waiting_only_when_inverted(inverted):
    board = board_with("MB", error_distribution_inverted=inverted)
    board.store.mark_read(mb.ERROR_LABVIEW, LABVIEW)
    board.distribution.distribute()
    assert not board.distribution.computer.waiting
    assert bool(board.store.is_unread(mb.ERROR_LABVIEW, LABVIEW)) == inverted
