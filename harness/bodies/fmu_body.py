"""A functional mock-up unit (FMI 2.0 or 3.0, co-simulation) as the body of a machine; FMPy imports it.

body = FmuBody("axis.fmu", Mapping(
    drives=[Input("voltage", per_duty=24.0)],             # bridge 0
    encoders=[Encoder("angle", rate="speed")],            # encoder 0
    voltages=[Voltage("current", V_per_unit=0.1)],        # analog input 0
))
"""

import pathlib
import shutil
import weakref
from collections.abc import Mapping as Named
from typing import Any

import fmpy

from ranger_sim.foundation.user_error import ModelError, unknown
from ranger_sim.harness.bodies.mapping import Input, MappedBody, Mapping, component_of
from ranger_sim.harness.bodies.names import identifier

STEP_NS = 1_000_000
NUMBERS = ("Real", "Float64", "Float32", "Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64",
           "UInt64", "Boolean", "Enumeration")  # fmt: skip
WHOLE = {each for each in NUMBERS if "Int" in each} | {"Enumeration"}


class FmuBody(MappedBody):
    """The unit in the file, with `start` values by name. One communication step for each step of `step_ns`.

    Every output that is a number is a sample. ModelError for a file that FMPy refuses, and for an unknown variable. A
    unit that ends or refuses a step ends in `fell`. Two bodies are independent where the unit's instances are.
    """

    def __init__(
        self,
        file: str | pathlib.Path,
        mapping: Mapping,
        seed: int = 0,
        step_ns: int = STEP_NS,
        start: Named[str, float] | None = None,
    ) -> None:
        self.file = str(file)
        try:
            description = fmpy.read_model_description(self.file)
            folder = fmpy.extract(self.file)
        except Exception as error:  # FMPy raises Exception itself for what a description lacks
            raise ModelError(f"{file}: FMPy cannot read it: {' '.join(str(error).split())}") from None
        self.unpacked = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        if description.coSimulation is None:
            raise ModelError(f"{file}: not a unit for co-simulation")
        self.version = description.fmiVersion[0]
        self.variables = {each.name: each for each in description.modelVariables if each.type in NUMBERS}
        self.outputs = [each for each in self.variables.values() if each.causality == "output" and not each.dimensions]
        self.inputs: list[tuple[Any, Any]] = [(self._input(each), each) for each in mapping.drives]
        self.turning = [(self._output(each.joint), self._output(each.rate or each.joint)) for each in mapping.encoders]
        for wire, encoder in zip(mapping.encoders, self.turning, strict=True):
            if encoder[0] is encoder[1]:
                raise ModelError(
                    f"{file}: encoder {wire.joint}: name its derivative, Encoder({wire.joint!r}, rate=...)"
                )
        self.sources = []
        wires: list[Any] = [*mapping.voltages, *mapping.words]
        for each in wires:
            component_of(self.file, each, 1)
            self.sources.append(self._output(each.source))
        try:
            self.unit = fmpy.instantiate_fmu(folder, description, fmi_type="CoSimulation")
            if self.version == "2":
                self.unit.setupExperiment(startTime=0.0)
            for name, value in (start or {}).items():
                self._set(self._named(name), value)
            self.unit.enterInitializationMode()
            self.unit.exitInitializationMode()
        except ModelError:
            raise
        except Exception as error:  # a platform without a binary, a start value beyond its limits
            raise ModelError(f"{file}: the unit cannot be started: {' '.join(str(error).split())}") from None
        samples = {identifier(each.name): each.unit or "1" for each in self.outputs}
        super().__init__(self.file, step_ns, mapping, samples, seed)
        self.begin()

    def _named(self, name: str) -> Any:
        if name not in self.variables:
            raise ModelError(f"{self.file}: {unknown('variable', name, self.variables)}")
        return self.variables[name]

    def _input(self, drive: Any) -> Any:
        if not isinstance(drive, Input):
            raise ModelError(f"{self.file}: {drive!r} is not an Input")
        known = [each.name for each in self.variables.values() if each.causality == "input"]
        if drive.variable not in known:
            raise ModelError(f"{self.file}: {unknown('input', drive.variable, known)}")
        return self.variables[drive.variable]

    def _output(self, name: str) -> Any:
        known = [each.name for each in self.outputs]
        if name not in known:
            raise ModelError(f"{self.file}: {unknown('output', name, known)}")
        return self.variables[name]

    def _kind(self, variable: Any) -> str:
        """The type by which the interface sets and gets a variable."""
        if variable.type == "Enumeration":
            return "Integer" if self.version == "2" else "Int64"
        return str(variable.type)

    def _set(self, variable: Any, value: float) -> None:
        kind = self._kind(variable)
        number = bool(value) if kind == "Boolean" else round(value) if variable.type in WHOLE else float(value)
        getattr(self.unit, f"set{kind}")([variable.valueReference], [number])

    def _get(self, variable: Any) -> float:
        return float(getattr(self.unit, f"get{self._kind(variable)}")([variable.valueReference])[0])

    def advance(self) -> None:
        """Set the inputs, then let the unit pass one communication step."""
        try:
            for (variable, wire), bridge in zip(self.inputs, self.bridges, strict=True):
                self._set(variable, min(wire.high, max(wire.low, wire.per_duty * bridge.duty)))
            ended = self.unit.doStep(
                currentCommunicationPoint=self.time_ns * 1e-9, communicationStepSize=self.step_ns * 1e-9
            )
        except Exception as error:  # FMPy's FMICallException, and what a unit in Python raises
            self.fell, self.fall_cause = True, f"the unit ended: {' '.join(str(error).split())}"
        else:
            if self.version == "3" and ended[1]:
                self.fell, self.fall_cause = True, "the unit asked for the end"

    def angles(self) -> list[tuple[float, float]]:
        return [(self._get(angle), self._get(rate)) for angle, rate in self.turning]

    def readings(self) -> list[float]:
        return [self._get(each) for each in self.sources]

    def fill_sample(self, row) -> None:  # type: ignore[no-untyped-def]
        row[: len(self.outputs)] = [self._get(each) for each in self.outputs]
