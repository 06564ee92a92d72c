"""`ranger-sim new DIR --drive cia402` and `odrive`: drives that drivers who know nothing of the simulator move."""

import contextlib
import os
import pathlib
import re
import runpy
import struct
import subprocess
import sys

import can
import pytest

from ranger_sim.can_bus.edge.lockstep_bus import LockstepBus
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside.machine import put_on
from ranger_sim.tools import cli
from ranger_sim.tools.new import drives
from tests.firmware_sim.native.support import COMPILER
from tests.ranger.testing.project import environment, how_to_find_the_plugin

ROOT = pathlib.Path(__file__).resolve().parents[2]
ROBOTS = ROOT / "examples" / "robots"
pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
SHOULDER, ELBOW = 1, 2
UPLOAD, TEXT = 0x40, 9


def written(folder, protocol, *more):
    assert cli.main(["new", str(folder), "--drive", protocol, *more]) == 0
    return folder


def own_environment():
    return environment() | {"PYTHONPATH": str(ROOT)}


def run_tests_of(project):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *how_to_find_the_plugin(), "."]
    return subprocess.run(command, cwd=project, env=own_environment(), capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return written(tmp_path_factory.mktemp("drives") / "canopen", "cia402")


@contextlib.contextmanager
def machine_of(project, monkeypatch):
    monkeypatch.syspath_prepend(project)
    for name in ("body", "machine"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with contextlib.closing(runpy.run_path(str(project / "machine.py"))["new"](seed=1)) as machine:
        yield machine
    sys.modules.pop("body", None)


@pytest.fixture
def bus(project, monkeypatch):
    with machine_of(project, monkeypatch) as machine:
        made = LockstepBus(machine)
        assert made.recv(0.01).arbitration_id == 0x700 + SHOULDER  # boot-up messages, sent while the program starts
        assert made.recv(0.01).arbitration_id == 0x700 + ELBOW
        yield made


def send(bus, identifier, data=b""):
    bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))


def asked(bus, data, node=SHOULDER):
    """The answer to an SDO request."""
    send(bus, 0x600 + node, bytes(data).ljust(8, b"\0"))
    while (message := bus.recv(0.1)) is not None:
        if message.arbitration_id == 0x580 + node:
            return bytes(message.data)
    raise AssertionError("no answer")


def uploaded(bus, index, sub=0, node=SHOULDER):
    """An object by SDO: expedited, or in segments with alternating toggle bits, by CiA 301."""
    answer = asked(bus, struct.pack("<BHB", UPLOAD, index, sub), node)
    assert struct.unpack_from("<HB", answer, 1) == (index, sub), answer.hex()
    if answer[0] & 2:
        return answer[4 : 8 - (answer[0] >> 2 & 3)]
    assert answer[0] == 0x41, answer.hex()
    size, data, toggle = struct.unpack_from("<I", answer, 4)[0], b"", 0
    while True:
        answer = asked(bus, [0x60 | toggle], node)
        assert answer[0] & 0xF0 == toggle
        data += answer[1 : 8 - (answer[0] >> 1 & 7)]
        toggle ^= 0x10
        if answer[0] & 1:
            assert len(data) == size
            return data


def write(bus, index, data, sub=0, node=SHOULDER):
    answer = asked(bus, struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub) + data, node)
    return 0 if answer[0] == 0x60 else struct.unpack_from("<I", answer, 4)[0]


def frames_until(bus, seconds):
    end, found = bus.machine.time_s + seconds, []
    while bus.machine.time_s < end - 1e-6:
        message = bus.recv(end - bus.machine.time_s)
        if message is not None:
            found.append((message.arbitration_id, bytes(message.data)))
    return found


@pytest.mark.parametrize("protocol", drives.PROTOCOLS)
def test_the_tests_of_the_project_pass_at_once(tmp_path, protocol):
    project = written(tmp_path / protocol, protocol)
    assert not [path for path in project.rglob("*") if path.is_file() and "[%" in path.read_text()]
    done = run_tests_of(project)
    assert done.returncode == 0 and "4 passed" in done.stdout, done.stdout


@pytest.mark.parametrize(("protocol", "robot", "passed"), [("cia402", "arm", 5), ("odrive", "pendulum", 3)])
def test_drives_at_the_actuators_of_a_mujoco_model_pass_too(tmp_path, protocol, robot, passed):
    pytest.importorskip("mujoco")
    project = written(tmp_path / robot, protocol, "--plant", "mujoco", str(ROBOTS / f"{robot}.xml"))
    done = run_tests_of(project)
    assert done.returncode == 0 and f"{passed} passed" in done.stdout, done.stdout


def test_a_driver_of_the_package_canopen_moves_a_joint_of_another_process(project):
    pytest.importorskip("canopen")
    unused_name = f"drives-{os.getpid()}"
    serve = [sys.executable, "serve.py", "--name", unused_name, "--seconds", "30"]
    with subprocess.Popen(serve, cwd=project, env=own_environment(), stdout=subprocess.PIPE, text=True) as served:
        try:
            assert served.stdout.readline() == f"the drives are on {unused_name}/can1\n"
            driver = [sys.executable, "driver.py", "--channel", f"{unused_name}/can1"]
            done = subprocess.run(
                driver, cwd=project, env=own_environment(), capture_output=True, text=True, check=False
            )
        finally:
            served.terminate()
    assert done.stdout == "ranger-sim joint drive\nOPERATION ENABLED\nat 30 degrees\n", done.stderr


def test_every_object_of_the_eds_file_is_in_the_drive_with_its_length_and_default(project, bus):
    canopen = pytest.importorskip("canopen")
    dictionary = canopen.import_od(str(project / "shoulder" / "shoulder.eds"), SHOULDER)
    changing = {0x6041, 0x6062, 0x6064, 0x6074, 0x6077, 0x6078, 0x60F4}
    seen = 0
    for entry in dictionary.values():
        if entry.index < 0x1000:
            continue  # the data types of dummy entries
        for each in entry.values() if hasattr(entry, "values") else [entry]:
            data = uploaded(bus, each.index, each.subindex)
            if each.data_type == TEXT:
                assert data.decode("ascii") == each.default
                continue
            assert 8 * len(data) == len(each), each.qualname
            if each.index not in changing:
                assert each.decode_raw(data) == each.default, each.qualname
            seen += 1
    assert seen > 150


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ([0x40, 0x34, 0x12, 0], 0x06020000),  # no such object
        ([0x40, 0x18, 0x10, 9], 0x06090011),  # no such sub-index
        ([0x2B, 0x41, 0x60, 0, 1, 0], 0x06010002),  # the status word is read only
        ([0x2F, 0x40, 0x60, 0, 6], 0x06070010),  # one byte for two
        ([0x2F, 0x60, 0x60, 0, 7], 0x06090030),  # interpolated position is no mode of this drive
        ([0x23, 0x83, 0x60, 0, 0, 0, 0, 0], 0x06090030),  # an acceleration of 0
        ([0x60], 0x05040001),  # a segment without a transfer
        ([0xC6, 0x40, 0x60, 0], 0x05040001),  # block download
        ([0x2F, 0x00, 0x1A, 0, 5], 0x06020000),  # an entry of the mapping that names no object
    ],
)
def test_a_request_that_cannot_be_served_is_aborted_with_the_code_of_cia_301(bus, request_, code):
    answer = asked(bus, request_)
    assert answer[0] == 0x80 and struct.unpack_from("<I", answer, 4)[0] == code
    assert uploaded(bus, 0x1000) == struct.pack("<I", 0x00020192)


def test_a_value_in_segments_is_written_and_a_toggle_bit_that_does_not_change_aborts(bus):
    assert asked(bus, [0x21, 0x81, 0x60, 0, 4])[0] == 0x60
    assert asked(bus, [0x06, 0x11, 0x22])[0] == 0x20  # 4 bytes, more to come
    assert asked(bus, [0x06, 0x00, 0x00])[4:] == struct.pack("<I", 0x05030000)
    assert asked(bus, [0x21, 0x81, 0x60, 0, 4])[0] == 0x60
    assert asked(bus, [0x0A, 0x11, 0x22])[0] == 0x20  # 2 bytes
    assert asked(bus, [0x1B, 0x03, 0x00])[0] == 0x30  # the other 2, the last
    assert uploaded(bus, 0x6081) == bytes([0x11, 0x22, 0x03, 0x00])


def test_a_pdo_is_mapped_anew_and_sent_every_second_sync(bus):
    invalid = struct.pack("<I", 0x80000480 + SHOULDER)
    assert write(bus, 0x1803, invalid, sub=1) == 0
    assert write(bus, 0x1803, bytes([2]), sub=2) == 0
    assert write(bus, 0x1A03, bytes([0])) == 0
    assert write(bus, 0x1A03, struct.pack("<I", 0x60640020), sub=1) == 0
    assert write(bus, 0x1A03, struct.pack("<I", 0x60400010), sub=2) == 0
    assert write(bus, 0x1A03, bytes([2])) == 0x06040041  # the control word cannot be sent
    assert write(bus, 0x1A03, struct.pack("<I", 0x60770010), sub=2) == 0
    assert write(bus, 0x1A03, bytes([2])) == 0
    assert write(bus, 0x1803, struct.pack("<I", 0x480 + SHOULDER), sub=1) == 0
    send(bus, 0x000, bytes([1, SHOULDER]))
    for _ in range(4):
        send(bus, 0x080)
        frames_until(bus, 0.001)
    sent = []
    for _ in range(4):
        send(bus, 0x080)
        sent.append([data for identifier, data in frames_until(bus, 0.002) if identifier == 0x480 + SHOULDER])
    assert [len(each) for each in sent] == [0, 1, 0, 1] and len(sent[1][0]) == 6


def test_nmt_moves_a_node_through_its_states_which_its_heartbeat_reports(bus):
    assert write(bus, 0x1017, struct.pack("<H", 10)) == 0
    heard = []
    for command in (1, 2, 128, 129):
        send(bus, 0x000, bytes([command, SHOULDER]))
        heard.append([data[0] for identifier, data in frames_until(bus, 0.025) if identifier == 0x700 + SHOULDER])
    assert [each[-1] for each in heard[:3]] == [5, 4, 127]
    assert heard[3] == [0]  # boot-up; the heartbeat is off again
    assert uploaded(bus, 0x1017) == b"\0\0"


def test_the_state_machine_takes_only_the_ways_of_cia_402(bus):
    def state_after(word):
        assert write(bus, 0x6040, struct.pack("<H", word)) == 0
        frames_until(bus, 0.002)
        return struct.unpack("<H", uploaded(bus, 0x6041))[0] & 0x6F

    ways = [
        (0x07, 0x40),  # switch on disabled: only shut down leads out of it
        (0x06, 0x21),  # ready to switch on
        (0x07, 0x23),  # switched on
        (0x0F, 0x27),  # operation enabled
        (0x07, 0x23),  # disable operation
        (0x06, 0x21),
        (0x0F, 0x27),  # through switched on
        (0x00, 0x40),  # disable voltage
        (0x80, 0x40),  # no fault to reset
    ]
    for word, state in ways:
        found = state_after(word)
        assert (found & 0x4F if state == 0x40 else found) == state, (hex(word), hex(found))


def test_a_profile_position_keeps_its_speed_and_ends_at_the_target_to_the_count(bus):
    for index, data in ((0x6081, 4000), (0x6083, 20000), (0x6084, 20000), (0x607A, 2000)):
        assert write(bus, index, struct.pack("<i", data)) == 0
    assert write(bus, 0x6060, bytes([1])) == 0
    for word in (0x06, 0x07, 0x0F, 0x1F):
        assert write(bus, 0x6040, struct.pack("<H", word)) == 0
    fastest = 0
    for _ in range(30):
        fastest = max(fastest, abs(struct.unpack("<i", uploaded(bus, 0x606B))[0]))
        frames_until(bus, 0.01)
    frames_until(bus, 0.5)
    # 2000 counts at 4000 counts/s with ramps of 0.2 s are 0.7 s; the link's weight then takes its time
    assert fastest == 4000
    while not struct.unpack("<H", uploaded(bus, 0x6041))[0] & 0x0400 and bus.machine.time_s < 4.0:
        frames_until(bus, 0.05)
    assert struct.unpack("<i", uploaded(bus, 0x6062)) == (2000,)
    assert struct.unpack("<i", uploaded(bus, 0x6064))[0] == pytest.approx(2000, abs=20)


def test_the_same_program_gives_the_same_bytes(project, monkeypatch):
    digests = []
    for _ in range(2):
        with machine_of(project, monkeypatch) as machine:
            made = LockstepBus(machine)
            for word in (0x06, 0x07, 0x0F):
                write(made, 0x6040, struct.pack("<H", word))
            machine.run_for(0.1)
            digests.append(machine.trace_digest())
    assert digests[0] == digests[1]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--drive", "ethercat"], "unknown 'ethercat'; available: cia402, odrive"),
        (["--drive", "odrive", "--from", "a.dbc"], "--drive and --from exclude each other"),
        (["--drive", "odrive", "--plant", "fmu", "a.fmu"], "--plant fmu: allowed is mujoco"),
    ],
)
def test_what_cannot_be_written_is_refused_in_a_line(tmp_path, capsys, arguments, line):
    with contextlib.suppress(SystemExit):
        assert cli.main(["new", str(tmp_path / "x"), *arguments]) == 2
    assert re.search(line, capsys.readouterr().err) and not (tmp_path / "x").exists()


def test_a_bus_that_the_machine_does_not_have_is_refused(project, monkeypatch):
    with machine_of(project, monkeypatch) as machine:
        with pytest.raises(UserError, match="unknown bus 'can2'"):
            put_on(machine, "can2", "virtual:a")
        with pytest.raises(UserError, match="unknown bus 'can3'"):
            LockstepBus(machine, "can3")


def test_a_bus_of_the_machine_goes_on_an_interface_of_python_can(project, monkeypatch):
    with machine_of(project, monkeypatch) as machine, can.Bus(interface="virtual", channel="drives") as outside:
        assert put_on(machine, "can1", "virtual:drives", speed=50.0) == "virtual:drives"
        machine.run_for(0.02)
        outside.send(can.Message(arbitration_id=0x602, data=[0x40, 0, 0x10, 0, 0, 0, 0, 0], is_extended_id=False))
        machine.run_for(0.02)
        found = {message.arbitration_id: bytes(message.data) for message in iter(lambda: outside.recv(0), None)}
        assert found[0x582] == bytes([0x43, 0, 0x10, 0, 0x92, 1, 2, 0])
