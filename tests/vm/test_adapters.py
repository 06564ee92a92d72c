"""Two CAN adapters (Kvaser PCI, the kernel's own driver) on one wire at 1 Mbit/s."""

import collections
import contextlib
import json
import pathlib
import subprocess

import cantools
import pytest

from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.datatable.generate import GENERATED_FOLDER
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.run import walk

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


# The hip's bus on two adapters of 1 Mbit/s, the other three emulated at the same rate.
PROFILE = """
title = "hip on an adapter"
[boards]
MCH = "emulated"
MCFO = "emulated"
MCFI = "emulated"
MCSI = "emulated"
UI = "emulated"
CSR = "emulated"
MB = "emulated"
[buses.can1]
interface = "socketcan"
channel = "can1"
bit_rate = 1_000_000
schedule = "1mbit"
""" + "".join(
    f"""
[buses.can{number}]
bit_rate = 1_000_000
schedule = "1mbit"
"""
    for number in (2, 3, 4)
)
SPEED = 1 / 64  # as in test_robot_on_vcan.py
STEPS = 1
CONTROLLER = pathlib.Path(__file__).with_name("let_go_early.toml")


def received(name):
    """Frames that an adapter has received from the wire."""
    shown = subprocess.run(["ip", "-statistics", "-json", "link", "show", name], capture_output=True, check=True)
    return json.loads(shown.stdout)[0]["stats64"]["rx"]["packets"]


def test_the_hip_board_on_one_adapter_walks_with_the_rest_of_the_robot_on_the_other(
    adapters, candump, command, tmp_path, figure
):
    profile = tmp_path / "adapters.toml"
    profile.write_text(PROFILE)
    before = {name: received(name) for name in adapters}
    watcher = candump("can0", "can1")
    done = command(
        *("up", "--no-real-time", "--controller", CONTROLLER, "--speed", SPEED, "--steps", STEPS, "--profile", profile),
        *("--bus", "MCH=socketcan:can0"),
        *("--log", "full", "--out", tmp_path / "out", "--json", tmp_path / "summary.json"),
    )
    came_in = {name: received(name) - before[name] for name in adapters}
    assert watcher.stop() == ""
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["steps"] >= STEPS and not summary["fell"] and summary["failed_boards"] == []

    seen = watcher.frames()
    logged = [tuple(frame) for _, _, *frame in read_candump(tmp_path / "out" / "can1.log")]
    assert collections.Counter(seen["can0"]) == collections.Counter(seen["can1"]) == collections.Counter(logged)
    database = cantools.database.load_file(GENERATED_FOLDER / "can1.dbc")
    of_hip = sum(database.get_message_by_frame_id(identifier).senders == ["MCH"] for identifier, *_ in logged)
    assert came_in == {"can0": len(logged) - of_hip, "can1": of_hip}  # each side has the other's frames from the wire
    assert min(came_in.values()) > 300
    figure(
        f"MCH on can0, the rest on can1 (Kvaser, {BIT_RATE} bit/s): {summary['steps']} steps, "
        f"{summary['distance_m']:.2f} m in {summary['time_s']:.2f} s of its time, "
        f"{summary['realtime_factor']:.4f} x real time; {of_hip} frames of MCH, {len(logged) - of_hip} of the others"
    )
