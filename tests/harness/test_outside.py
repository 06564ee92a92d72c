"""A machine of which a board is outside: the servo's control board is this test, on an interface of python-can."""

import contextlib
import os
import pathlib
import struct

import can
import pytest

from ranger_sim.datatable.loader import load_table
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import profile
from ranger_sim.harness.outside.machine import Pace, put_outside
from tests.firmware_sim.native.support import COMPILER

SERVO = pathlib.Path(__file__).resolve().parents[2] / "examples" / "servo"
TABLE = load_table(SERVO / "table")
STATE, ANGLE, RATE, SHOWN = 16, 17, 18, 32  # CONTROL_STATE, CONTROL_TARGET_ANGLE, CONTROL_TARGET_RATE, DRIVE_ANGLE


def written(tmp_path, **replaced):
    text = (SERVO / "control_outside.toml").read_text(encoding="utf-8")
    for old, new in replaced.items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "outside.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def servo(monkeypatch):
    monkeypatch.syspath_prepend(SERVO)
    from servo import new

    with contextlib.closing(new(seed=1)) as made:
        yield made


def frame(identifier, kind, value):
    return can.Message(arbitration_id=identifier, data=struct.pack(f"<{kind}I", value, 0), is_extended_id=False)


@pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
def test_the_drive_obeys_a_control_board_that_is_outside(servo, tmp_path):
    path = written(tmp_path, socketcan="virtual", vcan0="servo outside")
    with can.Bus(interface="virtual", channel="servo outside") as control:
        put_outside(servo, profile.load(path, table=TABLE), speed=50.0)
        received = []
        while servo.time_s < 0.8:
            for message in (frame(STATE, "I", 1), frame(ANGLE, "f", 0.5), frame(RATE, "f", 0.0)):
                control.send(message)
            servo.run_for(0.004)
            while (message := control.recv(0)) is not None:
                if message.arbitration_id == SHOWN:
                    received.append(struct.unpack("<f", bytes(message.data[:4]))[0])
        assert servo.quantities()["angle_rad"] == pytest.approx(0.5, abs=0.02)
        # every 2 ms; what left at the very end may still be under way
        assert 390 <= len(received) <= 401 and received[-1] == pytest.approx(0.5, abs=0.02)
        assert servo.boards["CONTROL"].counters().slots.count == 0


@pytest.mark.parametrize(
    ("replaced", "line"),
    [
        ({"CONTROL = ": "MCH = "}, "no such board; the boards are DRIVE, CONTROL"),
        ({"buses.can1": "buses.can2"}, "no such bus; the buses are can1"),
        ({'interface = "socketcan"': 'interface = "sokketcan"'}, "unknown to python-can"),
        ({'channel = "vcan0"': "bit_rate = 5"}, "is missing: which channel"),
    ],
)
def test_a_profile_is_held_against_the_machines_own_table(tmp_path, replaced, line):
    with pytest.raises(UserError, match=line):
        profile.load(written(tmp_path, **replaced), table=TABLE)


def test_a_client_that_leaves_while_the_machine_waits_for_the_clock_does_not_end_it():
    """What a poll closes is not waited on any more."""

    class Client:
        def __init__(self):
            self.read, self.write = os.pipe()
            os.close(self.write)  # so that it is readable: its program has gone

        def filenos(self):
            return [] if self.read < 0 else [self.read]

    class Waiting:
        polled = (Client(),)
        polls = 0

        def poll_now(self):
            os.close(self.polled[0].read)
            self.polled[0].read = -1
            self.polls += 1

    machine = Waiting()
    pace = Pace(machine, 1.0)
    pace.begin(0)
    assert pace.release(2_000_000) > 2_000_000 and machine.polls == 1


def test_a_can_fd_bus_of_a_table_is_opened_with_its_data_bit_rate():
    """SocketCAN gets its rates from `ip link`, other interfaces from python-can; each is opened with CAN FD."""
    schedule = profile.full_schedule()
    made = [
        profile.BusProfile("can1", interface, "x", 500_000, "full", schedule, {}, data_bit_rate=2_000_000).python_can()
        for interface in ("socketcan", "pcan", "virtual")
    ]
    assert made[0] == {"interface": "socketcan", "channel": "x", "fd": True}
    assert made[1] == {"interface": "pcan", "channel": "x", "bitrate": 500_000, "data_bitrate": 2_000_000, "fd": True}
    assert made[2] == {"interface": "virtual", "channel": "x", "fd": True}
