"""The causes that a walking log can show: wrong numbers of body and sensors, and additional effects."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values
from ranger_sim.sysid.machines.walk.recording import (
    GYRO_BIAS_REACH_RAD_S,
    SIGN_RAD_S,
    Rows,
    WalkRecording,
)

Shape = Mapping[str, float]
Change = tuple[tuple[str, float], ...]  # fields of Numbers with weights
HEAT_TIMES_S = (3.0, 10.0, 30.0, 100.0)
SPEEDS_RAD_S = (0.1, 0.2, 0.4, 0.8, 1.6)
PLAY_NM = (0.01, 0.03, 0.1)
EITHER_SIGN = ("mass_offset_outer_kg_m", "mass_offset_inner_kg_m")


def _both(name: str) -> Change:
    """A number of both legs alike."""
    outer, inner = name.format("outer"), name.format("inner")
    return ((outer, 1.0), (inner, 1.0))


def _apart(name: str) -> Change:
    """A number that is larger at the outer leg by as much as it is smaller at the inner leg."""
    return ((name.format("outer"), 1.0), (name.format("inner"), -1.0))


# cause, place, coefficient, subsystem, changed fields, meaning
NUMBERS: tuple[tuple[str, str, str, str, Change, str], ...] = (
    ("geometry", "feet", "foot_height_m", "geometry", _both("ankle_offset_{}_m"),
     "ankle to the sole's centre: a larger one lowers the ankle"),
    ("geometry", "outer_feet", "foot_height_m", "geometry", (("ankle_offset_outer_m", 1.0),), "the outer feet alone"),
    ("geometry", "inner_feet", "foot_height_m", "geometry", (("ankle_offset_inner_m", 1.0),), "the inner feet alone"),
    ("geometry", "soles", "radius_m", "geometry", _both("foot_radius_{}_m"), "radius of the soles' arc"),
    ("geometry", "legs", "length_m", "geometry", (("leg_length_m", 1.0),), "hip to ankle"),
    ("inertia", "body", "mass_kg", "mechanical", (("total_mass_kg", 1.0),), "total mass"),
    ("inertia", "legs", "moment_kg_m", "mechanical", _both("mass_moment_{}_kg_m"), "centre of mass below the hip"),
    ("inertia", "legs", "offset_kg_m", "mechanical", _both("mass_offset_{}_kg_m"), "centre of mass ahead of the legs"),
    ("inertia", "legs", "inertia_kg_m2", "mechanical", _both("hip_inertia_{}_kg_m2"), "moment of inertia at the hip"),
    ("inertia", "outer_leg", "inertia_kg_m2", "mechanical", (("hip_inertia_outer_kg_m2", 1.0),), "of the outer leg"),
    ("inertia", "inner_leg", "inertia_kg_m2", "mechanical", (("hip_inertia_inner_kg_m2", 1.0),), "of the inner leg"),
    ("leg_asymmetry", "legs", "offset_kg_m", "mechanical", _apart("mass_offset_{}_kg_m"), "one leads, one trails"),
    ("leg_asymmetry", "legs", "moment_kg_m", "mechanical", _apart("mass_moment_{}_kg_m"), "one is heavier below"),
    ("spring_value", "hip_spring", "stiffness_Nm_per_rad", "mechanical", (("hip_spring_Nm_per_rad", 1.0),), ""),
    ("spring_value", "cables", "stiffness_Nm_per_rad", "transmission", _both("cable_{}_Nm_per_rad"), "of both ankles"),
    ("spring_value", "outer_cable", "stiffness_Nm_per_rad", "transmission", (("cable_outer_Nm_per_rad", 1.0),), ""),
    ("spring_value", "inner_cable", "stiffness_Nm_per_rad", "transmission", (("cable_inner_Nm_per_rad", 1.0),), ""),
    ("spring_value", "ankle_return", "stiffness_Nm_per_rad", "mechanical", (("ankle_return_Nm_per_rad", 1.0),), ""),
    ("hip_spring_bend", "hip_spring", "cubic_Nm_per_rad3", "mechanical",
     (("hip_spring_cubic_Nm_per_rad3", 1.0),), "the hip spring is not linear"),
    ("contact_loss", "feet", "rolling_Nms", "mechanical", _both("rolling_{}_Nms"), "rolling resistance of the feet"),
    ("floor", "floor", "slope_rad", "floor", (("slope_rad", 1.0),), "positive downhill"),
    ("sensor_offset", "hip_angle_rad", "offset_rad", "sensor", (("hip_zero_rad", 1.0),), ""),
    ("sensor_scale", "hip_angle_rad", "change", "sensor", (("hip_scale", 1.0),), ""),
    ("sensor_offset", "outer_ankle_angle_rad", "offset_rad", "sensor", (("ankle_zero_outer_rad", 1.0),), ""),
    ("sensor_offset", "inner_ankle_angle_rad", "offset_rad", "sensor", (("ankle_zero_inner_rad", 1.0),), ""),
    ("sensor_scale", "gyro", "change", "sensor", (("leg_scale", 1.0),), ""),
)  # fmt: skip
ABSOLUTE_LEAN = ("sensor_offset", "outer_leg_angle_rad", "offset_rad", "sensor", (("leg_zero_rad", 1.0),), "")


def made(recordings: Sequence[WalkRecording]) -> list[Effect]:
    """All causes that the recordings' equations can show."""
    there = {name for recording in recordings for name in recording.equations}
    out = []
    if there & {"floor, outer", "floor, inner", "hip"}:
        numbers = [*NUMBERS]
        if all("outer_leg_angle_rad" in each.table for each in recordings):
            numbers.append(ABSOLUTE_LEAN)
        out += [
            Effect(cause, at, part, (name,), [{}], _columns_of(change), _keeps_sign(change, recordings[0]), meaning)
            for cause, at, name, part, change, meaning in numbers
        ]
    if any(abs(each.gyro_bias_rad_s) > GYRO_BIAS_REACH_RAD_S for each in recordings) and "closure" in there:
        out.append(
            Effect("sensor_offset", "gyro", "sensor", ("offset_rad_s",), [{}], _closure, meaning="a rate at rest")
        )
    if "hip" in there:
        out += _hip()
    for leg in ("outer", "inner"):
        if f"{leg} foot" in there:
            out.append(_play(leg))
    for motor in ("hip", "outer_ankle", "inner_ankle"):
        label = motor.replace("_", " ")
        if f"{label} drive" in there or f"{label} winding" in there:
            out += _electric(motor, label)
    return out


def _columns_of(change: Change) -> Callable[[Recording, Shape, Values], Columns]:
    def columns(recording: Recording, _: Shape, __: Values) -> Columns:
        assert isinstance(recording, WalkRecording)
        found = {}
        for rows in recording.rows:
            if not _depends(rows):
                continue
            column = recording.slope(rows.name, change)
            if np.any(column):
                found[rows.name] = column[:, None]
        return found

    return columns


def _keeps_sign(change: Change, recording: WalkRecording) -> Callable[[Mapping[str, float]], bool]:
    """False for a change that makes a length, weight, inertia or stiffness negative."""
    known = [(getattr(recording.numbers, field), weight) for field, weight in change if field not in EITHER_SIGN]

    def admissible(found: Mapping[str, float]) -> bool:
        (size,) = found.values()
        return all(value <= 0.0 or value + weight * size > 0.0 for value, weight in known)

    return admissible


def _depends(rows: Rows) -> bool:
    """True for the equations that depend on `Numbers`."""
    return rows.letter == "M"


def _closure(recording: Recording, _: Shape, __: Values) -> Columns:
    return {"closure": np.ones((len(recording.table), 1))}


def _hip() -> list[Effect]:
    M = "mechanical"

    def of(make: Callable[[Mapping[str, Array], Shape], Array]) -> Callable[[Recording, Shape, Values], Columns]:
        return lambda r, shape, _: {"hip": make(r.signals, shape)[:, None]} if "hip" in r.equations else {}

    def sign(s: Mapping[str, Array]) -> Array:
        return np.tanh(s["hip_rate"] / SIGN_RAD_S)

    speeds = [{"speed_rad_s": each} for each in SPEEDS_RAD_S]
    return [
        Effect("stribeck", "hip_motor", M, ("excess_Nm",), speeds,
               of(lambda s, p: -sign(s) * np.exp(-((s["hip_rate"] / p["speed_rad_s"]) ** 2))),
               lambda found: found["excess_Nm"] > 0.0, "friction that is larger at low speed"),
        Effect("drag", "hip_motor", M, ("quadratic_Nms2",), [{}],
               of(lambda s, p: -s["hip_rate"] * np.abs(s["hip_rate"])), lambda found: found["quadratic_Nms2"] > 0.0),
        Effect("load_friction", "hip_motor", M, ("per_A",), [{}],
               of(lambda s, p: -np.abs(s["hip_current"]) * sign(s)), meaning="friction that grows with the current"),
    ]  # fmt: skip


def _play(leg: str) -> Effect:
    """A gap between motor and joint: the joint lags by half of it, on the side that the load presses to."""
    equation = f"{leg} foot"

    def columns(recording: Recording, shape: Shape, _: Values) -> Columns:
        assert isinstance(recording, WalkRecording)
        if equation not in recording.equations:
            return {}
        stiffness = (
            recording.numbers.cable_outer_Nm_per_rad if leg == "outer" else recording.numbers.cable_inner_Nm_per_rad
        )
        return {equation: -stiffness * np.tanh(recording.loads[equation] / shape["torque_Nm"])[:, None]}

    return Effect(
        "cable_backlash",
        f"{leg}_cable",
        "transmission",
        ("half_gap_rad",),
        [{"torque_Nm": each} for each in PLAY_NM],
        columns,
        lambda found: found["half_gap_rad"] > 0.0,
        "a gap between motor and joint",
    )


def _electric(motor: str, label: str) -> list[Effect]:
    """A drive's power and a winding's voltage in addition to resistance, drop and generator."""

    def warm(recording: Recording, shape: Shape, _: Values) -> Columns:
        current = recording.table[f"{motor}_current_A"]
        heat = signals.lagged(recording.table, current**2, shape["time_constant_s"])
        found = {}
        if f"{label} drive" in recording.equations:
            found[f"{label} drive"] = (current**2 * heat)[:, None]
        if f"{label} winding" in recording.equations:
            found[f"{label} winding"] = (current * heat)[:, None]
        return found

    times = [{"time_constant_s": each} for each in HEAT_TIMES_S]
    place = f"{motor.removesuffix('_ankle')}_motor"
    return [Effect("resistance_temperature", place, "electrical", ("ohm_per_heat",), times, warm)]
