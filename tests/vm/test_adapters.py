"""Two CAN adapters (Kvaser PCI, the kernel's own driver) on one wire at 1 Mbit/s."""

import contextlib
import subprocess

import pytest

from harness.ranger import Ranger
from harness.scenario import Scenario
from tools import walk

from . import places

pytestmark = pytest.mark.adapters
BIT_RATE = 1_000_000


def ip_link(*arguments):
    subprocess.run(["ip", "link", "set", *map(str, arguments)], check=True)


def set_up(name, bit_rate=BIT_RATE):
    """The commands that a user types."""
    ip_link(name, "down")
    ip_link(name, "type", "can", "bitrate", bit_rate)
    ip_link(name, "txqueuelen", 1000)
    ip_link(name, "up")


@pytest.fixture
def adapters():
    """can0 and can1, up at 1 Mbit/s; only in the virtual machine may we do that."""
    assert places.in_virtual_machine(), "adapters of this machine are not ours to set"
    for name in ("can0", "can1"):
        set_up(name)
    yield "can0", "can1"
    for name in ("can0", "can1"):
        ip_link(name, "down")


def test_a_walks_frames_pass_from_adapter_to_adapter(adapters, candump, tmp_path, figure):
    with contextlib.closing(Ranger(Scenario(), log="full")) as robot:
        robot.run_for(0.5)
        walk.write_frames(robot, tmp_path)
    watcher = candump("can1")
    log = tmp_path / "can1.log"
    subprocess.run(["canplayer", "-t", "-I", log, "can0=can1"], check=True, timeout=120)
    assert watcher.stop() == ""
    played = [line.split()[2] for line in log.read_text().splitlines()]
    assert watcher.data() == {"can1": played}
    assert len(played) > 1000
    figure(f"can0 -> can1 (Kvaser, {BIT_RATE} bit/s): {len(played)} frames of a walk, all equal and in order")
