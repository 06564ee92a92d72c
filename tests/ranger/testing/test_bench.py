"""One board alone and one bus alone: what is driven is what the board sees, what it puts out is what the test sees."""

import pytest

from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.modules.front_panel import DISPLAY_ENABLE
from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.conditions import ConditionNotMetError
from ranger_sim.ranger.testing.bench import BoardAlone, BusAlone

RAD_PER_COUNT = 2 * 3.141592653589793 / 8192  # 13 bits a turn
HIP_ZERO = 4590


def test_the_hip_board_publishes_the_angle_that_its_encoder_holds_out():
    board = BoardAlone("MCH")
    for counts in (300, -200):
        board.word("absolute_encoder", HIP_ZERO + counts)
        # its spike limiter lets 17 counts through per slot of 0.5 ms: 500 counts take 15 ms
        board.run_for("40 ms")
        frame = board.can(1).received("MCH_ANGLE")[-1]
        assert frame.value == pytest.approx(counts * RAD_PER_COUNT, abs=2e-4)
        assert frame.time_s == pytest.approx(board.time_s, abs=0.003)
    assert board.overruns == 0 and set(board.errors()) == {"AE_SPIKE"}


def test_a_command_moves_the_duty_both_ways():
    for current, sign in ((0.5, 1), (-0.5, -1)):
        board = BoardAlone("MCH")
        board.word("absolute_encoder", HIP_ZERO)
        board.run_for("5 ms")
        board.can().send("MCH_COMMAND_CURRENT", current)
        board.can().send("MCH_MOTOR_TARGET_CURRENT", current)
        board.run_for("5 ms")
        # the alternating pattern adds its 14 counts of 600 both ways (robot.md T4.3)
        assert sign * board.duty > 0.05


def test_edges_of_an_encoder_are_counted_in_their_direction():
    for forward in (True, False):
        board = BoardAlone("MCH")
        board.word("absolute_encoder", HIP_ZERO)
        board.run_for("2 ms")
        before = board.chip.joint.count
        board.encoder("01").turn(40, "100 us", forward=forward)
        board.run_for("10 ms")
        first = board.chip.joint.count - before
        assert abs(first) == 40
        board.encoder("01").turn(10, "100 us", forward=not forward)
        board.run_for("10 ms")
        assert board.chip.joint.count - before == first - (10 if first > 0 else -10)


def test_a_voltage_reaches_the_converter():
    board = BoardAlone("MCFO")
    board.volts("battery_voltage", 1.5)
    board.run_for("100 ms")
    high = board.can(3).received("MCFO_BATT_VOLTAGE")[-1].value
    board.volts("battery_voltage", 0.75)
    board.run_for("100 ms")
    assert board.can(3).received("MCFO_BATT_VOLTAGE")[-1].value < high - 1.0


def test_a_key_is_in_the_frame_that_reports_keys():
    board = BoardAlone("UI")
    board.run_for("50 ms")
    assert board.can(2).received("UI_BUTTONS")[-1].value == 0
    board.pin("key_2").set(1)
    board.run_for("150 ms")
    assert board.can(2).received("UI_BUTTONS")[-1].value == 1 << 2


def test_what_a_board_puts_out_while_it_starts_is_seen():
    """The user interface board puts out its sync light and starts its display before any time has passed."""
    board = BoardAlone("UI")
    assert board.pin("sync_light").log == [(0.0, 1)]
    assert board.pin_log[DISPLAY_ENABLE] == [(0.0, 1), (0.0, 0)] * 5  # its five start commands
    assert BoardAlone("MCH").pin_log == {}


def test_the_router_passes_a_frame_on_between_bus_and_link():
    board = BoardAlone("CSR")
    board.run_for("5 ms")
    board.can(1).send("MCH_ANGLE", 0.25)
    board.link.send("MCFO_COMMAND_CURRENT", -1.5)
    board.run_for("5 ms")
    [up] = board.link.received("MCH_ANGLE")
    [down] = board.can(3).received("MCFO_COMMAND_CURRENT")
    assert (up.value, down.value) == (0.25, -1.5)
    assert board.can(1).received("MCFO_COMMAND_CURRENT") == []
    # the router sends the network time on every bus by itself; that of 10 ms is on its way
    assert all(len(board.can(bus).received("TIMESTAMP")) == 9 for bus in (1, 2, 3, 4))


def test_the_main_brain_alone_receives_and_sends_over_the_link():
    board = BoardAlone("MB")
    board.run_for("1 ms")
    board.link.send("MCH_ANGLE", 0.25)
    board.run_for("10 ms")
    assert board.chip.store.get_float(board.chip.table.MCH_ANGLE) == 0.25
    assert board.link.received("MCH_COMMAND_CURRENT")
    with pytest.raises(UserError, match=r"MB.can\(1\): the board is on no bus: it has the link"):
        board.can(1)


def test_a_model_may_hang_on_the_board():
    board = BoardAlone("MCSI")
    seen = []

    def potentiometer(time_s):
        seen.append(time_s)
        board.volts("steering_sensor", 1.0 + time_s)

    board.every("250 us", potentiometer)
    board.run_for("1 ms")
    assert seen == [0.0, 0.00025, 0.0005, 0.00075]


def test_a_function_may_be_replaced_and_a_slow_one_overruns():
    board = BoardAlone("MCH")
    board.replace("mc_compliant_control", lambda: None, cost=31_000)
    board.run_for("20 ms")
    assert board.overruns > 0 and board.errors()["ASCHED_DNF"] == board.overruns


def test_periods_of_a_board_alone_are_asserted_as_those_of_a_robot():
    board = BoardAlone("MCH", crystal_ppb=50_000)
    board.run_for("200 ms")
    found = board.wire(since_s=0.01).assert_period("MCH_ANGLE", "2 ms", jitter="30 us")
    assert found.mean == pytest.approx(2e6 * (1 - 50e-6), rel=1e-5)  # its clock is 50 ppm fast
    assert board.figures[0].name == "period of MCH_ANGLE on can1"


def test_waiting_for_a_frame_ends_with_it_or_reports_that_it_did_not_arrive():
    board = BoardAlone("MCH")
    first = board.can().wait_for("MCH_ANGLE")
    second = board.can().wait_for("MCH_ANGLE")
    assert second.time_ns - first.time_ns == pytest.approx(2e6, abs=60e3)
    with pytest.raises(ConditionNotMetError, match="a frame MCFO_STATUS on can1: not within 5 ms"):
        board.can().wait_for("MCFO_STATUS", within="5 ms")


def test_the_board_is_that_of_the_robot_and_nothing_reaches_it_in_its_past():
    board = BoardAlone("MCH")
    assert isinstance(board.chip, HipBoard)
    board.can().send(0x7FF, b"")  # the shortest frame there is
    for number in range(50):
        board.can().send(0x700 + number, bytes(number % 9), at=f"{number * 37} us")
    board.run_for("30 ms")
    counters = board.can().bus.counters
    assert (counters.late_requests, counters.late_results, counters.errors) == (0, 0, 0)


def test_a_time_is_text_or_a_number_of_seconds_wherever_one_is_given():
    board = BoardAlone("MCH")
    board.run_for(0.02)
    board.run_for("20 ms")
    assert board.now == 40_000_000
    assert board.can().wait_for("MCH_ANGLE", within=0.01).value is not None
    board.can().send("MCH_STATUS", 1.0, at=0.001)
    with pytest.raises(ConditionNotMetError, match="never: not within 2 ms"):
        board.until(lambda: False, within=0.002, what="never")
    board.wire().assert_period("MCH_ANGLE", period=0.002, jitter=60e-6)
    with pytest.raises(UserError, match="^run_for '20': a time from 0 on is needed"):
        board.run_for("20")


def test_how_time_is_cut_changes_nothing():
    frames = []
    for parts in (["20 ms"], ["1 us"] * 20 + ["13.37 ms"] + ["6.61 ms"]):
        board = BoardAlone("MCH")
        board.word("absolute_encoder", HIP_ZERO + 100)
        for part in parts:
            board.run_for(part)
        frames.append(board.can().received())
    assert frames[0] == frames[1] and len(frames[0]) > 10


def test_a_part_that_a_board_lacks_is_reported_with_those_it_has():
    with pytest.raises(UserError, match="unknown board 'MCX' .available: MCH, MCFO"):
        BoardAlone("MCX")
    board = BoardAlone("MCSI")
    with pytest.raises(UserError, match="MCSI: unknown pin 'key_2' .available: led_"):
        board.pin("key_2")
    with pytest.raises(UserError, match="MCSI: unknown analogue input 'angle' .available: motor_current, "):
        board.volts("angle", 1.0)
    with pytest.raises(UserError, match="MCSI: unknown word 'absolute_encoder' .available: none"):
        board.word("absolute_encoder", 1)
    with pytest.raises(UserError, match=r"MCSI.can\(1\): the board is on can4"):
        board.can(1)


def test_nodes_of_a_bus_alone_receive_each_other_to_the_bit():
    bus = BusAlone(bit_rate=500_000)
    one, other = bus.node("one"), bus.node("other")
    one.send("MCH_ANGLE", 0.5, stamp_ms=7, at="100 us")
    bus.run_for("1 ms")
    [frame] = other.received()
    assert one.received() == []
    # asked at 100 us, it begins with bit 51; receivers have it a bit before its end
    bits = frame_bits(frame.identifier, 8, word_of_float(0.5), 7)
    assert frame.time_ns == 2000 * (51 + bits - 1)
    assert (frame.name, frame.value, frame.stamp_ms) == ("MCH_ANGLE", 0.5, 7)


def test_the_lower_identifier_goes_first_and_a_node_has_three_buffers():
    bus = BusAlone()
    one, other = bus.node("one"), bus.node("other")
    for identifier in (0x300, 0x200, 0x100, 0x50):
        one.send(identifier, b"abc")
    other.send(0x150, b"defghijk")
    bus.run_for("2 ms")
    # the fourth of one node waits until a buffer is free, and then goes before what has waited longer
    assert [frame.identifier for frame in bus.wire().frames()] == [0x100, 0x50, 0x150, 0x200, 0x300]
    assert other.received(0x50)[0].lo == int.from_bytes(b"abc", "little")


def test_a_frame_that_does_not_fit_is_refused():
    bus = BusAlone()
    node = bus.node("one")
    with pytest.raises(UserError, match="9 bytes, a frame has up to 8"):
        node.send(1, bytes(9))
    with pytest.raises(UserError, match="no variable of the table; give its bytes"):
        node.send(0x7FF, 1.0)
