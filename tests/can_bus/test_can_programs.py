"""Programs of others against our buses, each in a separate process: python-can's and cantools' command lines."""

import pathlib

import can
import pytest

from ranger_sim import datatable
from ranger_sim.can_bus.edge.candump import CandumpWriter
from ranger_sim.foundation.events import FLAG_EXTENDED

from .hosting import Program, hosted

DBC = pathlib.Path(datatable.__file__).parent / "generated" / "can1.dbc"


@pytest.fixture
def node():
    """A python-can bus on a channel; shut down at the end."""
    opened = []

    def on(channel):
        bus = can.Bus(interface="ranger_sim", channel=channel, ignore_config=True)
        opened.append(bus)
        return bus

    yield on
    for bus in opened:
        bus.shutdown()


def message(identifier, data=b""):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)


def options(name, channel="can1"):
    return ("-i", "ranger_sim", "-c", f"{name}/{channel}")


def test_the_logger_prints_what_is_on_the_bus(node):
    with hosted("can1") as (name, _), Program("-m", "can.logger", *options(name)) as logger:
        bus = node(f"{name}/can1")
        logger.until(r"Connected to RangerSimBus.*\n")
        logger.until("Started on")
        for number in range(20):
            bus.send(message(0x100 + number, bytes([number, 0xAB])))
        bus.send(can.Message(arbitration_id=0x1ABCDEF0, is_extended_id=True, is_remote_frame=True, dlc=3))
        for number in range(20):
            logger.until(rf"ID: +{0x100 + number:x} +S Rx +DL: +2 +{number:02x} ab")
        logger.until(r"ID: 1abcdef0 +X Rx +R +DL: +3")
        logger.interrupt()
        assert logger.ended() == (0, "")


def test_a_listening_logger_leaves_the_acknowledging_to_others(node):
    with hosted("can1") as (name, _), Program("-m", "can.logger", *options(name), "--passive") as logger:
        bus = node(f"{name}/can1")
        logger.until("Started on")
        bus.send(message(0x123))
        logger.until(r"ID: +288 +S Rx E")  # nobody acknowledges
        other = node(f"{name}/can1")
        logger.until(r"ID: +123 +S Rx")
        assert other.recv(60).arbitration_id == 0x123
        logger.interrupt()
        assert logger.ended() == (0, "")


def test_the_player_replays_a_log_of_ours(node, tmp_path):
    frames = [(i * 1_000_000, 0x200 + i, 8, i, i * i) for i in range(50)]
    frames.append((50_000_000, 0x12345678, 4 | FLAG_EXTENDED, 0xDEADBEEF, 0))
    with CandumpWriter(tmp_path / "walk.log") as log:
        log.write("can1", frames)
    with hosted("can1") as (name, _):
        bus = node(f"{name}/can1")
        with Program("-m", "can.player", *options(name), str(tmp_path / "walk.log")) as player:
            received = [bus.recv(60) for _ in frames]
            assert player.ended()[0] == 0
    assert [each.arbitration_id for each in received] == [frame[1] for frame in frames]
    assert bytes(received[7].data) == (7).to_bytes(4, "little") + (49).to_bytes(4, "little")
    assert received[50].is_extended_id and bytes(received[50].data).hex() == "efbeadde"


def test_the_bridge_joins_two_buses(node):
    with (
        hosted("can1", "can2") as (name, _),
        Program(
            *("-m", "can.bridge", "--bus1-interface", "ranger_sim", "--bus1-channel", f"{name}/can1"),
            *("--bus2-interface", "ranger_sim", "--bus2-channel", f"{name}/can2"),
        ) as bridge,
    ):
        bridge.until("CAN Bridge .Started")
        one, two = node(f"{name}/can1"), node(f"{name}/can2")
        one.send(message(0x11, b"there"))
        got = two.recv(60)
        assert (got.arbitration_id, bytes(got.data)) == (0x11, b"there")
        two.send(message(0x22, b"back"))
        got = one.recv(60)
        assert (got.arbitration_id, bytes(got.data)) == (0x22, b"back")
        bridge.interrupt()
        bridge.until("CAN Bridge .Stopped")
        assert bridge.ended() == (0, "")


def test_the_viewer_shows_frames_in_the_terminal(node):
    with hosted("can1") as (name, _), Program("-m", "can.viewer", *options(name), terminal=True) as viewer:
        viewer.until("Count.*Data")
        bus = node(f"{name}/can1")
        bus.send(message(0x321, b"\xca\xfe"))
        viewer.until("0x321")
        viewer.until("CA.*FE")
        viewer.type("q")
        assert viewer.ended() == (0, "")


def test_cantools_monitor_decodes_with_our_database(node):
    with (
        hosted("can1", bitrate=3_000_000) as (name, _),
        Program(
            *("-m", "cantools", "monitor", "-b", "3000000", *options(name), str(DBC)),
            terminal=True,
        ) as monitor,
    ):
        monitor.until("Received: 0")
        bus = node(f"{name}/can1")
        import cantools

        database = cantools.database.load_file(DBC)
        shown = database.messages[0]
        bus.send(message(shown.frame_id, bytes(shown.length)))
        monitor.until(rf"{shown.name}\(")
        monitor.type("q")
        assert monitor.ended() == (0, "")
