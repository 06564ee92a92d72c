"""Boards in C on CAN FD buses: with each other, with classic boards, and with programs of python-can."""

import contextlib
import sys
import threading

import can
import pytest

from ranger_sim.can_bus.edge.lockstep_bus import LockstepBus
from ranger_sim.firmware_sim.native.hardware import Hardware
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation.events import FLAG_BRS, FLAG_FD
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.outside.machine import offer, put_on
from ranger_sim.harness.processes.modes import OwnProcesses
from ranger_sim.harness.wiring.wires import CanWire, Wiring
from ranger_sim.plant.plant import Plant
from tests.can_bus.hosting import fresh_name
from tests.firmware_sim.native.support import COMPILER, SCHEDULE, folder_with, library_of

pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
RATES = (500_000, 2_000_000)
# Sends 64 bytes in each slot of 2 ms: its count, then 4 ... 63.
SENDER = """
#include <ranger_sim/firmware.h>
static fw_canfd_frame frame = {0x123, 64, FW_CANFD_FDF | FW_CANFD_BRS, {0, 0}, {0}};
static int32_t send(void)
{
    for (uint8_t i = 4; i < 64; i++)
        frame.data[i] = i;
    frame.data[0]++;
    fw_canfd_transmit(1, 1, &frame);
    return 0;
}
static const fw_task every[] = {{send, "send", 500, 1000}};
static const fw_schedule schedule = {.slot_ns = 2000000, .every = FW_TASKS(every), .tick_vic_slot = 4};
void firmware_start(void) { fw_canfd_start(1, 500000, DATA_RATE, 0); }
"""
# Sends what it receives back with the next identifier and the last byte inverted.
ECHO = """
#include <ranger_sim/firmware.h>
static int32_t on_frame(void)
{
    fw_canfd_frame frame;
    int32_t count = 0;
    for (; fw_canfd_receive(1, &frame); count++) {
        frame.ID++;
        if (frame.length)
            frame.data[frame.length - 1] ^= 0xFF;
        fw_canfd_transmit(1, 1, &frame);
    }
    return count;
}
static const fw_interrupt receive = {FW_CAN_RX, 1, on_frame, "on_frame", 100, 50, 0, FW_USUAL_LATENCY};
static const fw_schedule schedule = {.slot_ns = 1000000, .tick_vic_slot = 4};
static const fw_can_range accepted[] = {{1, 0x100, 0x1FF}, {1, 0x80000000u, 0x80000FFFu}};
void firmware_start(void)
{
    fw_canfd_start(1, 500000, 2000000, FW_ICR_RI);
    fw_can_accept(accepted, 2);
    fw_attach(&receive);
}
"""
# Sends the frame whose number is at its first three pins.
WRONG = """
#include <ranger_sim/firmware.h>
static const fw_canfd_frame frames[] = {
    {1, 0, FW_CANFD_FDF, {0, 0}, {0}},
    {1, 9, FW_CANFD_FDF, {0, 0}, {0}},
    {1, 65, FW_CANFD_FDF, {0, 0}, {0}},
    {1, 9, 0, {0, 0}, {0}},
    {0x800, 0, FW_CANFD_FDF, {0, 0}, {0}},
    {FW_CAN_REMOTE | 1, 0, FW_CANFD_FDF, {0, 0}, {0}},
    {1, 0, 8, {0, 0}, {0}},
};
static int32_t send(void)
{
    fw_canfd_transmit(1, 1, &frames[fw_pin(0) | fw_pin(1) << 1 | fw_pin(2) << 2]);
    return 0;
}
static const fw_task every[] = {{send, "send", 500, 1000}};
static const fw_schedule schedule = {.slot_ns = 1000000, .every = FW_TASKS(every), .tick_vic_slot = 4};
void firmware_start(void) { fw_canfd_start(1, 500000, 2000000, 0); }
"""
# A classic board: one frame in each slot of 10 ms.
CLASSIC = """
#include <ranger_sim/firmware.h>
static int32_t send(void)
{
    fw_can_frame frame = {FW_CAN_EIGHT_BYTES, 0x10, 1, 2};
    fw_can_transmit(1, 1, &frame);
    return 0;
}
static const fw_task every[] = {{send, "send", 500, 1000}};
static const fw_schedule schedule = {.slot_ns = 10000000, .every = FW_TASKS(every), .tick_vic_slot = 4};
void firmware_start(void) { fw_can_start(1, 0x002A4007u, 0); }
"""


class Nothing(Plant):
    """A body without a part."""

    def __init__(self):
        Plant.__init__(self, 250_000, samples={"zero": "1"})

    def step(self):
        self.time_ns += self.step_ns

    def fill_sample(self, row):
        row[0] = 0.0


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    sources = {
        "SENDER": SENDER.replace("DATA_RATE", "2000000"),
        "SLOW": SENDER.replace("DATA_RATE", "1000000"),
        "ECHO": ECHO,
        "CLASSIC": CLASSIC,
        "WRONG": WRONG,
    }
    return {name: library_of(folder_with(folder / name, text + SCHEDULE)) for name, text in sources.items()}


def machine(programs, *names, rates=RATES, **options):
    boards = {
        name: NativeBoard(name, programs[name], hardware=Hardware(can="classic" if name == "CLASSIC" else "fd"))
        for name in names
    }
    wiring = Wiring(can=[CanWire(name, 1, 1) for name in names])
    return contextlib.closing(Machine(Nothing(), boards, {"can1": rates}, wiring, seed=1, log="full", **options))


def test_a_board_sends_64_bytes_at_two_bit_rates_and_the_other_answers(programs):
    with machine(programs, "SENDER", "ECHO") as robot:
        wire = robot.wire()
        robot.run_for(0.1)
        sent, answers = wire.frames(0x123), wire.frames(0x124)
        assert len(sent) == 50 and len(answers) >= 49
        assert {frame.flags for frame in sent + answers} == {FLAG_FD | FLAG_BRS | 15}
        body = bytes(3) + bytes(range(4, 64))
        assert [frame.data for frame in sent] == [bytes([count + 1]) + body for count in range(50)]
        assert answers[0].data == sent[0].data[:-1] + bytes([63 ^ 0xFF])
        # 22 nominal bits of 2 us and 570 bits of 0.5 us without stuff bits: 329 us, at most a quarter more
        assert 329_000 < answers[0].time_ns - sent[0].time_ns < 329_000 * 1.25 + 20_000
        assert robot.buses[0].load.data_share() > 0.8 and robot.buses[0].counters.errors == 0
        counts = {name: each.can[0] for name, each in robot.counters().items()}
        assert counts["SENDER"].sent == 50 and counts["ECHO"].received == 50
        robot.wire().assert_period(0x123, "2 ms", jitter="400 us")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="boards in their own processes need Linux")
def test_boards_in_their_own_processes_give_the_same_bytes(programs):
    with machine(programs, "SENDER", "ECHO") as one, machine(programs, "SENDER", "ECHO", mode=OwnProcesses()) as many:
        for robot in (one, many):
            robot.run_for(0.1)
        assert one.trace_digest() == many.trace_digest() and not many.deaths
        assert one.logbook.frames()["flags"].tolist() == many.logbook.frames()["flags"].tolist()


def test_a_classic_board_destroys_fd_frames_by_error_frames_until_it_is_error_passive(programs):
    with machine(programs, "SENDER", "ECHO", "CLASSIC") as robot:
        robot.run_for(0.1)
        bus = robot.buses[0]
        # each form error costs it one, and its dominant flag is the first: eight more. 128 / 9 frames are destroyed
        assert bus.nodes[2].passive and 14 <= bus.counters.errors
        assert robot.wire().frames(0x124)  # from then on they pass
        assert not bus.nodes[0].passive or bus.nodes[0].transmit_errors < 256


def test_a_board_whose_data_rate_is_not_that_of_the_bus_is_refused(programs):
    with pytest.raises(UserError, match="SLOW starts its CAN FD controller 1 with 500000 and 1000000 .* and 2000000"):
        machine(programs, "SLOW", "ECHO")


def test_fd_frames_on_a_classic_bus_are_refused_by_name(programs):
    with machine(programs, "SENDER", "ECHO", rates=500_000) as robot, pytest.raises(UserError) as caught:
        robot.run_for(0.1)
    assert "SENDER: CAN FD frame 0x123 of controller 1: can1 is classic CAN" in str(caught.value)


def test_bit_rates_that_no_bus_has_are_refused_by_name(programs):
    with pytest.raises(UserError, match="machine: bus can1: data bit rate 1 bit/s is outside"):
        machine(programs, "SENDER", "ECHO", rates=(500_000, 1))


@pytest.mark.parametrize(
    ("name", "kind", "rule"),
    [
        ("SENDER", "classic", "fw_canfd_start: this board has the classic CAN controllers of an LPC2194"),
        ("CLASSIC", "fd", "fw_can_start: this board has CAN FD controllers"),
    ],
)
def test_a_program_for_the_other_kind_of_controller_is_refused(programs, name, kind, rule):
    with pytest.raises(UserError, match=rule):
        NativeBoard(name, programs[name], hardware=Hardware(can=kind))


@pytest.mark.parametrize(
    ("number", "rule"),
    [
        (1, "9 data bytes; a CAN FD frame has"),
        (2, "length 65 is above 64"),
        (3, "a classic frame has at most 8"),
        (4, "identifier 0x800 is above 0x7ff"),
        (5, "CAN FD has no remote frames"),
        (6, "flags 0x8 do not exist"),
    ],
)
def test_a_frame_that_does_not_exist_ends_the_run_and_names_the_call(programs, number, rule):
    board = NativeBoard("WRONG", programs["WRONG"], hardware=Hardware(can="fd"))
    for bit in range(3):
        board.pins[bit] = number >> bit & 1
    with pytest.raises(UserError, match=f"WRONG: fw_canfd_transmit: .*{rule}"):
        board.advance(10_000_000)


def test_a_program_of_python_can_exchanges_messages_of_every_length_with_a_board(programs):
    with machine(programs, "ECHO") as robot, LockstepBus(robot) as bus:
        for length in (0, 1, 7, 8, 12, 16, 20, 24, 32, 48, 64):
            for extended in (False, True):
                message = can.Message(
                    arbitration_id=0x140,
                    is_extended_id=extended,
                    is_fd=True,
                    bitrate_switch=length % 2 == 0,
                    data=bytes(range(length)),
                )
                bus.send(message)
                answer = bus.recv(0.01)
                data = bytearray(range(length))
                if length:
                    data[-1] ^= 0xFF
                assert answer.data == data and (answer.arbitration_id, answer.is_fd) == (0x141, True)
                assert answer.bitrate_switch == message.bitrate_switch and answer.is_extended_id == extended
        bus.send(can.Message(arbitration_id=0x140, is_extended_id=False, data=b"abc"))
        answer = bus.recv(0.01)
        assert not answer.is_fd and answer.data == b"ab" + bytes([ord("c") ^ 0xFF])
        bus.send(can.Message(arbitration_id=0x200, is_extended_id=False, is_fd=True, data=bytes(64)))
        assert bus.recv(0.01) is None  # its acceptance filter


def test_what_the_log_on_disk_keeps_of_long_frames_is_whole_however_it_is_read(programs):
    """4096 rows are read at a time, and a frame of 64 bytes is eight rows."""
    with machine(programs, "SENDER", "ECHO") as robot:
        robot.run_for(2.5)
        rows = list(robot.logbook.kept("can1"))
        assert len(rows) >= 4 and len(robot.logbook.frames()["flags"]) == robot.buses[0].counters.frames
        frames = robot.wire(since_s=0.0).frames(0x123)
        assert len(frames) >= 1240 and {frame.data[4:] for frame in frames} == {bytes(range(4, 64))}


def answers_to_every_length(bus, run):
    """Send messages of every length to ECHO by `bus`; run() lets the machine's time pass. Each answer is compared."""
    for length in (0, 8, 12, 64):
        message = can.Message(
            arbitration_id=0x140,
            is_extended_id=False,
            is_fd=True,
            bitrate_switch=length != 12,
            data=bytes(range(length)),
        )
        bus.send(message)
        run()
        answer = bus.recv(30)
        data = bytearray(range(length))
        if length:
            data[-1] ^= 0xFF
        assert (answer.arbitration_id, answer.is_fd, bytes(answer.data)) == (0x141, True, bytes(data))
        assert answer.bitrate_switch == message.bitrate_switch
    bus.send(can.Message(arbitration_id=0x140, is_extended_id=False, data=b"abc"))
    run()
    assert not bus.recv(30).is_fd


def test_a_can_fd_bus_on_an_interface_outside_carries_frames_of_every_length(programs):
    """The other program is on python-can's `virtual`, which has no bit times: the machine's record has them."""
    with machine(programs, "ECHO") as robot, can.Bus(interface="virtual", channel="fd outside", fd=True) as program:
        put_on(robot, "can1", "virtual:fd outside", speed=100.0)
        answers_to_every_length(program, lambda: robot.run_for(0.005))
        sent, answered = robot.wire().frames(0x140), robot.wire().frames(0x141)
        assert [len(frame.data) for frame in sent] == [len(frame.data) for frame in answered] == [0, 8, 12, 64, 3]
        assert answered[3].data == bytes(range(63)) + bytes([63 ^ 0xFF])
        # of 64 bytes: 29 nominal bits of 2 us at least and 549 data bits of 0.5 us, a quarter more with stuff bits
        assert 329_000 < answered[3].time_ns - sent[3].time_ns < 329_000 * 1.25 + 20_000 + 2 * 125_000


def test_a_classic_board_on_an_interface_outside_receives_no_can_fd_frame(programs):
    with machine(programs, "CLASSIC") as robot, can.Bus(interface="virtual", channel="mixed", fd=True) as program:
        put_on(robot, "can1", "virtual:mixed", speed=100.0)
        program.send(can.Message(arbitration_id=0x140, is_extended_id=False, is_fd=True, data=bytes(12)))
        program.send(can.Message(arbitration_id=0x141, is_extended_id=False, data=b"a"))
        robot.run_for(0.025)
        assert robot.counters()["CLASSIC"].can[0].received == 1
        assert program.recv(30).arbitration_id == 0x10


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names to attach by need Linux")
def test_a_program_of_another_process_attaches_to_the_can_fd_bus_of_a_machine(programs):
    name = fresh_name()
    with machine(programs, "ECHO") as robot:
        offer(robot, name)
        ending = threading.Event()

        def run():
            while not ending.is_set():
                robot.run_for(0.001)

        thread = threading.Thread(target=run)
        thread.start()
        try:
            with can.Bus(interface="ranger_sim", channel=f"{name}/can1", fd=True, ignore_config=True) as bus:
                answers_to_every_length(bus, lambda: None)
        finally:
            ending.set()
            thread.join()
