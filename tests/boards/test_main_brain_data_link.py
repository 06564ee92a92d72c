"""The main brain's line to the computer: known segments, the cycle, the rate, packets, and what may go wrong."""

import csv
import pathlib
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim import datatable
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.generated.all_variables import ID_OF_LAST
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import PIN_EDGE, UART_BYTE, UART_OUTPUT
from ranger_sim.foundation.numbers import word_of_float
from tests.examples import examples

MEDIUM, FAST = 65536, 131072
SLOT_NS = 2_000_000
PASS_NS = 22_000_000


class Desk:
    """The computer's end of the line, by hand. `run_ms` passes time, `segments` is what arrived, `send` what goes."""

    def __init__(self, quirks=None):
        self.board = MainBrainBoard(Crystal(), quirks if quirks is not None else Quirks())
        self.link = self.board.computer
        self.now = 0
        self.segments = []
        self.times = []

    def send(self, data):
        """Bytes at the line's speed, in messages of eight."""
        uart = self.board.computer_uart
        at = self.now
        for i in range(0, len(data), 8):
            part = data[i : i + 8]
            at += len(part) * uart.byte_ns
            low, high = int.from_bytes(part[:4], "little"), int.from_bytes(part[4:], "little")
            self.board.inbox.push(at, 256, UART_BYTE, uart.number, part[0], len(part), low, high)

    def run_ms(self, ms):
        self.now += ms * 1_000_000
        self.board.advance(self.now)
        while self.board.outbox.take():
            if self.board.outbox.kind == UART_OUTPUT:
                self.segments.append(self.board.outbox.ref)
                self.times.append(self.board.outbox.time)

    def full_speed(self):
        self.link.rate_sum = 40_960

    def points(self):
        taken, self.segments = self.segments, []
        return [struct.unpack_from(">HII", segment, 10 * i) for segment in taken for i in range(9)]

    def errors(self):
        """Those of this line: there is no router here, and the board complains about that as well."""
        totals = self.board.errors.totals
        return {
            codes.NAMES[code]: totals[code] for code in codes.NAMES if totals[code] and code != codes.MB_SSP_TX_FULL
        }


@pytest.fixture
def desk():
    return Desk()


# Brings the reader back in step: no eight bytes of these with what follows them have a right sum. (Zeros would not do:
# seven of them and the 01 that begins a parameter's identifier are a packet for variable 0.)
FLUSH = b"\xff" * 8


def packet(number, word):
    body = struct.pack(">HI", number, word)
    return body + struct.pack(">H", (1 + sum(body)) & 0xFFFF)


def channel(place, value):
    return packet(table.LV_CH_0 + place, word_of_float(float(value)))


# --- to the computer ------------------------------------------------------------------------------------


def test_a_known_segment_byte_by_byte(desk):
    # ids 0 ... 8 with value 2**24 - 1 and stamp 16 ** 5: sum of ids 36, of each value 3 * 255, of each stamp 16
    for number in range(9):
        desk.board.store.set_word(number, 0x00FFFFFF, 0x00100000)
    for _ in range(9):
        desk.link.phase = 2  # slow
        desk.link.rate_sum = 4096 + 8
        desk.link.used = 0
        desk.link.send_data()
    expected = b"".join(bytes((0, n)) + bytes.fromhex("00ffffff 00100000") for n in range(9))
    assert 1 + sum(expected) == 1 + 36 + 9 * 765 + 9 * 16 == 7066 == 0x1B9A
    assert bytes(desk.link.segments[:92]) == expected + bytes.fromhex("1b9a")


def test_a_segment_takes_its_time_on_the_line_and_the_next_follows(desk):
    desk.full_speed()
    for number in range(1, 40):
        desk.board.store.set_word(number, number, number)
    desk.run_ms(200)
    assert all(len(segment) == 92 for segment in desk.segments)
    assert all(int.from_bytes(s[90:], "big") == (1 + sum(s[:90])) & 0xFFFF for s in desk.segments)
    # 92 bytes of 10.769 us
    assert min(b - a for a, b in zip(desk.times, desk.times[1:], strict=False)) >= 990_700


def test_with_no_channels_the_slow_list_goes_round_by_itself(desk):
    desk.full_speed()
    desk.run_ms(700)
    numbers = [number for number, _, _ in desk.points()]
    assert len(numbers) > 2 * (ID_OF_LAST + 1)
    assert numbers == [n % (ID_OF_LAST + 1) for n in range(len(numbers))]


def test_ten_steps_a_slot_are_ten_places_of_the_cycle(desk):
    """Cycle without channels: slow, restart. So 10 steps a slot bring 5 points, 500 slots a second 2500."""
    desk.full_speed()
    desk.run_ms(3000)
    assert desk.link.steps == pytest.approx(15_000, rel=0.01)
    assert len(desk.points()) == pytest.approx(7500, rel=0.01)


def test_fast_comes_in_every_cycle_when_new_medium_in_turn_and_slow_always(desk):
    for place, value in enumerate((10 + FAST, 11 + FAST, 20 + MEDIUM, 21 + MEDIUM, 0, 22)):
        desk.board.store.set_float(table.LV_CH_0 + place, value)
    desk.link.build_lists()
    desk.link.slow_id = 400
    desk.link.phase = desk.link.fast_place = 0
    seen = []
    for cycle in range(5):
        for number in (10, 11, 20, 21):
            desk.board.store.set_word(number, cycle, cycle)
        before = desk.link.points
        for _ in range(5):  # 2 fast, medium, slow, restart
            desk.link.rate_sum = 4096 + 8
            desk.link.used = 0
            assert desk.link.send_data() == 1
        base = 92 * desk.link.filling
        assert desk.link.points - before == 4
        seen.append((desk.link.points, base))
    data = bytes(desk.link.segments)
    points = [struct.unpack_from(">HII", data, 92 * (i // 9) + 10 * (i % 9)) for i in range(20)]
    assert [p[0] for p in points] == [
        10,
        11,
        20,
        400,
        10,
        11,
        21,
        401,
        10,
        11,
        20,
        402,
        10,
        11,
        21,
        403,
        10,
        11,
        20,
        404,
    ]
    assert points[4] == (10, 1, 1)


def test_a_fast_variable_that_is_not_new_costs_a_step_and_sends_nothing(desk):
    desk.board.store.set_float(table.LV_CH_0, 10 + FAST)
    desk.link.build_lists()
    desk.link.phase = desk.link.fast_place = 0
    desk.board.store.mark_read(10, 0)
    desk.link.rate_sum = 4096 + 8
    assert desk.link.send_data() == 1
    assert desk.link.points == 0


def test_the_medium_list_is_searched_for_a_new_variable_until_its_end_and_anew_in_the_next_cycle(desk):
    store, link = desk.board.store, desk.link
    for place, number in enumerate((20, 21, 22)):
        store.set_float(table.LV_CH_0 + place, number + MEDIUM)
    link.build_lists()
    link.slow_id, link.phase, link.fast_place = 400, 0, 0
    reported = []
    for new in ({22}, {20, 21, 22}, {20, 21}, set()):
        for number in (20, 21, 22):
            store.set_word(number, 1, 1)
            if number not in new:
                store.mark_read(number, 0)
        steps, before = 0, link.points
        while True:
            link.rate_sum, link.used = 4096 + 8, 0
            link.send_data()
            steps += 1
            if link.phase == 0:
                break
        reported.append((steps, link.points - before))
    # looks at 20, 21, 22, slow, restart; at 20, slow, restart; at 21, ...; at 22 in vain, slow, restart
    assert reported == [(5, 2), (3, 2), (3, 2), (3, 1)]


def test_both_flags_put_a_variable_on_both_lists_and_strange_values_on_none(desk):
    values = (3 + MEDIUM + FAST, float("nan"), float("inf"), -1.0, 65535.0, 262144.0, 1e30)
    for place, value in enumerate(values):
        desk.board.store.set_float(table.LV_CH_0 + place, value)
    desk.link.build_lists()
    assert (desk.link.fast_count, desk.link.medium_count) == (1, 1)
    assert (desk.link.fast[0], desk.link.medium[0]) == (3, 3)


def test_a_channel_beyond_the_table_is_reported_and_left_out(desk):
    desk.board.store.set_float(table.LV_CH_0, ID_OF_LAST + 1 + FAST)
    desk.run_ms(30)
    assert desk.link.fast_count == 0
    assert desk.errors() == {"MB_IO_ID_OOR": 2}  # each rebuild: at 4 and 26 ms


def test_all_48_channels_can_be_fast(desk):
    for place in range(48):
        desk.board.store.set_float(table.LV_CH_0 + place, 10 + place + FAST)
    desk.link.build_lists()
    assert desk.link.fast_count == 48


# --- rate -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("total", "used", "steps", "after"),
    [
        (0, 8, 1, 0),  # free 10: nothing changes, and a sum of 0 lets one step through in every call
        (0, 7, 0, 1),  # free 11; 1 >> 12 is no step
        (4095, 7, 1, 4096),
        (40_952, 0, 10, 40_960),  # free 18
        (40_960, 0, 10, 40_960),  # its limit
        (40_960, 18, 9, 40_950),  # free 0
        (-40_960, 18, 1, -40_960),  # then ten calls without
        (-4096, 8, 1, -4096),  # every second call
    ],
)
def test_the_rate_controller_step_by_step(desk, total, used, steps, after):
    desk.link.rate_sum, desk.link.used, desk.link.calls_to_wait = total, used, 0
    assert desk.link.allowed_steps() == steps
    assert desk.link.rate_sum == after


@pytest.mark.parametrize(("total", "period"), [(0, 1), (-1, 2), (-4096, 2), (-4097, 3), (-40_960, 11)])
def test_below_zero_a_step_comes_only_every_nth_call(desk, total, period):
    desk.link.used = 8  # half full: the sum stays
    desk.link.rate_sum = total
    desk.link.calls_to_wait = 0
    steps = [desk.link.allowed_steps() for _ in range(44)]
    assert steps == [int(call % period == 0) for call in range(44)]


def test_how_many_calls_go_without_a_step_is_settled_at_the_step_before(desk):
    desk.link.rate_sum, desk.link.used, desk.link.calls_to_wait = -40_960, 8, 0
    assert desk.link.allowed_steps() == 1
    desk.link.rate_sum = 4096  # meanwhile there is room: steps come, and the ten calls stay owed
    assert [desk.link.allowed_steps() for _ in range(3)] == [1, 1, 1]
    desk.link.rate_sum = 0
    assert [desk.link.allowed_steps() for _ in range(11)] == [0] * 10 + [1]


def test_the_ring_settles_half_full_when_the_line_is_slower_than_the_steps():
    """48 fast channels, always new, want 4700 points/s; the Bluetooth line takes 464,286/10/92*9 = 4542."""
    desk = Desk(Quirks(computer_link="bluetooth"))
    for place in range(48):
        desk.board.store.set_float(table.LV_CH_0 + place, 10 + place + FAST)
    desk.full_speed()
    used = []
    for slot in range(15_000):
        for number in range(10, 58):
            desk.board.store.set_word(number, slot, slot)
        desk.run_ms(2)
        desk.segments.clear()
        used.append(desk.link.used)
    assert max(used) <= 18
    assert 5 <= sum(used[-5000:]) / 5000 <= 11
    assert desk.board.scheduler.overruns == 0


def test_a_silent_module_fills_the_ring_and_nothing_is_cut():
    desk = Desk(Quirks(computer_link="bluetooth"))
    desk.full_speed()
    desk.run_ms(100)
    desk.points()
    desk.board.inbox.push(desk.now, 256, PIN_EDGE, 0, 1, -1, 0)
    desk.run_ms(400)
    assert len(desk.segments) <= 1
    assert desk.link.used == 18
    desk.board.inbox.push(desk.now, 256, PIN_EDGE, 0, 0, -1, 0)
    desk.run_ms(100)
    numbers = [number for number, _, _ in desk.points()]
    assert all((b - a) % (ID_OF_LAST + 1) == 1 for a, b in zip(numbers, numbers[1:], strict=False))


# --- from the computer ----------------------------------------------------------------------------------


def test_a_known_packet_sets_a_parameter_within_two_passes(desk):
    # id 344 = 0x0158, 4.5 = 0x40900000: 1 + 0x01 + 0x58 + 0x40 + 0x90 = 0x012A
    known = bytes.fromhex("0158 40900000 012a")
    assert known == packet(table.C_F_ST_F_ANG, word_of_float(4.5))
    desk.run_ms(25)
    desk.send(known)
    desk.run_ms(44)
    assert desk.board.store.get_float(table.C_F_ST_F_ANG) == 4.5
    assert desk.link.packets == 1 and desk.errors() == {}


def test_wrong_sums_are_passed_byte_by_byte_until_the_next_good_packet(desk):
    desk.send(b"\xff\xff\xff" + packet(table.C_F_ST_F_ANG, word_of_float(4.5)))
    desk.run_ms(44)
    assert desk.board.store.get_float(table.C_F_ST_F_ANG) == 4.5
    assert desk.errors() == {"MB_SER_CHKSUM": 3}
    assert (desk.link.packets, desk.link.bad_packets) == (1, 3)


def test_a_packet_cut_in_two_waits_for_its_rest(desk):
    whole = packet(table.C_F_ST_F_ANG, word_of_float(4.5))
    desk.send(whole[:5])
    desk.run_ms(66)
    assert desk.link.waiting() == 5
    desk.send(whole[5:])
    desk.run_ms(44)
    assert desk.board.store.get_float(table.C_F_ST_F_ANG) == 4.5 and desk.errors() == {}


@pytest.mark.parametrize(
    "number", [table.MCH_ANGLE, table.TIMESTAMP, table.MCH_COMMAND_CURRENT, ID_OF_LAST + 1, 0xFFFF]
)
def test_a_packet_that_writes_no_parameter_is_an_error_and_changes_nothing(desk, number):
    desk.send(packet(number, 0x12345678))
    desk.run_ms(44)
    assert desk.errors() == {"MB_UNKNOWN_PARAMETER": 1}
    assert desk.link.refused == 1
    assert 0x12345678 not in list(desk.board.store.words)


@pytest.mark.parametrize("value", [5.0, 99.99, 60_000.1, -100.0, float("inf"), float("-inf"), float("nan")])
def test_a_packet_beyond_a_parameters_limits_is_an_error_and_changes_nothing(desk, value):
    """The display's time per page is 100 ... 60000 ms; 5 ms gave 20,000 errors in 8 s."""
    before = desk.board.store.get_word(table.P_UI_LCD_TIME)
    desk.send(packet(table.P_UI_LCD_TIME, word_of_float(value)))
    desk.run_ms(44)
    assert desk.errors() == {"MB_PARAMETER_LIMIT": 1} and desk.link.refused == 1
    assert desk.board.store.get_word(table.P_UI_LCD_TIME) == before


@pytest.mark.parametrize("value", [100.0, 60_000.0])
def test_a_packet_with_a_parameters_limit_itself_sets_it(desk, value):
    desk.send(packet(table.P_UI_LCD_TIME, word_of_float(value)))
    desk.run_ms(44)
    assert desk.board.store.get_float(table.P_UI_LCD_TIME) == value and desk.errors() == {}


def test_the_link_holds_the_limits_of_the_master_file_in_single_precision():
    """Read here with other code: the file's cells, and struct's single precision; no limit is the largest number."""
    largest = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
    text = (pathlib.Path(datatable.__file__).parent / "master/variables.csv").read_text(encoding="utf-8")
    expected = {}
    for row in csv.DictReader(text.splitlines()):
        if row["publisher"] == "PC":
            assert row["type"] == "f32"
            cells = (row["minimum"] or -largest, row["maximum"] or largest)
            expected[int(row["id"])] = tuple(struct.unpack("<f", struct.pack("<f", float(cell)))[0] for cell in cells)
    assert len(expected) > 150 and all_variables.WRITABLE == expected


def test_the_firmware_of_2016_writes_any_value_it_receives():
    desk = Desk(Quirks(parameter_writes_checked=False))
    desk.send(packet(table.MCFO_SHUTDOWN, 7) + packet(ID_OF_LAST + 1, 1))
    desk.run_ms(44)
    assert desk.board.store.get_word(table.MCFO_SHUTDOWN) == 7
    assert desk.errors() == {"MB_IO_ID_OOR": 1}


def test_the_firmware_of_2016_finds_its_receive_transfer_off_once():
    desk = Desk(Quirks(serial_dma_off_at_start=True))
    desk.run_ms(100)
    assert desk.errors() == {"MB_SER_DMA_OFF": 1}


def test_more_bytes_than_the_ring_takes_are_lost_and_reported(desk):
    desk.run_ms(5)  # behind the swap of the first pass
    desk.send(b"\xff" * 600)
    desk.run_ms(22)
    assert desk.errors()["MB_SER_RX_FULL"] == 1
    assert desk.link.ring_full == 600 - 499


def test_more_bytes_than_a_dma_buffer_takes_stop_the_channel_until_the_next_pass(desk):
    desk.run_ms(5)  # behind the swap of the first pass
    desk.send(b"\xff" * 1500)
    desk.run_ms(22)
    assert desk.errors()["MB_SER_DMA_FLL"] == 1
    assert desk.errors()["MB_SER_DMA_OFF"] == 1
    assert desk.board.computer_uart.lost > 0
    desk.run_ms(66)
    desk.send(FLUSH + packet(table.C_F_ST_F_ANG, word_of_float(4.5)))
    desk.run_ms(66)
    assert desk.board.store.get_float(table.C_F_ST_F_ANG) == 4.5


def test_the_worst_bytes_stay_within_limits_and_slots(desk):
    desk.full_speed()
    desk.run_ms(4)
    for _ in range(10):
        desk.send(bytes((0xA5,)) * 1000)
        desk.run_ms(22)
    assert desk.board.scheduler.overruns == 0
    assert all(task.hits == 0 for task in desk.board.scheduler.schedule.all_tasks())


# --- fuzz -----------------------------------------------------------------------------------------------

PIECES = st.one_of(
    st.binary(max_size=40),
    st.builds(packet, st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)),
    st.builds(packet, st.integers(table.LV_START, ID_OF_LAST), st.integers(0, 0xFFFFFFFF)),
    st.builds(lambda p, n, x: p[:n] + bytes((x,)) + p[n + 1 :], st.builds(packet, st.integers(0, 500), st.just(7)),
              st.integers(0, 7), st.integers(0, 255)),
)  # fmt: skip


@settings(max_examples=examples(150))
@given(st.lists(PIECES, max_size=12))
def test_no_bytes_stop_the_board(pieces):
    desk = Desk()
    desk.full_speed()
    sent = b"".join(pieces)[:450]
    desk.send(sent)
    desk.run_ms(70)
    link = desk.link
    assert 8 * link.packets + link.bad_packets + link.waiting() == len(sent)
    assert desk.board.scheduler.overruns == 0
    slots = desk.board.scheduler.slot_count
    before = desk.link.points
    desk.send(FLUSH + packet(table.C_F_ST_F_ANG, word_of_float(4.5)))
    desk.run_ms(70)
    assert desk.board.store.get_float(table.C_F_ST_F_ANG) == 4.5
    assert desk.board.scheduler.slot_count == slots + 35
    assert desk.link.points > before


def test_the_two_ports_are_the_wire_without_flow_control_and_bluetooth_at_half_its_rate():
    # robot.md N4.15: HS-UART1 at 13 MHz / 14, no flow control; HS-UART2 at half of that, CTS on pin 0
    from ranger_sim.boards.main_brain.board import COMPUTER_PORTS

    assert COMPUTER_PORTS == {"wired": (1, 0, -1), "bluetooth": (2, 1, 0)}
