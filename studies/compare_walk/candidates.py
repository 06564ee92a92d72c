"""Candidate causes of a wrong emulated walk: numbers of body, sensors, floor and controller.

Identifiers are the catalogue's (`ranger-sim causes`). A candidate is one number that is added somewhere; its value 0 is
the present robot. Steps and limits are chosen by us: a step moves the gait by a few times the scatter of seeds, a
limit is the largest error that a measurement by hand would have missed.
"""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Candidate:
    """cause: of the catalogue; at: where. kind and keys: how it gets into a walk.

    kind "body": added to these keys of the body's file; "term": value of a sensor_offset at this place; "floor": slope
    of the scenario; "firmware": added to this parameter of the controller.
    """

    cause: str
    at: str
    unit: str
    kind: str
    keys: tuple[str, ...]
    step: float
    limit: float
    meaning: str

    @property
    def name(self) -> str:
        return f"{self.cause} at {self.at}"


def _both(name: str) -> tuple[str, str]:
    return (f"outer_{name}", f"inner_{name}")


CANDIDATES = (
    # cause, at, unit, kind, keys, step, limit, meaning
    Candidate("sensor_offset", "leg angle", "rad", "term", ("roll",), 0.01, 0.15,
              "a positive one shows the lean too small"),
    Candidate("sensor_offset", "hip angle", "rad", "term", ("hip_absolute",), 0.01, 0.1, "zero of the hip's encoder"),
    Candidate("sensor_offset", "outer ankle", "rad", "term", ("outer_ankle_absolute",), 0.05, 0.3,
              "zero of its encoder"),
    Candidate("sensor_offset", "inner ankle", "rad", "term", ("inner_ankle_absolute",), 0.05, 0.3,
              "zero of its encoder"),
    Candidate("geometry", "foot height", "m", "body", _both("ankle_offset_m"), 0.004, 0.05, "all ankles are lower"),
    Candidate("geometry", "inner foot height", "m", "body", ("inner_ankle_offset_m",), 0.0007, 0.03,
              "inner legs are shorter"),
    Candidate("geometry", "heel", "rad", "body", ("arc_heel_rad",), 0.02, 0.08,
              "the arc ends nearer to the sweet spot"),
    Candidate("inertia", "centre of mass", "kg m", "body", _both("mass_offset_kg_m"), 0.005, 0.1,
              "w m of all legs: ahead"),
    Candidate("leg_asymmetry", "centre of mass", "kg m", "body", ("inner_mass_offset_kg_m",), 0.01, 0.1,
              "w m of the inner legs alone"),
    Candidate("inertia", "mass moment", "kg m", "body", _both("mass_moment_kg_m"), 0.05, 0.2, "c m of all legs"),
    Candidate("inertia", "hip inertia", "kg m^2", "body", _both("hip_inertia_kg_m2"), 0.04, 0.2,
              "of all legs about the hip"),
    Candidate("spring_value", "hip", "N m/rad", "body", ("hip_spring_Nm_per_rad",), 0.8, 4.0, "stiffness"),
    Candidate("spring_value", "ankle cable", "N m/rad", "body", ("ankle_spring_Nm_per_rad",), 3.0, 10.0, "stiffness"),
    Candidate("coulomb_friction", "hip", "N m", "body", ("hip_constant_friction_Nm",), 0.08, 1.0, "constant friction"),
    Candidate("coulomb_friction", "ankles", "N m", "body", _both("ankle_constant_friction_Nm"), 0.04, 0.5,
              "constant friction"),
    Candidate("contact_loss", "feet", "N m s/rad", "body", _both("rolling_friction_Nms"), 0.04, 0.5,
              "rolling friction"),
    Candidate("sensor_lag", "foot sensors", "s", "body", ("foot_rise_time_constant_s",), 0.008, 0.1,
              "contact is reported late"),
    Candidate("floor", "floor", "rad", "floor", (), 0.003, 0.03, "slopes downhill"),
    Candidate("firmware_parameter", "hip hold", "rad", "firmware", ("HD_H_HOLD",), 0.03, 0.3,
              "hip angle held in a push"),
    Candidate("firmware_parameter", "hip weight", "N m", "firmware", ("HD_H_GRAVITY",), 2.0, 8.0,
              "of the swing leg, made up for"),
    Candidate("firmware_parameter", "push target", "rad", "firmware", ("HD_F_PUSH",), 0.1, 0.8,
              "foot angle of the push"),
    Candidate("firmware_parameter", "contact level", "counts", "firmware", ("HD_CONTACT",), 1500.0, 10000.0,
              "that means contact"),
)  # fmt: skip
BY_NAME = {each.name: each for each in CANDIDATES}
