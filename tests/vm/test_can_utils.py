"""candump, cansend and canplayer from can-utils, python-can's socketcan, and our files and codes between them."""

import contextlib
import subprocess

import can
import cantools

from ranger_sim.can_bus.edge import interfaces
from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener
from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.datatable.generate import GENERATED_FOLDER
from ranger_sim.foundation.events import (
    CAN_REQUEST,
    FLAG_BRS,
    FLAG_EXTENDED,
    FLAG_FD,
    FLAG_REMOTE,
    NEVER,
    EventQueue,
)
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.run import walk


def test_python_can_finds_the_interfaces():
    assert {"socketcan:vcan0", "socketcan:vcan3"} <= set(interfaces.available_interfaces())


def test_a_board_with_can_fd_on_an_interface_exchanges_frames_with_cansend_and_candump(candump):
    watcher = candump("vcan1")
    place = {"interface": "socketcan", "channel": "vcan1", "fd": True}
    bus = ExternalBus("can1", 500_000, opener("can1", place), 2_000_000)
    inbox = EventQueue(64)
    peer = bus.add_peer("can1, BOARD", inbox, 1, 0, is_fd=True)
    subprocess.run(["cansend", "vcan1", "123##1" + bytes(range(64)).hex()], check=True)
    while inbox.head_time == NEVER:
        bus.poll(0)
    inbox.take()
    assert (inbox.b, inbox.c, inbox.ref) == (0x123, FLAG_FD | FLAG_BRS | 15, bytes(range(64)))
    data = bytes(range(12))
    peer.from_board(
        CAN_REQUEST, 0, 1, 0x124, FLAG_FD | 9, int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
    )
    assert watcher.stop() == ""
    lines = [line.split()[2] for line in watcher.path.read_text().splitlines()]
    # newer kernels set the flag 4, CANFD_FDF, as well (linux/can.h)
    shown = [(line[:5], int(line[5], 16) & 3, line[6:]) for line in lines if "##" in line]
    assert shown == [("123##", 1, bytes(range(64)).hex().upper()), ("124##", 0, data.hex().upper())]
    bus.remove_peer(peer)


def test_cansend_writes_what_our_codes_read_and_candump_reads_what_they_write(candump):
    watcher = candump("vcan0")
    expected = [
        (0x123, 4, 0x04030201, 0),
        (0x7FF, 8, 0x33221100, 0x77665544),
        (0x1F334455, 3 | FLAG_EXTENDED, 0x332211, 0),
        (0x00E, FLAG_REMOTE, 0, 0),
        (0, 0, 0, 0),
    ]
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        for text in ("123#01020304", "7FF#0011223344556677", "1F334455#112233", "00E#R", "000#"):
            subprocess.run(["cansend", "vcan0", text], check=True)
        assert [frame_of_message(bus.recv(10)) for _ in expected] == expected
        for frame in expected:
            bus.send(message_of_frame(0, *frame))
    assert watcher.stop() == ""
    assert watcher.frames() == {"vcan0": 2 * expected}


def test_canplayer_plays_the_log_of_a_walk_and_cantools_reads_what_candump_saw(candump, tmp_path, figure):
    with contextlib.closing(Ranger(Scenario(), log="full")) as robot:
        robot.run_for(0.1)
        walk.write_frames(robot, tmp_path)
    watcher = candump("vcan0", "vcan3")
    for number, interface in ((1, "vcan0"), (4, "vcan3")):
        log = tmp_path / f"can{number}.log"
        subprocess.run(["canplayer", "-t", "-I", log, f"{interface}=can{number}"], check=True, timeout=120)
    assert watcher.stop() == ""
    seen = watcher.frames()
    for number, interface in ((1, "vcan0"), (4, "vcan3")):
        text = (tmp_path / f"can{number}.log").read_text()
        played = [line.split()[2] for line in text.splitlines()]
        assert watcher.data()[interface] == played
        assert len(seen[interface]) == len(played) > 100
    database = cantools.database.load_file(GENERATED_FOLDER / "can1.dbc")
    for identifier, _, lo, hi in seen["vcan0"]:
        decoded = database.decode_message(identifier, lo.to_bytes(4, "little") + hi.to_bytes(4, "little"))
        assert set(decoded) == {"value", "time_ms"}
    figure(f"canplayer -> vcan -> candump: {sum(map(len, seen.values()))} frames of a walk, all equal")
