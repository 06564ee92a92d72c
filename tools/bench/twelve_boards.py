"""Twelve boards on one bus of 1 Mbit/s, eleven of them with an encoder: in C, as processes, and the same in Python.

Each sends twice in five slots of 1 ms, 4,400 frames a second, and every frame interrupts all others. `ahead`: their
schedules name the tasks that send and the machine lets frames wait for slots, so that boards run ahead; no result
changes. `filtered`: their acceptance filters let only the target through, which changes the interrupts and
so the times of tasks.
"""

from __future__ import annotations

import contextlib
import functools
import os
import pathlib
import shutil
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

from ranger_sim.firmware_sim.clock import seeded_crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import CAN_RX, PIN_EDGE
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.processes.modes import InProcess, OwnProcesses
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.harness.wiring.wires import CanWire, EncoderWire, Wiring
from ranger_sim.plant.plant import Plant
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder

SOURCE = pathlib.Path(__file__).parent / "wheel"
BOARDS = 12
BIT_RATE = 1_000_000
BTR_1_MBIT = 0x001A4003
ENCODER_A, ENCODER_B = 22, 27
FIRST_STRAP = 48  # P1.16
TARGET, RATE, ANGLE = 0x10, 0x20, 0x40
PWM_PERIOD = 3000
STEP_NS = 1_000_000
WARM_UP_S = 0.2
TICK_S = 1e-3  # the shortest time between two ticks of a Linux kernel


class Wheels(Plant):
    """Eleven wheels that turn at constant rates, so that the body costs next to nothing."""

    def __init__(self) -> None:
        Plant.__init__(self, STEP_NS, samples={"time_s": "s"})
        self.encoders = [IncrementalEncoder(f"wheel {number}", 100, seed=number) for number in range(1, BOARDS)]
        self.turning = [(each, 5.0 + number) for number, each in enumerate(self.encoders)]
        for each in self.encoders:
            each.reset(0.0)

    def step(self) -> None:
        """Each wheel turns on."""
        start_ns = self.time_ns
        end_ns = start_ns + STEP_NS
        start_s, end_s = start_ns * 1e-9, end_ns * 1e-9
        for encoder, rate in self.turning:
            encoder.update(start_ns, end_ns, rate * start_s, rate, rate * end_s, rate)
        self.time_ns = end_ns

    def fill_sample(self, row: Any) -> None:
        """In the order of `samples` above."""
        row[0] = self.time_ns * 1e-9


class PythonBoard(Microcontroller):
    """The program of wheel.c in Python."""

    def __init__(self, node: int, crystal: Any, phase_ns: int, ahead: bool, filtered: bool) -> None:
        Microcontroller.__init__(self, f"B{node}", crystal=crystal)
        self.node, self.ms = node, 0
        self.edges = self.edges_before = self.rate = self.target = self.duty = self.integral = 0
        self.timer = TimerCapture(self, 0, 0xFFFF_FFFF, phase_ns=phase_ns)
        self.timer.use_channel(0, ENCODER_A)
        self.pwm = Pwm(self, period=PWM_PERIOD, phase_ns=phase_ns)
        self.can = CanController(self, 1, BTR_1_MBIT)
        if filtered:
            self.can.accept([TARGET])
        self.vic.attach(PIN_EDGE, ENCODER_A, self.on_edge, 90, slot=FIQ)
        self.vic.attach(CAN_RX, 1, self.on_frame, 180)
        rows = ((Task(self.send_rate, 260, 400),), (), (Task(self.send_angle, 260, 400),), (), ())
        every = (Task(self.observe, 900, 1200), Task(self.control, 900, 1200))
        self.start(Schedule(1000, every=every, rows=rows, transmitters=[] if ahead else None), phase_ns)

    def on_edge(self, queue: Any) -> None:
        self.edges += -1 if self.pins[ENCODER_A] == self.pins[ENCODER_B] else 1
        self.timer.clear(0x10)

    def on_frame(self, queue: Any) -> None:
        if self.can.RID == TARGET:
            self.target = self.can.RDA
        self.can.release()

    def observe(self) -> None:
        self.ms += 1
        self.rate += int((1000 * (self.edges - self.edges_before) - self.rate) / 16)
        self.edges_before = self.edges

    def control(self) -> None:
        error = self.target - self.rate
        self.integral = max(-PWM_PERIOD, min(PWM_PERIOD, self.integral + int(error / 64)))
        self.duty = max(-PWM_PERIOD, min(PWM_PERIOD, error + self.integral))
        self.pwm.write(max(self.duty, 0), max(-self.duty, 0))

    def send(self, identifier: int, word: int) -> None:
        self.can.transmit_if_free(1, identifier, 8, word & 0xFFFF_FFFF, self.ms)

    def send_rate(self) -> None:
        if self.node:
            self.send(RATE + self.node, self.rate)
        else:
            self.send(TARGET, 300 if self.ms < 1000 else 600)

    def send_angle(self) -> None:
        if self.node:
            self.send(ANGLE + self.node, self.edges)


Maker = Callable[[int, Any, int], Any]


@contextlib.contextmanager
def makers(in_c: bool, ahead: bool, filtered: bool = False) -> Iterator[Maker]:
    """What makes a board from its number, its crystal, and its power-up (ns)."""
    if not in_c:
        yield functools.partial(PythonBoard, ahead=ahead, filtered=filtered)
        return
    from ranger_sim.firmware_sim.native import build, manifest
    from ranger_sim.firmware_sim.native.native_board import NativeBoard

    with tempfile.TemporaryDirectory(prefix="ranger-bench-") as made:
        folder = pathlib.Path(made) / "wheel"
        shutil.copytree(SOURCE, folder, ignore=shutil.ignore_patterns("build"))
        with (folder / manifest.FILE).open("a", encoding="utf-8") as file:
            file.write(f"[defines]\nAHEAD = {int(ahead)}\nFILTER = {int(filtered)}\n")
        library = build.build(manifest.load(folder)).path

        def native(node: int, crystal: Any, phase_ns: int) -> Any:
            board = NativeBoard(f"B{node}", library, crystal, phase_ns)
            for bit in range(4):
                board.pins[FIRST_STRAP + bit] = node >> bit & 1
            return board

        yield native


def machine(maker: Maker, ahead: bool, mode: InProcess) -> Machine:
    """The twelve boards, each with its own crystal and power-up."""
    boards = {}
    for node in range(BOARDS):
        stream = RandomStream(1, f"board {node}")
        boards[f"B{node}"] = maker(node, seeded_crystal(stream), stream.integer(2_000_000))
    wiring = Wiring(
        can=[CanWire(name, 1, 1) for name in boards],
        encoders=[EncoderWire(node - 1, f"B{node}", "P0.22", "P0.27") for node in range(1, BOARDS)],
        receive_in_slots=tuple(boards) if ahead else (),
        names={name: {"P0.22": ENCODER_A, "P0.27": ENCODER_B} for name in boards},
    )
    return Machine(Wheels(), boards, {"can1": BIT_RATE}, wiring, seed=1, mode=mode)


def measure(
    seconds: float, in_c: bool = True, ahead: bool = False, processes: bool = False, filtered: bool = False
) -> dict:
    """All twelve for `seconds`: simulated seconds per second of processor time, and the digest of their trace.

    processes: each board in its own, whose processor time counts from the start of the process on.
    """
    mode = OwnProcesses() if processes else InProcess()
    with makers(in_c, ahead, filtered) as maker:
        with contextlib.closing(machine(maker, ahead, mode)) as twelve:
            twelve.run(StopRule(time_s=WARM_UP_S), WARM_UP_S)
            started, others = wallclock.process_cpu_s(), ended_processes_s()
            twelve.run(StopRule(time_s=WARM_UP_S + seconds), seconds)
            own = wallclock.process_cpu_s() - started
            digest = twelve.trace_digest()
        used = own + ended_processes_s() - others
    return {"figure": seconds / max(used, TICK_S), "digest": digest}


def ended_processes_s() -> float:
    """Processor time of the processes that this one has started and that have ended, s."""
    times = os.times()
    return times.children_user + times.children_system
