"""A machine that is not Ranger: two boards in C on one bus, a wheel with an encoder, wired by tables."""

import contextlib
import subprocess
import sys

import pytest

from ranger_sim.firmware_sim.native.build import build
from ranger_sim.firmware_sim.native.manifest import load
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults.fault import Fault, Parameter, Place
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.waiting import ConditionNotMetError
from ranger_sim.harness.wiring.wires import AnalogInput, BridgeWire, CanWire, EncoderWire, Wiring
from ranger_sim.plant.bridge import Bridge
from ranger_sim.plant.plant import Plant
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from tests.firmware_sim.native.support import COMPILER, EXAMPLE

needs_a_compiler = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
EDGES_PER_RAD = 128 / (2.0 * 3.141592653589793)  # 64 lines, both edges of channel A
FULL_RATE = 20.0  # rad/s at full duty
PINS = {"encoder_a": 22, "encoder_b": 27, "current": 0}
WIRING = Wiring(
    can=[CanWire("LEFT", 1, 1), CanWire("RIGHT", 1, 1)],
    encoders=[EncoderWire(0, "LEFT", "encoder_a", "encoder_b")],
    analog=[AnalogInput(0, "LEFT", "current")],
    bridges=[BridgeWire("LEFT", 0)],
    names={"LEFT": PINS},
)


class Motor(Bridge):
    """Turns the wheel at the duty that it is given."""

    def __init__(self):
        self.duty = 0.0

    def write_pwm(self, time, mr2, mr6, mr0):
        self.duty = (mr2 - mr6) / mr0


class Wheel(Plant):
    """Its sensor shows 1 V from the beginning; it turns no farther than `end_rad`."""

    def __init__(self, end_rad=1e9):
        Plant.__init__(self, 250_000, voltages=1, samples={"angle_rad": "rad", "rate_rad_per_s": "rad/s"})
        self.motor = Motor()
        self.bridges = [self.motor]
        self.encoders = [IncrementalEncoder("wheel", 64)]
        self.encoders[0].reset(0.0)
        self.angle_rad = self.rate_rad_per_s = 0.0
        self.end_rad = end_rad

    def step(self):
        rate = FULL_RATE * self.motor.duty
        angle = self.angle_rad + rate * self.step_ns * 1e-9
        self.encoders[0].update(self.time_ns, self.time_ns + self.step_ns, self.angle_rad, rate, angle, rate)
        self.angle_rad, self.rate_rad_per_s = angle, rate
        self.analog_start[0] = self.analog_end[0] = 1.0
        self.time_ns += self.step_ns
        if angle > self.end_rad:
            self.fell, self.fall_cause = True, "it hit its end"

    def fill_sample(self, row):
        row[0], row[1] = self.angle_rad, self.rate_rad_per_s


@pytest.fixture(scope="module")
def firmware(tmp_path_factory):
    """The example of the tests of firmware in C: its duty follows the converter, its frame 0x14 has its count."""
    import shutil

    folder = shutil.copytree(EXAMPLE, tmp_path_factory.mktemp("firmware") / "example")
    manifest = load(folder)
    return build(manifest).path, manifest.hardware


def machine(firmware, wiring=WIRING, end_rad=1e9, body=Wheel):
    library, hardware = firmware
    boards = {
        name: NativeBoard(name, library, phase_ns=phase_ns, hardware=hardware)
        for name, phase_ns in (("LEFT", 0), ("RIGHT", 300_000))
    }
    return contextlib.closing(Machine(body(end_rad), boards, {"can1": 3_000_000}, wiring, seed=1, log="full"))


@needs_a_compiler
def test_the_loop_is_closed_from_the_sensor_by_the_firmware_to_the_wheel_and_back_to_the_bus(firmware):
    with machine(firmware) as robot:
        robot.until("angle_rad > 0.5", within="1 s")
        robot.run_for(0.1)
        shown = robot.quantities()
        frames = robot.logbook.frames()
        counts = frames["word0"][frames["identifier"] == 0x14]
        # the frame is at most two ms old, in which the wheel turns this far; the other board counts nothing
        newest = EDGES_PER_RAD * shown["angle_rad"] - 2 - EDGES_PER_RAD * 2e-3 * shown["rate_rad_per_s"]
        assert newest <= max(counts) <= EDGES_PER_RAD * shown["angle_rad"] + 1
        assert shown["rate_rad_per_s"] == FULL_RATE  # 1 V converts to more than the 600 counts of the period
        assert robot.counters()["LEFT"].slots.count >= 2 * 1000 * robot.time_s - 1


@needs_a_compiler
def test_the_same_machine_gives_the_same_bytes_however_it_is_sliced(firmware):
    with machine(firmware) as whole, machine(firmware) as sliced:
        whole.run_for("60 ms")
        for _ in range(6):
            sliced.run_for(0.01)
        assert whole.trace_digest() == sliced.trace_digest()
        whole.run_for(0.01)
        assert whole.trace_digest() != sliced.trace_digest()


@needs_a_compiler
def test_waiting_in_vain_says_what_was_nearest_and_why_it_ended(firmware):
    with machine(firmware) as robot, pytest.raises(ConditionNotMetError, match="angle_rad > 99: not within 10 ms"):
        robot.until("angle_rad > 99", within=0.01)
    with machine(firmware, end_rad=0.2) as robot:
        with pytest.raises(ConditionNotMetError, match=r"the machine stopped \(it hit its end\)"):
            robot.until("angle_rad > 99", within="1 s")
        assert robot.ended == "it hit its end"
    with (
        machine(firmware) as robot,
        pytest.raises(UserError, match="unknown quantity of the body 'angel_rad' .available: angle"),
    ):
        robot.until("angel_rad > 1")


@needs_a_compiler
@pytest.mark.parametrize(
    ("wiring", "line"),
    [
        (Wiring(can=[CanWire("MIDDLE", 1, 1)]), "unknown board 'MIDDLE' .available: LEFT, RIGHT"),
        (Wiring(can=[CanWire("LEFT", 1, 2)]), "there are buses 1 to 1"),
        (Wiring(encoders=[EncoderWire(1, "LEFT", "a", "b")], names={"LEFT": {"a": 1, "b": 2}}), "the plant has 1"),
        (Wiring(encoders=[EncoderWire(0, "LEFT", "a", "c")], names={"LEFT": {"a": 1}}), "LEFT has no 'c', but a"),
        (Wiring(bridges=[BridgeWire("LEFT", 3)]), "bridges 3: the plant has 1 of them"),
    ],
)
def test_a_wire_that_leads_nowhere_is_told_in_a_line(firmware, wiring, line):
    with pytest.raises(UserError, match=line), machine(firmware, wiring):
        pass


class NoEdges(Fault):
    """The encoder's disc does not turn."""

    mode, kinds, unit = "no_edges", ("encoder",), "edges"
    meaning = "shows no edge any more"
    parameters = (Parameter("least", "edges", 1.0, 1.0, 100.0, "steps with fewer are let through", "chosen by us"),)

    def after(self, start_ns, end_ns):
        edges = self.robot.plant.encoders[self.place.details["encoder"]].edges
        if edges.count >= self.values["least"]:
            self.note(end_ns, edges.count)
            edges.clear()


WHEEL = Place("LEFT.encoder", "encoder", "the wheel's incremental encoder", {"encoder": 0})


@needs_a_compiler
def test_a_fault_of_the_machines_own_acts_from_its_condition_on_for_its_length(firmware):
    with machine(firmware) as robot:
        fault = robot.inject(WHEEL, NoEdges, at="angle_rad > 0.5", until="+50 ms")
        robot.until("angle_rad > 3", within="1 s")
        robot.run_for(0.002)
        assert fault.acted and fault.cleared_ns > 0
        assert fault.ended_ns - fault.activated_ns == 50_000_000
        frames = robot.logbook.frames()
        missed = EDGES_PER_RAD * robot.quantities()["angle_rad"] - max(frames["word0"][frames["identifier"] == 0x14])
        # 50 ms at 20 rad/s, but for the edges of a step at either end and of the 2 ms since the newest frame
        assert missed == pytest.approx(EDGES_PER_RAD * 0.05 * FULL_RATE, abs=3)


@needs_a_compiler
@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"most": 3}, "fault LEFT.encoder:no_edges: there is no parameter 'most', but least"),
        ({"least": 0}, "fault LEFT.encoder:no_edges: least is 0, allowed are 1 to 100 edges"),
        ({"at": "hip in HI_premid"}, "it reads like 12.3 s, angle_rad > 0.3, or ended"),
    ],
)
def test_what_a_fault_does_not_take_is_told_in_a_line(firmware, asked, line):
    with machine(firmware) as robot, pytest.raises(UserError, match=line):
        robot.inject(WHEEL, NoEdges, **asked)


def test_nothing_of_ranger_is_needed():
    program = (
        "import sys, ranger_sim.harness.machine, ranger_sim.harness.faults.fault\n"
        "rooms = ('ranger_sim.boards', 'ranger_sim.datatable.generated', 'ranger_sim.sysid', 'ranger_sim.tools')\n"
        "plant = {'ranger_sim.plant', 'ranger_sim.plant.plant', 'ranger_sim.plant.bridge'}\n"
        "print([m for m in sys.modules if m.startswith(rooms)"
        " or m.startswith('ranger_sim.plant') and m not in plant])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


class Listed(Wheel):
    """It writes its sample by a slice, which a buffer refuses of a list."""

    def fill_sample(self, row):
        row[:2] = [self.angle_rad, self.rate_rad_per_s]


@needs_a_compiler
def test_a_body_in_python_may_write_its_sample_as_a_list(firmware):
    shown = []
    for body in (Wheel, Listed):
        with machine(firmware, body=body) as robot:
            robot.until("angle_rad > 0.5", within="1 s")
            shown.append((robot.quantities(), robot.trace_digest()))
    assert shown[0] == shown[1]
