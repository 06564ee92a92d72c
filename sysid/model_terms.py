"""Effects of a diagnosis as terms of the simulator (plant/terms.py), and back.

An effect's coefficients are measured: at a bench's gearbox, cosine and sine of an angle with the recording's zero. A
term is the simulator's addition: at the robot's joint, amplitude and phase. With r = robot's gear over the bench's, of
one rotor: torque x r, rate / r. An effect without a form gives the reason.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files, terms
from ranger_sim.plant.electrics.battery import BatteryParameters
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, HIP_MOTOR, MotorParameters
from ranger_sim.sysid.causes import CAUSES
from ranger_sim.sysid.machine import Machine

Numbers = Mapping[str, float]
MOTORS: dict[str, MotorParameters] = {"hip_motor": HIP_MOTOR, "outer_motor": ANKLE_MOTOR, "inner_motor": ANKLE_MOTOR}
# s: a winding's heat that follows the current squared with this time constant is the simulator's own winding (20 s)
WINDING_S = (10.0, 40.0)


@dataclasses.dataclass(frozen=True)
class Context:
    """Data for a conversion: r as above, the machine's parameters as fitted, the simulator's motor."""

    ratio: float
    values: Numbers
    motor: MotorParameters


class NoFormError(Exception):
    """The simulator cannot represent the effect; the text gives the reason."""


Made = Callable[[Numbers, Context], dict[str, float]]


def _wave(numbers: Numbers) -> tuple[float, float]:
    """(amplitude, phase) of A sin(x + phase) = c cos x + s sin x."""
    cosine, sine = [next(v for k, v in numbers.items() if k.startswith(name)) for name in ("cosine", "sine")]
    return math.hypot(cosine, sine), math.atan2(cosine, sine)


def _periodic(name: str, with_gear: bool) -> Made:
    def made(numbers: Numbers, context: Context) -> dict[str, float]:
        size, phase = _wave(numbers)
        return {
            name: size * (context.ratio if with_gear else 1.0),
            "periods_per_turn": numbers["periods_per_turn"],
            "phase_rad": phase,
        }

    return made


def _resistance(numbers: Numbers, context: Context) -> dict[str, float]:
    """Ohm per kelvin of the measured temperature, or per A^2 of a filter that the simulator's winding has as well."""
    ohm = context.values["resistance_ohm"]
    time_s = numbers.get("time_constant_s", 0.0)  # 0: the winding's measured temperature
    if time_s == 0.0:
        return {"per_K": numbers["ohm_per_heat"] / ohm}
    if not WINDING_S[0] <= time_s <= WINDING_S[1]:
        raise NoFormError(f"it heats within {time_s:g} s, the simulator's winding within 20 s")
    return {"per_K": numbers["ohm_per_heat"] / (ohm * ohm * context.motor.winding_to_housing_K_per_W)}


def _torque_constant(numbers: Numbers, context: Context) -> dict[str, float]:
    if numbers["time_constant_s"] != 0.0:
        raise NoFormError("it follows the current squared, the simulator's magnets follow the housing's temperature")
    return {"per_K": numbers["per_heat"] / context.values["torque_constant_Nm_per_A"]}


def _dead_time(numbers: Numbers, _: Context) -> dict[str, float]:
    pack = BatteryParameters()
    nominal_V = 3.7 * pack.cells_in_series  # of a lithium cell, as at plant/electrics/battery.py
    return {"fraction": numbers["drop_V"] / nominal_V}


def _whole_spring(numbers: Numbers, values: Numbers) -> dict[str, float]:
    """What square and cube about `rest_rad` add to the simulator's spring, with the change of the base's own.

    It is about the angle at which all of it pulls nothing: a term has no constant torque.
    """
    spring = body_files.load("ranger").parameters.ankle_return_Nm_per_rad
    more = values["return_stiffness_Nm_per_rad"] - spring
    square, cubic = numbers["square_Nm_per_rad2"], numbers["cubic_Nm_per_rad3"]
    pull = np.polynomial.Polynomial([-values["return_torque_Nm"], more, square, cubic])
    roots = pull.roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    if not len(real):
        raise NoFormError("it pulls at every angle, the simulator's form of it has an angle of rest")
    at = float(real[np.argmin(np.abs(real))])
    return {
        "linear_Nm_per_rad": float(pull.deriv()(at)),
        "square_Nm_per_rad2": square + 3.0 * cubic * at,
        "cubic_Nm_per_rad3": cubic,
        "rest_rad": numbers["rest_rad"] + at,
    }


FORM_OF = {cause.identifier: cause.form for cause in CAUSES.values() if cause.form}
# by cause; each takes coefficients and shape, and returns the form's parameters
TO_TERM: dict[str, Made] = {
    "stribeck": lambda n, c: {"excess_Nm": n["excess_Nm"] * c.ratio, "speed_rad_s": n["speed_rad_s"] / c.ratio},
    "coulomb_friction": lambda n, c: {"change_Nm": n["change_Nm"] * c.ratio},
    "viscous_friction": lambda n, c: {"change_Nms": n["change_Nms"] * c.ratio**2},
    "direction_friction": lambda n, c: {
        "coulomb_Nm": n.get("coulomb_Nm", 0.0) * c.ratio,
        "viscous_Nms": n.get("viscous_Nms", 0.0) * c.ratio**2,
    },
    "drag": lambda n, c: {"quadratic_Nms2": n["quadratic_Nms2"] * c.ratio**3},
    "cogging": _periodic("amplitude_Nm", True),
    "commutation_ripple": _periodic("fraction", False),
    "once_per_turn": _periodic("amplitude_Nm", False),
    "resistance_temperature": _resistance,
    "torque_constant_temperature": _torque_constant,
    # above its shape's current the drop is complete, and the simulator has it complete at every current
    "contact_drop_change": lambda n, c: {"change_V": n["change_V"]},
    "dead_time": _dead_time,
    "cable_backlash": lambda n, c: {"gap_rad": n["half_gap_rad"]},
    "sensor_scale": lambda n, c: {"factor": 1.0 + n["change"]},
    "sensor_offset": lambda n, c: {"value": next(v for k, v in n.items() if k.startswith("offset"))},
    "sensor_lag": lambda n, c: {"time_constant_s": n["time_constant_s"]},
}  # fmt: skip
# a parameter of a motor's equations, and the term that gives the simulator's motor the same value
PARAMETER_TERMS: dict[str, tuple[str, Callable[[float, float], dict[str, float]]]] = {
    "resistance_ohm": ("resistance_change", lambda found, was: {"change_ohm": found - was}),
    "contact_drop_V": ("contact_drop_change", lambda found, was: {"change_V": found - was}),
    "torque_constant_Nm_per_A": ("torque_constant_change", lambda found, was: {"factor": found / was}),
}


def context_of(machine: Machine, at: str, values: Numbers) -> Context:
    """Conversion for the place `at` of a machine that may have its own gearbox."""
    motor = MOTORS.get(at, HIP_MOTOR)
    gear = getattr(machine, "gear", None)
    return Context(motor.gear / gear if gear and at in MOTORS else 1.0, values, motor)


def term_of(machine: Machine, cause: str, at: str, numbers: Numbers, values: Numbers) -> dict[str, Any]:
    """A [[term]] of the simulator. numbers: coefficients and shape; values: the machine's parameters as fitted.

    Raise NoFormError with the reason when the simulator has none.
    """
    name = FORM_OF.get(cause, cause)
    form = terms.FORMS.get(name)
    if form is None:
        raise NoFormError("the simulator has no form for it")
    if at not in form.places:
        raise NoFormError(f"the simulator has it at {', '.join(form.places)}, and no place {at}")
    context = context_of(machine, at, values)
    if cause == "return_spring" and "rest_rad" in numbers and "return_torque_Nm" in values:
        made = _whole_spring(numbers, values)
    elif all(name in {each.name for each in form.parameters} for name in numbers) and context.ratio == 1.0:
        made = dict(numbers)  # given in the form's own parameters
    elif cause in TO_TERM:
        try:
            made = TO_TERM[cause](numbers, context)
        except (KeyError, StopIteration):
            raise NoFormError(f"its coefficients {', '.join(numbers)} are not those of the form") from None
    else:
        raise NoFormError("the simulator's form of it has other parameters")
    return _checked({"form": name, "at": at, **made})


SAME = 0.005  # of a parameter: values nearer than this to the simulator's leave it unchanged


def parameter_terms(machine: Machine, values: Numbers, intervals: Mapping[str, tuple[float, float]]) -> list[dict]:
    """Terms that give the simulator's motor the fitted parameters that differ from its own.

    Only for a machine that names its motor in the simulator (`motor`); friction and inertia are those of the bench's
    gearbox and load, so they stay there.
    """
    at = getattr(machine, "motor", None)
    made = []
    for known in machine.parameters:
        if at is None or known.name not in PARAMETER_TERMS or known.name not in values:
            continue
        low, high = intervals[known.name]
        # a fit's error about its own model is some thousandths; a motor's parts differ by more
        if not low <= known.value <= high and abs(values[known.name] - known.value) > SAME * abs(known.value):
            form, change = PARAMETER_TERMS[known.name]
            try:
                made.append(_checked({"form": form, "at": at, **change(values[known.name], known.value)}))
            except NoFormError:  # the diagnosis itself reports a value that no motor has
                continue
    return made


def effects_of(machine: Machine, term: terms.Term) -> list[tuple[str, str, dict[str, float], dict[str, float]]]:
    """(cause, place, coefficients, shape) of the machine's effects for a term; empty for a parameter's change.

    Raise NoFormError when the machine's equations have no such effect.
    """
    name, v = term.form.name, term.values
    ratio = context_of(machine, term.at, {}).ratio
    if name in (*(form for form, _ in PARAMETER_TERMS.values()), "coulomb_friction", "viscous_friction"):
        return []
    coefficients: list[tuple[dict[str, float], dict[str, float]]] = []
    if name in ("cogging", "commutation_ripple", "once_per_turn"):
        size = v["fraction"] if name == "commutation_ripple" else v["amplitude_Nm"]
        size /= ratio if name == "cogging" else 1.0
        unit = "" if name == "commutation_ripple" else "_Nm"
        both = {f"cosine{unit}": size * math.sin(v["phase_rad"]), f"sine{unit}": size * math.cos(v["phase_rad"])}
        coefficients.append((both, {"periods_per_turn": v["periods_per_turn"]}))
    elif name == "stribeck":
        coefficients.append(({"excess_Nm": v["excess_Nm"] / ratio}, {"speed_rad_s": v["speed_rad_s"] * ratio}))
    elif name == "direction_friction":
        for each, power in (("coulomb_Nm", 1), ("viscous_Nms", 2)):
            if v[each]:
                coefficients.append(({each: v[each] / ratio**power}, {}))
    elif name == "drag":
        coefficients.append(({"quadratic_Nms2": v["quadratic_Nms2"] / ratio**3}, {}))
    elif name == "sensor_scale":
        coefficients.append(({"change": v["factor"] - 1.0}, {}))
    elif name == "sensor_lag":
        coefficients.append(({"time_constant_s": v["time_constant_s"]}, {}))
    else:
        raise NoFormError(f"{machine.name} does not know {name} from a [[term]]; a diagnosis' own file has it")
    return [(name, term.at, each, shape) for each, shape in coefficients]


def _checked(table: dict[str, Any]) -> dict[str, Any]:
    """The table, if the simulator accepts it."""
    try:
        terms.Model([table], "x")
    except UserError as error:
        raise NoFormError(str(error).split(": ", 2)[-1]) from None
    return table
