"""XCP on CAN: a master that is a node of the bus, by frames at times of virtual time."""

import contextlib
import os
import pathlib
import struct
import subprocess
import sys
from fractions import Fraction

import can
import numpy
import pytest

from ranger_sim.can_bus.bounds import message
from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener
from ranger_sim.can_bus.edge.taps import RECEIVED, Tap
from ranger_sim.can_bus.frame_log import TIMES_ASKED, TIMES_COLUMNS, TIMES_END, TIMES_IDENTIFIER, FrameTimes
from ranger_sim.datatable import parameters
from ranger_sim.datatable.addresses import XCP_MASTER_ID, XCP_SLAVE_ID, address_of
from ranger_sim.datatable.generated import errors, routes
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import bus_schedule, profile
from ranger_sim.harness.processes.outside import move_bus
from ranger_sim.harness.xcp.can import XcpCanProbe
from ranger_sim.ranger import wiring
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

ROOT = pathlib.Path(__file__).resolve().parents[3]
STEP_S = 0.00025  # of the plant: as often the master looks


def address(name):
    return struct.pack("<I", address_of(parameters.find(name).id)).hex()


class Master:
    """A few lines that know XCP on CAN: a packet is a frame."""

    def __init__(self, robot, bus="can2"):
        self.robot = robot
        self.tap = Tap(next(each for each in robot.buses if each.name == bus), "master")
        self.frames = []  # (ns, packet) of all that the slave has sent
        self.taken = 0

    def pass_time(self, seconds):
        end = self.robot.time_s + seconds - 1e-9
        while self.robot.time_s < end:
            self.tap.poll(self.robot.loop.time)
            self.robot.run_for(STEP_S)
        self.tap.poll(self.robot.loop.time)
        for kind, time, identifier, flags, low, high in self.tap.events:
            if kind == RECEIVED and identifier == XCP_SLAVE_ID:
                assert 1 <= flags <= 8  # a data frame with a standard identifier
                self.frames.append((time, struct.pack("<II", low, high)[: flags & 15]))
        self.tap.events.clear()

    def send(self, text):
        packet = bytes.fromhex(text)
        word = int.from_bytes(packet, "little")
        self.tap.offer(XCP_MASTER_ID, len(packet), word & 0xFFFFFFFF, word >> 32)

    def say(self, text):
        """The answer to a command, as text."""
        self.send(text)
        for _ in range(40):
            self.pass_time(STEP_S)
            new, self.taken = self.frames[self.taken :], len(self.frames)
            answers = [packet for _, packet in new if packet[0] >= 0xFE]
            if answers:
                assert len(answers) == 1
                return answers[0].hex(" ").upper()
        return ""

    def measure(self, names, event, lists=1):
        """Arrange lists of one packet for each name; returns the answers of those that refused to be selected."""
        assert self.say("D6") == "FF"
        assert self.say(f"D500 {lists:02X}00") == "FF"
        for number in range(lists):
            assert self.say(f"D400 {number:02X}00 {len(names):02X}") == "FF"
        for number in range(lists):
            for place in range(len(names)):
                assert self.say(f"D300 {number:02X}00 {place:02X} 01") == "FF"
        refused = []
        for number in range(lists):
            for place, name in enumerate(names):
                assert self.say(f"E200 {number:02X}00 {place:02X} 00") == "FF"
                assert self.say(f"E1FF0400 {address(name)}") == "FF"
            assert self.say(f"E010 {number:02X}00 {event:02X}00 01 00") == "FF"
            answer = self.say(f"DE02 {number:02X}00")
            if answer[:2] != "FF":
                refused.append(answer)
        return refused


@contextlib.contextmanager
def attached(bus="can2", log="none"):
    with contextlib.closing(Ranger(Scenario(seed=3), log=log)) as robot:
        probe = XcpCanProbe(robot, bus)
        robot.attach(probe)
        yield robot, probe, Master(robot, bus)


def test_a_packet_is_a_frame_without_length_or_counter():
    with attached() as (robot, probe, master):
        assert master.say("FD") == ""  # before CONNECT
        assert master.say("FF00") == "FF 05 80 08 08 00 01 01"
        assert master.say("FD") == "FF 00 00 00 00 00"
        assert master.say(f"F404 0000 {address('TIMESTAMP')}").startswith("FF ")
        assert master.say("FE") == "FF"
        assert probe.counters()["commands"] == 5 and probe.counters()["packets_out"] == 4


def test_the_transport_layer_reports_the_slave_and_the_identifier_of_a_list():
    with attached() as (_, _, master):
        assert master.say("F2FF 584350 00") == "FF 58 43 50 D0 07 00 00"
        assert master.say("F2FF 584350 01") == "FF A7 BC AF D0 07 00 00"
        assert master.say("F2FF 584350 00 0000") == "FF 58 43 50 D0 07 00 00"  # filled up
        assert master.say("F2FF 584351 00") == master.say("F2FF 584350 02") == master.say("F2FF 584350") == ""
        assert master.say("F2FE 0000") == ""  # nobody is connected
        master.say("FF00")
        assert master.say("F2FE 0000") == "FE 22"
        assert master.say("D6") == master.say("D500 0100") == "FF"
        assert master.say("F2FE 0000") == "FF 01 00 00 D1 07 00 00"
        assert master.say("F2FD 0000 D2070000") == master.say("F2FE") == master.say("F2") == "FE 20"


def test_commands_that_need_more_than_a_frame_are_unknown_and_blocks_serve_instead():
    with attached() as (robot, probe, master):
        master.say("FF00")
        assert master.say("ED04 0000 00000100") == "FE 20" and master.say("C701 FF04 0000") == "FE 20"
        assert master.say("FB") == "FF 00 01 00 2B 00 00 10"  # 43 packets of 6 bytes hold 255
        first, second = parameters.parameters()[0], parameters.parameters()[1]
        assert second.id == first.id + 1
        values = struct.pack("<ff", robot.variable(first.name), robot.variable(second.name)).hex()
        assert master.say(f"F600 0000 {address(first.name)}") == "FF"
        master.send(f"F008 {values[:12]}")
        assert master.say(f"EF02 {values[12:]}") == "FF"
        assert master.say(f"EF02 {values[12:]}") == "FE 29 00"
        assert probe.counters()["writes_refused"] == 0


def test_a_parameter_is_written_under_the_one_check():
    with attached() as (robot, _, master):
        master.say("FF00")
        row = next(
            each for each in parameters.parameters() if each.type == "f32" and each.minimum == 0.0 and each.maximum
        )
        wanted = struct.unpack("<f", struct.pack("<f", 0.5 * row.maximum))[0]
        for value, answer in ((2.0 * row.maximum, "FE 22"), (float("nan"), "FE 22"), (wanted, "FF")):
            assert master.say(f"F600 0000 {address(row.name)}") == "FF"
            assert master.say(f"F004 {struct.pack('<f', value).hex()}") == answer
        assert robot.variable(row.name) == wanted
        assert master.say(f"F600 0000 {address('MCH_ANGLE')}") == "FF"
        assert master.say("F004 00000000") == "FE 24"


def test_lists_are_sampled_at_slot_rate_with_the_values_of_the_main_brain_at_that_time():
    with attached(log="full") as (robot, _, master):
        master.say("FF00")
        assert master.measure(["MCH_ANGLE", "TIMESTAMP"], event=0) == []
        assert master.say("DD01") == "FF"
        start = robot.loop.time
        master.pass_time(0.1)
        angles = [packet for _, packet in master.frames if packet[0] == 0 and len(packet) == 7]
        stamps = [struct.unpack_from("<H", packet, 1)[0] for packet in angles]
        assert len(stamps) >= 200
        assert {(b - a) % 65536 for a, b in zip(stamps, stamps[1:], strict=False)} == {50}  # of 10 us
        times = [packet for time, packet in master.frames if packet[0] == 1 and time > start]
        counts = [struct.unpack_from("<I", packet, 1)[0] for packet in times]
        # the network time in each row is that of the stamp: it goes up by one each millisecond, as late as the link is
        assert set(b - a for a, b in zip(counts, counts[1:], strict=False)) <= {0, 1, 2}
        assert counts[-1] - counts[0] == pytest.approx((len(counts) - 1) / 2, abs=2)


def test_the_same_frames_of_a_master_give_the_same_bytes_and_no_probe_the_bytes_of_before():
    def run(with_probe, with_master):
        with contextlib.closing(Ranger(Scenario(seed=3), log="full")) as robot:
            if with_probe:
                robot.attach(XcpCanProbe(robot))
            if with_master:
                master = Master(robot)
                master.say("FF00")
                master.measure(["MCH_ANGLE", "TIMESTAMP"], event=0)
                master.say("DD01")
                master.pass_time(0.3 - robot.time_s)
            else:
                robot.run_for(0.3)
            return robot.trace_digest()

    alone = run(False, False)
    assert run(True, False) == alone  # a probe that nobody speaks to is not seen
    measured = run(True, True)
    assert measured == run(True, True) != alone


def test_more_lists_than_the_bus_bears_are_refused_and_those_that_are_borne_lose_nothing():
    with attached() as (robot, probe, master):
        master.say("FF00")
        # A packet of 7 bytes has 100 bits, 22 stuff bits at most and 3 of intermission; of 3 Mbit/s the robot may take
        # 12.6 % on this bus (can-bounds), and all together 80 %: 2,022,000 bit/s are left, a list takes 250,000.
        refused = master.measure(["MCH_ANGLE"], event=0, lists=12)
        assert refused == ["FE 2A"] * 4
        assert master.say("DD01") == "FF"
        master.pass_time(0.2)
        by_list = {number: [p for _, p in master.frames if p[0] == number] for number in range(12)}
        counts = [len(packets) for packets in by_list.values()]
        assert min(counts[:8]) >= 400 and not any(counts[8:])
        for number in range(8):
            stamps = [struct.unpack_from("<H", packet, 1)[0] for packet in by_list[number]]
            assert {(b - a) % 65536 for a, b in zip(stamps, stamps[1:], strict=False)} == {50}
        counted = probe.counters()
        assert counted["packets_dropped"] == counted["packets_lost"] == 0 and len(probe.station.waiting) <= 8
        assert 0.5 < robot.buses[1].load.windows()[-1] < 0.8


def test_at_full_measurement_every_frame_of_the_robot_and_every_packet_keeps_its_proven_bound():
    table, schedules = bus_schedule.robots_table(), profile.default().schedules()
    lists = [
        bus_schedule.Stream(message(f"list {number}", XCP_SLAVE_ID, 500_000, 7, queue="XCP"), (), "XCP")
        for number in range(8)
    ]
    own = bus_schedule.streams(table, "can2", schedules)
    before = bus_schedule.bounds_of(table, "can2", 3_000_000, own).bounds
    *bounds, packet = bus_schedule.bounds_of(table, "can2", 3_000_000, own + lists).bounds
    bounds = bounds[: len(own)]
    frame_ns = 125 * 1000 // 3 + 1  # the longest packet may have begun
    assert all(0 <= new.response_ns - old.response_ns <= frame_ns for new, old in zip(bounds, before, strict=True))
    limits = {
        table.variable(name).id: bound.response_ns
        for stream, bound in zip(own, bounds, strict=True)
        for name in stream.variables
    }
    with attached() as (robot, _, master):
        master.say("FF00")
        assert master.measure(["MCH_ANGLE"], event=0, lists=8) == []
        assert master.say("DD01") == "FF"
        times = robot.buses[1].log.times = FrameTimes()
        blocks = []
        times.sink = lambda last_time_ns, block: blocks.append(block)
        master.frames.clear()
        master.pass_time(1.0)
        times.flush()
    rows = numpy.frombuffer(b"".join(blocks), dtype=numpy.int64).reshape(-1, TIMES_COLUMNS)
    longest = {}
    for number, took in zip(rows[:, TIMES_IDENTIFIER], rows[:, TIMES_END] - rows[:, TIMES_ASKED], strict=True):
        longest[int(number)] = max(longest.get(int(number), 0), int(took))
    received = {number for number in longest if number not in (XCP_MASTER_ID, XCP_SLAVE_ID)}
    assert len(received) >= 5 and all(longest[number] <= limits[number] for number in received)
    late_us = [10 * ((at // 10_000 - struct.unpack_from("<H", data, 1)[0]) % 65536) for at, data in master.frames]
    assert len(late_us) >= 15_000 and max(late_us) * 1000 <= packet.response_ns


def test_the_router_receives_xcp_and_sends_it_nowhere():
    assert routes.DESTINATIONS[XCP_MASTER_ID] == routes.DESTINATIONS[XCP_SLAVE_ID] == 0
    with attached() as (robot, _, master):
        master.say("FF00")
        master.say("FD")
        table = robot.board("CSR").router.table
        assert table.sources[XCP_MASTER_ID] == table.sources[XCP_SLAVE_ID] == 2  # the bus
        assert robot.board("MB").errors.totals[errors.MB_SSP_ID_OOR] == 0


def test_after_bus_off_the_probe_comes_back():
    with attached() as (robot, probe, master):
        assert master.say("FF00")
        bus = robot.buses[1]
        node = next(each for each in bus.nodes if each.name == "XCP")
        node.transmit_errors = 250  # the next error is the last
        bus.set_bit_error_rate(0.01)
        while probe.counters()["bus_off"] < 1:
            assert robot.time_s < 0.1
            master.send("FD")
            master.pass_time(0.001)
        bus.set_bit_error_rate(0.0)
        master.pass_time(0.02)  # 128 times 11 recessive bits are over
        master.taken = len(master.frames)
        assert master.say("FD") == "FF 00 00 00 00 00"


def test_on_a_bus_outside_the_probe_is_a_separate_peer():
    channel = f"xcp-{os.getpid()}"  # python-can's `virtual`: all of a process with this name are on one bus
    where = {"interface": "virtual", "channel": channel, "ignore_config": True}
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot, can.Bus(**where) as master:
        outside = ExternalBus("can2", 3_000_000, opener("can2", where))
        move_bus(robot, outside, {}, tuple(wiring.BOARDS))
        robot.attach(XcpCanProbe(robot, "can2", outside))
        answers = []
        for text in ("FF00", "FD", f"F404 0000 {address('TIMESTAMP')}"):
            master.send(can.Message(arbitration_id=XCP_MASTER_ID, is_extended_id=False, data=bytes.fromhex(text)))
            robot.run_for(0.005)
            while (message := master.recv(0)) is not None:
                if message.arbitration_id == XCP_SLAVE_ID:
                    answers.append(message.data.hex())
        outside.close()
    assert answers[:2] == ["ff058008080001" + "01", "ff0000000000"] and len(answers[2]) == 10


def test_the_example_measures_over_python_can(tmp_path):
    name = f"xcp-example-{os.getpid()}"
    with attached() as (robot, _, _):
        robot.attach(AttachServer(name, {bus.name: bus for bus in robot.buses}))
        program = ROOT / "examples" / "xcp_on_can.py"
        with subprocess.Popen(
            [sys.executable, "-W", "error", program, "5", f"{name}/can2"], stdout=subprocess.PIPE, text=True
        ) as example:
            while example.poll() is None and robot.time_s < 300.0:
                robot.run_for(0.002)
            printed = example.stdout.read()
    assert example.returncode == 0
    assert [line.split()[0] for line in printed.splitlines()] == ["0.00", "0.50", "1.00", "1.50", "2.00"]


def test_a_bus_may_be_filled_to_the_bound_and_no_bit_further():
    with attached() as (_, probe, _):
        lists = [(7, 500_000), (5, 2_000_000)]
        # 125 and 105 bits at the most, of 3 Mbit/s
        assert probe.share_of(lists) == Fraction(125, 1500) + Fraction(105, 6000)
        assert probe.robots_share == Fraction(126, 1000)
        probe.robots_share = Fraction(4, 5) - probe.share_of(lists)
        assert probe.bears(lists)
        probe.robots_share += Fraction(1, 3_000_000)
        assert not probe.bears(lists)


def test_a_bus_that_does_not_exist_is_reported():
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot, pytest.raises(UserError, match="can1, can2"):
        XcpCanProbe(robot, "can5")
