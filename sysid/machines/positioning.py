"""A mass on a guide, driven by a motor under a position controller (EMPS: Janot, Gautier, Brunot 2019).

    force   F = M a + F_v v + F_c sgn v + F_0        F = the drive's gain times the voltage command

Only the position is measured: the equation is in its weak form (`sysid/weak_form.py`), both sides under a triangle, and
the voltage on straight lines, smooth or held between rows, as the recording shows. Published for this machine:
M 95.1089 kg, F_v 203.50 N s/m, F_c 20.39 N, relative error of the force 4.08 % on run 1 and 5.98 % on run 2.
The pulses of the second run come through the drive: the voltage has them already (added once more, or taken off, the
error of that run rises from 4.6 to 6.6 %).
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, cast

import numpy as np

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machine import Columns, Effect, Equation, Known, Quantity, Recording, Values
from ranger_sim.sysid.machines.forms import Made, bristles
from ranger_sim.sysid.weak_form import WeakForm, way_between_rows

FORCE_N_PER_V = 35.15065188  # the drive's gain, published with the data
FINE_S = 0.0015  # Gaussian of the speed that finds the fastest one: -3 dB at 88 Hz, far above the controller's motion
HALF_S = 0.0037  # of the triangle: as wide as that Gaussian
NEAR_STANDSTILL = 0.01  # of the fastest speed: about it the sign of a smooth friction turns
SLOWEST = 0.025  # of the fastest speed: below it friction may be anything up to its limit, and rows do not count
DELAYS_S = (0.0, -0.1, -0.06, -0.04, -0.03, -0.02, -0.01, 0.01, 0.02, 0.03, 0.04, 0.06, 0.1)  # 0: small ones
PITCHES_M = tuple(round(0.0005 * n, 4) for n in range(2, 61))

Shape = Mapping[str, float]


@dataclasses.dataclass
class GuideRecording(Recording):
    """A recording with the means that its equation is made of: a candidate's columns pass through the same ones."""

    weak: WeakForm = dataclasses.field(kw_only=True)
    made: dict[tuple, Columns] = dataclasses.field(default_factory=dict)  # columns of effects, by effect and shape


class Positioning:
    """force_N_per_V: gain of the drive."""

    name = "positioning"
    quantities = (
        Quantity("position_m", "m", "of the mass"),
        Quantity("voltage_V", "V", "command to the drive"),
    )
    parameters = (
        Known("mass_kg", "kg", 95.1089, 0.0, 1e4, "of carriage, screw and rotor together"),
        Known("viscous_friction_Ns_per_m", "N s/m", 203.5, 0.0, 1e5, "of the guide"),
        Known("coulomb_friction_N", "N", 20.39, 0.0, 1e4, "of the guide"),
        Known("force_offset_N", "N", 0.0, -1e3, 1e3, "of drive and guide"),
    )

    labels: ClassVar = {"v": "speed, m/s", "a": "acceleration, m/s^2", "x": "position, m", "t": "time, s"}

    def __init__(self, force_N_per_V: float = FORCE_N_PER_V) -> None:
        self.force_N_per_V = force_N_per_V

    def prepare(self, table: Table) -> Recording:
        """Signals and the equation of one recording."""
        missing = [each.name for each in self.quantities if each.needed and each.name not in table]
        if missing:
            raise ModelError(
                f"{table.name}: {self.name} needs {', '.join(missing)}; there are {', '.join(table.columns)}"
            )
        table = signals.uniform(table)
        q = table["position_m"]
        top = float(np.quantile(np.abs(signals.derivative(table, q, FINE_S / table.step_s)), 0.98))
        if top <= 0.0:
            raise ModelError(f"{table.name}: position_m does not move")
        weak = WeakForm(table, q, HALF_S)
        v = weak.of_rate()
        sign = weak.of_rate(lambda rate: np.tanh(rate / (0.25 * NEAR_STANDSTILL * top)))
        s = {"x": q, "v": v, "t": table.elapsed_s, "a": weak.acceleration, "sgn_v": sign}
        columns = {
            "mass_kg": s["a"],
            "viscous_friction_Ns_per_m": v,
            "coulomb_friction_N": sign,
            "force_offset_N": np.ones_like(v),
        }
        valid = (np.abs(v) > SLOWEST * top) & weak.complete & ~weak.turning(v)
        force = self.force_N_per_V * table["voltage_V"]
        others = [*columns.values(), weak.of_rate(np.abs), weak.of_rate(lambda rate: rate * np.abs(rate))]
        way = way_between_rows(weak, force, np.column_stack(others), valid)
        s["F"] = way.mean
        s["dF"] = signals.per_run(table, lambda part: np.gradient(part, table.step_s), s["F"])
        equation = Equation("force", "M", "mechanical", "N", s["F"], columns, valid & way.sure)
        fast = np.abs(v) > 0.2 * top
        regimes = {"forward": v > 0.0, "backward": v < 0.0, "low speed": ~fast, "fast": fast}
        return GuideRecording(table, s, {"force": equation}, regimes, between_rows={"voltage_V": way.name}, weak=weak)

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which the force is looked at without a cause in mind."""
        return {"force": {name: recording.signals[name] for name in ("v", "a", "x", "t")}}

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """What a guide, its screw and its drive can have."""
        top = max(float(np.quantile(np.abs(r.signals["v"]), 0.98)) for r in recordings)
        speeds = [{"speed_m_per_s": share * top} for share in (0.02, 0.04, 0.08, 0.16, 0.3)]

        def rate(make: Callable[[Array, Shape], Array]) -> Made:
            return lambda r, p, _: {"force": _weak(r).of_rate(lambda v: make(v, p))[:, None]}

        def slow(v: Array, p: Shape) -> Array:
            return np.asarray(np.sign(v) * np.exp(-((v / p["speed_m_per_s"]) ** 2)))

        def presliding(r: Recording, p: Shape, _: Values) -> Columns:
            built = _weak(r).straight(bristles(r, r.signals["v"], p["slide_m"]))
            return {"force": (built - r.signals["sgn_v"])[:, None]}

        def waves(r: Recording, p: Shape, _: Values) -> Columns:
            turn = 2.0 * np.pi / p["pitch_m"]
            cosine, sine = (
                _weak(r).of_place(wave) for wave in (lambda x: np.cos(turn * x), lambda x: np.sin(turn * x))
            )
            return {"force": np.column_stack((cosine, sine))}

        def warm_up(r: Recording, p: Shape, _: Values) -> Columns:
            way = signals.lagged(r.table, np.abs(r.signals["v"]), p["time_constant_s"])
            return {"force": -_weak(r).straight(r.signals["sgn_v"] * way)[:, None]}

        def late(r: Recording, p: Shape, _: Values) -> Columns:
            """The force less itself by so much later, a second of it."""
            if p["delay_s"] == 0.0:
                return {"force": -r.signals["dF"][:, None]}
            t = r.table.time_s
            F = signals.per_run(r.table, lambda times, F: np.interp(times + p["delay_s"], times, F), t, r.signals["F"])
            return {"force": (r.signals["F"] - F)[:, None] / p["delay_s"]}

        made: list[tuple[str, tuple[str, ...], list[dict[str, float]], Made]] = [
            ("direction_friction", ("viscous_Ns_per_m",), [{}], rate(lambda v, _: np.abs(v))),
            ("drag", ("quadratic_Ns2_per_m2",), [{}], rate(lambda v, _: v * np.abs(v))),
            ("stribeck", ("excess_N",), speeds, rate(slow)),
            (
                "presliding",
                ("friction_N",),
                [{"slide_m": x} for x in (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)],
                presliding,
            ),
            # friction that has not built up yet, told by the speed instead of the way
            ("presliding", ("friction_N",), speeds, rate(lambda v, p: -slow(v, p))),
            ("sensor_lag", ("time_constant_s",), [{"delay_s": x} for x in DELAYS_S], late),
            ("once_per_turn", ("cosine_N", "sine_N"), [{"pitch_m": x} for x in PITCHES_M], waves),
            (
                "friction_warm_up",
                ("N_per_m",),
                [{"time_constant_s": x} for x in (3.0, 10.0, 30.0, 100.0)],
                warm_up,
            ),
        ]
        places = {"sensor_lag": ("drive", "timing")}
        forms = {"slide_m": "by the way", "speed_m_per_s": "by the speed"}  # of one cause: only one of them is named
        more_at_rest = {"stribeck": "excess_N", "presliding": "friction_N", "friction_warm_up": "N_per_m"}

        def admissible(cause: str) -> Callable[[Mapping[str, float]], bool]:
            name = more_at_rest.get(cause)
            return lambda found: name is None or found[name] > 0.0

        return [
            Effect(
                cause,
                *places.get(cause, ("guide", "mechanical")),
                names,
                shapes,
                _once(cause, columns),
                admissible(cause),
                form=forms.get(next(iter(shapes[0]), ""), "") if cause == "presliding" else "",
            )
            for cause, names, shapes, columns in made
        ]


def _weak(recording: Recording) -> WeakForm:
    return cast(GuideRecording, recording).weak


def _once(cause: str, make: Made) -> Made:
    """The columns, kept with the recording: no base value is in them, and a mean over a fine grid takes its time."""

    def columns(recording: Recording, shape: Shape, values: Values) -> Columns:
        made = cast(GuideRecording, recording).made
        key = (cause, *sorted(shape.items()))
        if key not in made:
            made[key] = make(recording, shape, values)
        return made[key]

    return columns
