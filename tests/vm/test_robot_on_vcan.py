"""The whole robot on vcan0 ... vcan3: its boards receive each other through the kernel, and can-utils listen."""

import collections
import dataclasses
import json
import pathlib
import subprocess
import sys

import cantools
import pytest

from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.datatable.generate import GENERATED_FOLDER

from .conftest import ROOT, await_condition, recording

# Virtual seconds per second, by calibration: under software emulation, on a host busy with other work, the robot on
# vcan got to 1/165 ... 1/95 of real time, at 1 Mbit/s (fewer frames) to 1/56. Falling behind is told and harms nothing.
SPEED = 1 / 64
STEPS = 2
CONTROLLER = pathlib.Path(__file__).with_name("let_go_early.toml")
FOREIGN = (0x6F0, 4, 0x04030201, 0)  # of no variable: nobody in the robot listens to it
BUSES = {"can1": "vcan0", "can2": "vcan1", "can3": "vcan2", "can4": "vcan3"}


@dataclasses.dataclass
class Walked:
    """What the robot printed and what candump saw: {bus: [(identifier, flags, lo, hi), ...]}."""

    code: int
    told: str
    summary: dict
    logged: dict
    seen: dict
    candump_told: str


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walk")
    with recording(folder / "candump.log", *BUSES.values()) as watcher:
        robot = subprocess.Popen(
            [
                *(sys.executable, "-m", "ranger_sim", "up", "--no-real-time"),
                *("--controller", str(CONTROLLER), "--speed", str(SPEED), "--steps", str(STEPS)),
                *(word for bus, interface in BUSES.items() for word in ("--bus", f"{bus}=socketcan:{interface}")),
                *("--log", "full", "--out", str(folder / "out"), "--json", str(folder / "summary.json")),
            ],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:

            def robot_talks():
                return robot.poll() is not None or watcher.path.stat().st_size > 100_000

            await_condition(robot_talks, 200)
            subprocess.run(["cansend", "vcan0", "6F0#01020304"], check=True)
            told, _ = robot.communicate(timeout=600)
        finally:
            robot.kill()
            robot.communicate()
        candump_told = watcher.stop()
    assert robot.returncode in (0, 1), told
    seen = watcher.frames()
    return Walked(
        robot.returncode,
        told,
        json.loads((folder / "summary.json").read_text()),
        {bus: [tuple(frame) for _, _, *frame in read_candump(folder / "out" / f"{bus}.log")] for bus in BUSES},
        {bus: seen[interface] for bus, interface in BUSES.items()},
        candump_told,
    )


def test_the_whole_robot_walks_on_four_vcans(walked, figure):
    assert walked.code == 0, walked.told
    assert walked.summary["steps"] >= STEPS and not walked.summary["fell"]
    assert walked.summary["failed_boards"] == []
    figure(
        f"robot on vcan0-3: {walked.summary['steps']} steps, {walked.summary['distance_m']:.2f} m in "
        f"{walked.summary['time_s']:.2f} s of its time, {walked.summary['realtime_factor']:.4f} x real time"
    )


def test_candump_saw_what_the_robot_logged(walked, figure):
    assert walked.candump_told == ""
    for bus in BUSES:
        assert collections.Counter(walked.seen[bus]) == collections.Counter(walked.logged[bus]), bus
        assert by_identifier(walked.seen[bus]) == by_identifier(walked.logged[bus]), bus
        assert len(walked.seen[bus]) > 1000
    counts = ", ".join(f"{bus} {len(frames)}" for bus, frames in walked.seen.items())
    figure(f"candump against the robot's log: {counts} frames, equal, in order within each identifier")


def by_identifier(frames):
    """{identifier: frames in their order}."""
    found = {}
    for frame in frames:
        found.setdefault(frame[0], []).append(frame)
    return found


def test_the_generated_dbc_files_decode_everything_that_candump_saw(walked, figure):
    names = collections.Counter()
    for bus, frames in walked.seen.items():
        database = cantools.database.load_file(GENERATED_FOLDER / f"{bus}.dbc")
        last = {}
        for identifier, flags, lo, hi in frames:
            if (identifier, flags, lo, hi) == FOREIGN:
                continue
            decoded = database.decode_message(identifier, lo.to_bytes(4, "little") + hi.to_bytes(4, "little"))
            name = database.get_message_by_frame_id(identifier).name
            names[name] += 1
            # errors go out by board and code, each with the stamp of its own instant
            of_what = (name, str(decoded.get("board")), str(decoded.get("code")))
            assert decoded["time_ms"] >= last.get(of_what, 0), f"{of_what} on {bus}: its stamps run backwards"
            last[of_what] = decoded["time_ms"]
            if name in ("MCH_ANGLE", "MCFO_ANKLE_ANGLE"):
                assert abs(decoded["value"]) < 3.2
    assert names["MCH_ANGLE"] > 100
    figure(f"cantools with the generated DBC: {sum(names.values())} frames of {len(names)} variables")


def test_a_frame_of_cansend_is_in_the_robots_log(walked):
    assert walked.seen["can1"].count(FOREIGN) == 1
    assert walked.logged["can1"].count(FOREIGN) == 1
