"""Bodies by name: the robot that walks. A body is a TOML file of plant/bodies, or one of a user.

    title = "..."            description = "..."          base = "appendix"
    [parameters]             what differs from the base, by key
    [sources]                for every key of [parameters] where its value comes from, in a sentence

Without a base a file uses the defaults of the tables. Keys are the fields of `BodyParameters` (without the slope,
which a scenario has) and those of `ELECTRIC` below. All faults of a file are reported in one UserError of one line:
file, key, value, limit.
"""

import dataclasses
import functools
import pathlib
from collections.abc import Iterator
from typing import Any

from ranger_sim.foundation import toml_file
from ranger_sim.foundation.user_error import ModelError, UserError, unknown
from ranger_sim.plant.electrics.electrics import ElectricsParameters
from ranger_sim.plant.electrics.motor_parameters import GATE_SCHEMES, MotorParameters
from ranger_sim.plant.mechanics.parameters import BodyParameters, fault_of

FOLDER = pathlib.Path(__file__).parent / "bodies"
MOTORS = ("hip", "outer_ankle", "inner_ankle")
GATES = (*MOTORS, "steering")
TEXTS = ("title", "description", "base")


@dataclasses.dataclass(frozen=True)
class Key:
    """One number of a body file as the tables describe it. `metadata`: unit, limits or allowed values, source."""

    name: str
    default: Any
    metadata: Any

    @property
    def limits(self) -> str:
        """The allowed values, as text."""
        if "allowed" in self.metadata:
            return ", ".join(map(str, self.metadata["allowed"]))
        low, high = self.metadata["limits"]
        return f"{low:g} to {high:g}"


# Of MotorParameters, for each of the motors at hip and ankles: field, unit, limits, source.
MOTOR_KEYS = (
    ("resistance_ohm", "ohm", (0.01, 1000.0), "R, winding and brushes at 25 C (robot.md P3)"),
    ("contact_drop_V", "V", (0.0, 10.0), "V_c, of the brushes (appendix 8.3.1)"),
    ("torque_constant_Nm_per_A", "N m/A", (1e-4, 10.0), "K (appendix 8.3.2)"),
    ("load_friction", "1", (0.0, 0.9), "mu, of the gearhead (appendix table 3)"),
    ("constant_friction_Nm", "N m", (0.0, 10.0), "C_0 at the joint (robot.md P3)"),
    ("viscous_friction_Nms", "N m s/rad", (0.0, 10.0), "C_1 at the joint (robot.md P3)"),
)
# Of MotorParameters as well, for the steering's motor too.
GATE_KEYS = (
    ("gate_power_W", {"unit": "W", "limits": (0.0, 10.0)}, "of a board's MOSFET drive at 30 V, 100 kHz (appendix 3.7)"),
    ("gate_scheme", {"unit": "", "allowed": GATE_SCHEMES}, "when that is drawn: chosen by us, see motor_parameters.py"),
)
# Of ElectricsParameters: the part of the feet's sensors that belongs to the feet.
SENSOR_KEYS = (
    ("foot_rise_time_constant_s", "s", (1e-4, 1.0), "of the gap's closing; chosen by us: see foot_sensor.py"),
    ("foot_share", "1", (0.0, 1.0), "closed by the blow itself; chosen by us: see foot_sensor.py"),
    ("foot_full_load_N", "N", (0.1, 1000.0), "that closes the gap; chosen by us: half of the weight"),
)


@functools.cache
def keys() -> dict[str, Key]:
    """Every key that a body file may have, by name, in the order in which they are shown."""
    found = {
        field.name: Key(field.name, field.default, field.metadata)
        for field in dataclasses.fields(BodyParameters)
        if field.name != "slope_rad"
    }
    electrics = ElectricsParameters()
    for motor in MOTORS:
        for name, unit, limits, source in MOTOR_KEYS:
            key = f"{motor}_{name}"
            metadata = {"unit": unit, "limits": limits, "source": source}
            found[key] = Key(key, getattr(getattr(electrics, motor), name), metadata)
    for motor in GATES:
        for name, metadata, source in GATE_KEYS:
            key = f"{motor}_{name}"
            found[key] = Key(key, getattr(getattr(electrics, motor), name), {**metadata, "source": source})
    for name, unit, limits, source in SENSOR_KEYS:
        metadata = {"unit": unit, "limits": limits, "source": source}
        found[name] = Key(name, getattr(electrics, name), metadata)
    return found


@dataclasses.dataclass(frozen=True)
class BodyFile:
    """A body: `values` of all keys, `changes` against its base, `sources` of all keys, in words."""

    name: str
    path: str
    title: str
    description: str
    base: str | None
    values: dict[str, Any]
    changes: dict[str, Any]
    sources: dict[str, str]
    parameters: BodyParameters  # the mechanical robot

    @property
    def electrics(self) -> ElectricsParameters:
        """Motors and sensors; battery and electronics are those of every robot."""
        whole = ElectricsParameters()
        changes: dict[str, Any] = {motor: self._motor(motor, getattr(whole, motor)) for motor in MOTORS}
        changes["steering"] = dataclasses.replace(whole.steering, **self._gates("steering"))
        changes.update({name: self.values[name] for name, _, _, _ in SENSOR_KEYS})
        return dataclasses.replace(whole, **changes)

    def _motor(self, motor: str, whole: MotorParameters) -> MotorParameters:
        gear = self.values["hip_gear" if motor == "hip" else "ankle_gear"]
        return dataclasses.replace(
            whole,
            gear=gear,
            rotor_inertia_kg_m2=self.values["motor_inertia_kg_m2"],
            **{name: self.values[f"{motor}_{name}"] for name, _, _, _ in MOTOR_KEYS},
            **self._gates(motor),
        )

    def _gates(self, motor: str) -> dict[str, Any]:
        return {name: self.values[f"{motor}_{name}"] for name, _, _ in GATE_KEYS}


def available() -> tuple[str, ...]:
    """Names of the bodies that come with the project."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load(name: str | pathlib.Path) -> BodyFile:
    """The body `name`, or the file at that path when it ends in .toml. UserError as described in the module
    docstring."""
    return _load(str(name), ())


def _load(name: str, users: tuple[str, ...]) -> BodyFile:
    path = pathlib.Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if not name.endswith(".toml") and name not in available():
        raise ModelError(f"{unknown('body', str(name), available())}, or give a .toml file")
    data = toml_file.load(path, "body file")
    base_name = data.get("base")
    if isinstance(base_name, str) and (base_name in users or base_name == path.stem):
        raise ModelError(f"{path}: base {base_name!r} leads back to this body")
    wrong = list(_faults(data))
    if wrong:
        raise ModelError(f"{path}: " + "; ".join(wrong))
    base = _load(base_name, (*users, path.stem)) if base_name is not None else None
    changes = {
        key: float(value) if isinstance(keys()[key].default, float) else value
        for key, value in data.get("parameters", {}).items()
    }
    values = dict(base.values) if base is not None else {key.name: key.default for key in keys().values()}
    sources = dict(base.sources) if base is not None else {key.name: key.metadata["source"] for key in keys().values()}
    values.update(changes)
    sources.update({key: f"{text} ({path.stem})" for key, text in data.get("sources", {}).items()})
    names = {field.name for field in dataclasses.fields(BodyParameters)}
    try:
        parameters = BodyParameters(**{name: value for name, value in values.items() if name in names})
    except UserError as error:  # values that contradict each other
        raise ModelError(f"{path}: {error}") from None
    return BodyFile(
        path.stem,
        str(path),
        data.get("title", path.stem),
        data.get("description", ""),
        base_name,
        values,
        changes,
        sources,
        parameters,
    )


def _faults(data: dict[str, Any]) -> Iterator[str]:
    """All faults of a file's contents, one text each."""
    for key, value in data.items():
        if key not in (*TEXTS, "parameters", "sources"):
            yield f"unknown key {key!r}; allowed are {', '.join((*TEXTS, '[parameters]', '[sources]'))}"
        elif key in TEXTS and not isinstance(value, str):
            yield f"{key} = {value!r}: text is expected"
        elif key not in TEXTS and not isinstance(value, dict):
            yield f"{key} = {value!r}: a table [{key}] is expected"
    changes, sources = data.get("parameters", {}), data.get("sources", {})
    if not isinstance(changes, dict) or not isinstance(sources, dict):
        return
    for key, value in changes.items():
        if key not in keys():
            yield f"[parameters] {key} = {value!r}: no such parameter (`ranger-sim body show appendix` lists them)"
        elif fault := fault_of(keys()[key], value):
            yield f"[parameters] {fault}"
        if key not in sources:
            yield f"[sources] lacks {key}: say where its value comes from"
    for key, text in sources.items():
        if key not in changes:
            yield f"[sources] {key}: no such entry in [parameters]"
        elif not isinstance(text, str) or not text.strip():
            yield f"[sources] {key} = {text!r}: a sentence is expected"
