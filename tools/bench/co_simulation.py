"""The unit for co-simulation, driven through its C interface with arrays, as an importer in C would drive it."""

from __future__ import annotations

import ctypes
import pathlib
import tempfile
import zipfile
from typing import Any
from xml.etree import ElementTree

from ranger_sim.foundation import wallclock
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.fmu.body import given_of
from ranger_sim.tools.fmu.command import PLATFORMS, export
from ranger_sim.tools.fmu.stepper import STEP_S

TICK_S = 1e-3  # the shortest time between two ticks of a Linux kernel
C_TYPES: dict[str, Any] = {"Float64": ctypes.c_double, "Int64": ctypes.c_int64, "Boolean": ctypes.c_bool}
NO = ctypes.c_bool(False)
ZERO = ctypes.c_double(0.0)
Log = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Block:
    """Values of one type that move together; `move` gets them, or sets them."""

    def __init__(self, unit: Unit, verb: str, kind: str, references: list[int]) -> None:
        self.values = (C_TYPES[kind] * len(references))()
        size = ctypes.c_size_t(len(references))
        numbers = (ctypes.c_uint32 * len(references))(*references)
        self.function = getattr(unit.library, f"fmi3{verb}{kind}")
        self.arguments = (unit.instance, numbers, size, self.values, size)

    def move(self) -> None:
        """One call for all of them. RuntimeError for any status but OK."""
        if self.function(*self.arguments) != 0:
            raise RuntimeError(f"{self.function.__name__} failed")


class Unit:
    """One instance of the unit whose archive is unpacked in `folder`, initialized at time 0."""

    def __init__(self, folder: pathlib.Path) -> None:
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.variables = {each.attrib["name"]: each for each in root.iterfind("ModelVariables/*")}
        self.library = ctypes.CDLL(str(folder / "binaries" / PLATFORMS[0] / f"{root.attrib['modelName']}.so"))
        self.log = Log(lambda *_: None)
        make = self.library.fmi3InstantiateCoSimulation
        make.restype = ctypes.c_void_p
        token, resources = root.attrib["instantiationToken"].encode(), f"{folder / 'resources'}/".encode()
        none = ctypes.c_size_t(0)
        self.instance = ctypes.c_void_p(
            make(b"one", token, resources, NO, NO, NO, NO, None, none, None, self.log, None)
        )
        self.call("fmi3EnterInitializationMode", NO, ZERO, ZERO, NO, ZERO)
        self.call("fmi3ExitInitializationMode")
        flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
        self.time_s, self.length_s = ctypes.c_double(), ctypes.c_double()
        results = (*flags, ctypes.byref(ctypes.c_double()))
        self.arguments = (self.instance, self.time_s, self.length_s, NO, *results)
        self.do_step = self.library.fmi3DoStep

    def call(self, function: str, *arguments: Any) -> None:
        """Call a function of the standard. RuntimeError for any status but OK."""
        status = getattr(self.library, function)(self.instance, *arguments)
        if status != 0:
            raise RuntimeError(f"{function} returned status {status}")

    def blocks(self, verb: str, names: list[str]) -> list[Block]:
        """The variables of these names, in one block for each type; `verb`: Get or Set."""
        by_type: dict[str, list[int]] = {}
        for name in names:
            by_type.setdefault(self.variables[name].tag, []).append(int(self.variables[name].attrib["valueReference"]))
        return [Block(self, verb, kind, references) for kind, references in by_type.items()]

    def step(self, time_s: float, length_s: float) -> None:
        """One communication step. RuntimeError for any status but OK."""
        self.time_s.value, self.length_s.value = time_s, length_s
        if self.do_step(*self.arguments) != 0:
            raise RuntimeError(f"fmi3DoStep failed at {time_s} s")


def measure(seconds: float, plant_steps: int, exchanged: bool = True) -> dict:
    """The held body for `seconds`, `plant_steps` in a communication step; every input set and every output read.

    `exchanged`: in each communication step; else nothing is set or read.
    """
    with tempfile.TemporaryDirectory(prefix="ranger-bench-") as made:
        folder = pathlib.Path(made)
        export(folder / "body.fmu", given_of(Scenario()))
        with zipfile.ZipFile(folder / "body.fmu") as archive:
            archive.extractall(folder)
        unit = Unit(folder)
        by_causality: dict[str, list[str]] = {"input": [], "output": []}
        for name, each in unit.variables.items():
            by_causality.get(each.attrib["causality"], []).append(name)
        start = unit.blocks("Get", by_causality["input"])
        inputs, outputs = unit.blocks("Set", by_causality["input"]), unit.blocks("Get", by_causality["output"])
        for old, new in zip(start, inputs, strict=True):
            old.move()
            new.values[:] = old.values[:]
        moved_before, moved_after = (inputs, outputs) if exchanged else ([], [])
        length_s = plant_steps * STEP_S
        count = max(1, round(seconds / length_s))
        started = wallclock.process_cpu_s()
        for number in range(count):
            for block in moved_before:
                block.move()
            unit.step(number * length_s, length_s)
            for block in moved_after:
                block.move()
        used = wallclock.process_cpu_s() - started
    return {"figure": count * length_s / max(used, TICK_S), "values": sum(len(each.values) for each in outputs)}
