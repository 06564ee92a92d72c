"""Additional named terms from a model file: effects of motors, joints and sensors added without editing equations.

A model file is TOML, one table per term:

    [[term]]
    form = "cogging"
    at = "hip_motor"
    amplitude_Nm = 0.05
    periods_per_turn = 12

A file written by a diagnosis names its method in [diagnosis] (sysid/model_file.py).

`FORMS` lists the forms, their possible places, and their parameters with unit and limits. Every fault of a file is a
UserError that names file, term, field and limit. A plant without terms does no extra work: torques are computed only
when there are any, and sensors and windings keep their neutral numbers.
"""

import dataclasses
import math
import pathlib
from typing import Any

from ranger_sim.foundation import toml_file
from ranger_sim.foundation.numbers import reals
from ranger_sim.foundation.user_error import ModelError, unknown
from ranger_sim.plant.mechanics import term_torques as torques
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.wiring_points import ANALOG_NAMES, ENCODER_NAMES, WORD_NAMES

MOTORS = ("hip_motor", "outer_motor", "inner_motor", "steering_motor")
TORQUE_PLACES = ("hip_joint", "hip_motor", "outer_ankle", "outer_motor", "inner_ankle", "inner_motor")
ROTORS = ("hip_motor", "outer_motor", "inner_motor")
CABLES = ("outer_cable", "inner_cable")
# place and leg of a row of plant/mechanics/term_torques.py (the hip's places belong to no leg)
ROW_PLACES = {
    "hip_joint": (torques.HIP_JOINT, -1),
    "hip_motor": (torques.HIP_MOTOR, -1),
    "outer_ankle": (torques.ANKLE_JOINT, OUTER),
    "outer_motor": (torques.ANKLE_MOTOR, OUTER),
    "inner_ankle": (torques.ANKLE_JOINT, INNER),
    "inner_motor": (torques.ANKLE_MOTOR, INNER),
    "outer_cable": (torques.ANKLE_CABLE, OUTER),
    "inner_cable": (torques.ANKLE_CABLE, INNER),
}


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One number of a form: its unit, the limits it must keep (inclusive), its value when a file leaves it out."""

    name: str
    unit: str
    low: float
    high: float
    default: float | None = None


@dataclasses.dataclass(frozen=True)
class Form:
    """A named effect: its possible places, its parameters in order, and its effect in one sentence."""

    name: str
    places: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    meaning: str
    torque: int = -1  # row code of plant/mechanics/term_torques.py, -1 when it acts elsewhere


def _phase(name: str = "phase_rad") -> Parameter:
    return Parameter(name, "rad", -2.0 * math.pi, 2.0 * math.pi, 0.0)


_FORMS = (
    Form(
        "stribeck",
        TORQUE_PLACES,
        (Parameter("excess_Nm", "N m", 0.0, 10.0), Parameter("speed_rad_s", "rad/s", 0.001, 100.0)),
        "friction that is larger at low speed and falls off with its square",
        torques.STRIBECK,
    ),
    Form(
        "coulomb_friction",
        TORQUE_PLACES,
        (Parameter("change_Nm", "N m", -0.1, 10.0),),
        "constant friction on top of the base model's",
        torques.COULOMB,
    ),
    Form(
        "viscous_friction",
        TORQUE_PLACES,
        (Parameter("change_Nms", "N m s/rad", -0.01, 10.0),),
        "friction in proportion to the rate, on top of the base model's",
        torques.VISCOUS,
    ),
    Form(
        "direction_friction",
        TORQUE_PLACES,
        (
            Parameter("coulomb_Nm", "N m", -10.0, 10.0, 0.0),
            Parameter("viscous_Nms", "N m s/rad", -10.0, 10.0, 0.0),
        ),
        "friction that is larger in the positive direction by twice this",
        torques.DIRECTION,
    ),
    Form(
        "drag",
        TORQUE_PLACES,
        (Parameter("quadratic_Nms2", "N m s^2/rad^2", 0.0, 10.0),),
        "drag with the square of the rate",
        torques.DRAG,
    ),
    Form(
        "spring",
        TORQUE_PLACES,
        (
            Parameter("linear_Nm_per_rad", "N m/rad", -100.0, 100.0, 0.0),
            Parameter("square_Nm_per_rad2", "N m/rad^2", -100.0, 100.0, 0.0),
            Parameter("cubic_Nm_per_rad3", "N m/rad^3", -1000.0, 1000.0, 0.0),
            Parameter("rest_rad", "rad", -4.0, 4.0, 0.0),
        ),
        "a spring about a rest angle, up to the third power: return springs of the ankle, the hip spring's bend",
        torques.SPRING,
    ),
    Form(
        "cogging",
        ROTORS,
        (
            Parameter("amplitude_Nm", "N m", 0.0, 5.0),
            Parameter("periods_per_turn", "1", 1.0, 1000.0),
            _phase(),
        ),
        "a torque periodic in the rotor's angle, without current; at the joint side",
        torques.COGGING,
    ),
    Form(
        "commutation_ripple",
        ROTORS,
        (
            Parameter("fraction", "1", 0.0, 0.5),
            Parameter("periods_per_turn", "1", 1.0, 1000.0),
            _phase(),
        ),
        "a part of the torque constant that is periodic in the rotor's angle: of torque and back-EMF alike",
    ),
    Form(
        "once_per_turn",
        TORQUE_PLACES,
        (
            Parameter("amplitude_Nm", "N m", 0.0, 5.0),
            Parameter("periods_per_turn", "1", 1.0, 100.0, 1.0),
            _phase(),
        ),
        "a torque periodic in the joint's angle: gear or pulley out of centre",
        torques.TURN,
    ),
    Form(
        "cable_stiffening",
        CABLES,
        (Parameter("cubic_Nm_per_rad3", "N m/rad^3", -1000.0, 10000.0),),
        "a cable that gets stiffer the further it is stretched",
        torques.STIFFENING,
    ),
    Form(
        "cable_backlash",
        CABLES,
        (
            Parameter("gap_rad", "rad", 0.0, 0.5),
            Parameter("stiffness_Nm_per_rad", "N m/rad", 0.0, 100.0, 14.0),
        ),
        "a gap between motor and joint: the cable pulls only beyond it",
        torques.BACKLASH,
    ),
    Form(
        "cable_slack",
        CABLES,
        (Parameter("stiffness_Nm_per_rad", "N m/rad", 0.0, 100.0, 14.0),),
        "a cable that goes slack instead of pushing",
        torques.SLACK,
    ),
    Form(
        "cable_damping",
        CABLES,
        (Parameter("damping_Nms", "N m s/rad", 0.0, 1.0),),
        "damping of the cable's stretch",
        torques.CABLE_DAMPING,
    ),
    Form(
        "resistance_temperature",
        MOTORS,
        (Parameter("per_K", "1/K", -0.01, 0.02),),
        "winding resistance that grows with the rotor's temperature above 25 C (copper 0.0039)",
    ),
    Form(
        "torque_constant_temperature",
        MOTORS,
        (Parameter("per_K", "1/K", -0.02, 0.01),),
        "torque constant that falls with the housing's temperature above 25 C (ferrite -0.002)",
    ),
    Form(
        "resistance_change",
        MOTORS,
        (Parameter("change_ohm", "ohm", -1.0, 100.0),),
        "more resistance in series with the winding",
    ),
    Form(
        "torque_constant_change",
        MOTORS,
        (Parameter("factor", "1", 0.5, 2.0),),
        "a torque constant that is this multiple of the base model's",
    ),
    Form(
        "contact_drop_change",
        MOTORS,
        (Parameter("change_V", "V", -0.7, 10.0),),
        "a larger drop at the brushes",
    ),
    Form(
        "dead_time",
        MOTORS,
        (Parameter("fraction", "1", 0.0, 0.2),),
        "part of the PWM period in which neither transistor of a lead conducts, both edges together",
    ),
    Form(
        "sensor_scale",
        ANALOG_NAMES + ENCODER_NAMES + WORD_NAMES + ("gyro",),
        (Parameter("factor", "1", 0.1, 10.0),),
        "a sensor that shows its quantity multiplied by this",
    ),
    Form(
        "sensor_offset",
        ANALOG_NAMES + ENCODER_NAMES + WORD_NAMES + ("gyro", "roll"),
        (Parameter("value", "unit of the sensor: A, V, rad or rad/s", -100.0, 100.0),),
        "a sensor that shows its quantity plus this",
    ),
    Form(
        "sensor_lag",
        ANALOG_NAMES + WORD_NAMES + ("gyro",),
        (Parameter("time_constant_s", "s", 0.0, 10.0),),
        "a sensor behind a first-order filter",
    ),
    Form(
        "sensor_noise",
        ANALOG_NAMES,
        (Parameter("deviation", "unit of the sensor: A, V or rad", 0.0, 100.0),),
        "standard deviation of the sensor's noise, in place of the base model's",
    ),
    Form(
        "eccentricity",
        ENCODER_NAMES + WORD_NAMES,
        (
            Parameter("once_rad", "rad", -0.2, 0.2),
            _phase("once_phase_rad"),
            Parameter("twice_rad", "rad", -0.2, 0.2, 0.0),
            _phase("twice_phase_rad"),
        ),
        "disc or magnet out of centre: an error once and twice per turn of the encoder's shaft",
    ),
    Form(
        "edge_jitter",
        ENCODER_NAMES,
        (Parameter("edges", "edges", 0.0, 0.4),),
        "random shift of every edge's stamp, standard deviation in edges",
    ),
    Form(
        "disc_error",
        ENCODER_NAMES,
        (
            Parameter("line_edges", "edges", 0.0, 0.1, 0.0),
            Parameter("duty_edges", "edges", -0.4, 0.4, 0.0),
        ),
        "lasting errors of the disc: deviation per line, and a high time of channel A that is longer by this",
    ),
    Form(
        "bit_flip",
        WORD_NAMES,
        (Parameter("probability", "1", 0.0, 1.0),),
        "probability that a word has one wrong bit",
    ),
    Form(
        "gyro_misalignment",
        ("gyro",),
        (Parameter("yaw_rad", "rad", -0.5, 0.5),),
        "part of the yaw rate that shows in the lean rate",
    ),
)
FORMS = {form.name: form for form in _FORMS}


@dataclasses.dataclass(frozen=True)
class Term:
    """One term of a model file, checked: its form, its place, a value for every parameter of the form."""

    form: Form
    at: str
    values: dict[str, float]


def describe() -> str:
    """All forms with places, parameters, units and limits, as readable text."""
    lines = []
    for form in FORMS.values():
        lines.append(f"{form.name}: {form.meaning}")
        lines.append(f"    at: {', '.join(form.places)}")
        for p in form.parameters:
            default = "" if p.default is None else f", {p.default:g} when left out"
            lines.append(f"    {p.name} [{p.unit}]: {p.low:g} to {p.high:g}{default}")
    return "\n".join(lines) + "\n"


def _check(place: str, table: object) -> Term:
    """One table of a file as a Term; `place` starts every error."""
    if not isinstance(table, dict):
        raise ModelError(f"{place}: a term is a table, not {table!r}")
    name = table.get("form")
    if not isinstance(name, str) or name not in FORMS:
        raise ModelError(f"{place}: {unknown('form', str(name), FORMS)}")
    form = FORMS[name]
    at = table.get("at")
    place = f"{place} ({name})"
    if at not in form.places:
        raise ModelError(f"{place}: at is {at!r}; this form can stand at: {', '.join(form.places)}")
    known = {p.name for p in form.parameters}
    for key in table:
        if key not in known and key not in ("form", "at"):
            raise ModelError(f"{place}: {key} is no parameter of this form; it has: {', '.join(sorted(known))}")
    values = {}
    for p in form.parameters:
        value = table.get(p.name, p.default)
        if value is None:
            raise ModelError(f"{place}: {p.name} is missing, a number from {p.low:g} to {p.high:g} {p.unit}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ModelError(
                f"{place}: {p.name} is {value!r}, it must be a number from {p.low:g} to {p.high:g} {p.unit}"
            )
        if not p.low <= value <= p.high:
            raise ModelError(f"{place}: {p.name} is {value!r}, allowed are {p.low:g} to {p.high:g} {p.unit}")
        values[p.name] = float(value)
    return Term(form, at, values)


class Model:
    """The terms of one model file (or of `tables`, a list of dictionaries like the file's)."""

    def __init__(self, tables: Any, source: str = "model") -> None:
        self.source = source
        self.left_out: list[str] = []  # effects found by a diagnosis that the user leaves out
        self.terms = [_check(f"{source}: term {number}", table) for number, table in enumerate(tables, 1)]

    def apply(self, plant: Any) -> None:
        """Put every term into a RangerPlant, before its first step."""
        electrics = plant.electrics
        rows = None
        for term in self.terms:
            if term.form.torque >= 0:
                if rows is None:
                    p = plant.parameters
                    rows = torques.TermTorques(p.ankle_zero_rad, p.hip_gear, p.ankle_gear, p.friction_smoothing_rad_s)
                rows.add(term.form.torque, *ROW_PLACES[term.at], list(term.values.values()))
            elif term.form.name == "commutation_ripple":
                electrics.motors[MOTORS.index(term.at)].add_ripple(*term.values.values())
                electrics.has_ripple = True
            elif term.form.places is MOTORS:  # an encoder may have the same name
                motors = (electrics.hip, electrics.outer_ankle, electrics.inner_ankle, electrics.steering)
                unit = motors[MOTORS.index(term.at)]
                _apply_electric(unit, term)
                ohm = unit.winding_ohm + unit.series_ohm
                if ohm <= 0.0 or unit.contact_drop_V < 0.0:
                    raise ModelError(
                        f"{self.source}: the terms at {term.at} together leave {ohm:g} ohm "
                        f"and {unit.contact_drop_V:g} V at the brushes; both must stay above 0"
                    )
            elif term.at in ANALOG_NAMES:
                _apply_analog(electrics, ANALOG_NAMES.index(term.at), term)
            elif term.at in WORD_NAMES:
                _apply_angle((plant.hip_word, plant.outer_word, plant.inner_word)[WORD_NAMES.index(term.at)], term)
            elif term.at in ENCODER_NAMES:
                _apply_angle(plant.encoders[ENCODER_NAMES.index(term.at)], term)
            else:
                _apply_imu(plant.imu, term)
        self._ripples_are_possible()
        if rows is not None:
            plant.body.terms = rows

    def _ripples_are_possible(self) -> None:
        """Raise UserError where ripples together would reverse a motor's torque constant."""
        sums: dict[str, float] = {}
        for term in self.terms:
            if term.form.name == "commutation_ripple":
                sums[term.at] = sums.get(term.at, 0.0) + term.values["fraction"]
        for at, total in sums.items():
            if total >= 1.0:
                raise ModelError(
                    f"{self.source}: the commutation ripples at {at} together are {total:g} of its torque constant; "
                    "allowed is what lies below 1"
                )


def _apply_electric(unit: Any, term: Term) -> None:
    """A term of a winding or its bridge."""
    name, (value,) = term.form.name, term.values.values()
    if name == "resistance_temperature":
        unit.resistance_per_K += value
        unit.heat_matters = True
    elif name == "torque_constant_temperature":
        unit.torque_constant_per_K += value
        unit.heat_matters = True
    elif name == "resistance_change":
        unit.series_ohm += value
    elif name == "torque_constant_change":
        unit.K *= value
        # heat recomputes K from the parameters
        constant = value * unit.parameters.torque_constant_Nm_per_A
        unit.parameters = dataclasses.replace(unit.parameters, torque_constant_Nm_per_A=constant)
    elif name == "contact_drop_change":
        unit.contact_drop_V += value
    else:
        unit.dead_time_fraction += value


def _apply_analog(electrics: Any, i: int, term: Term) -> None:
    """A term of a voltage sensor, number i of the wiring points."""
    name, (value,) = term.form.name, term.values.values()
    if name == "sensor_noise":
        noise = reals(electrics.noise_V)
        noise[i] = value * abs(electrics.slope_V[i])
        electrics.noise_V = noise
        return
    electrics.has_terms = True
    field = {"sensor_scale": "scale", "sensor_offset": "offset", "sensor_lag": "lag_s"}[name]
    numbers = reals(getattr(electrics, field))
    numbers[i] = value * numbers[i] if name == "sensor_scale" else value + numbers[i]
    setattr(electrics, field, numbers)


def _apply_angle(encoder: Any, term: Term) -> None:
    """A term of an incremental or absolute encoder."""
    name, values = term.form.name, list(term.values.values())
    if name == "sensor_scale":
        encoder.scale *= values[0]
    elif name == "sensor_offset":
        encoder.offset_rad += values[0]
    elif name == "sensor_lag":
        encoder.lag_s += values[0]
    elif name == "edge_jitter":
        encoder.jitter = values[0]
    elif name == "disc_error":
        encoder.set_disc(*values)
    elif name == "bit_flip":
        encoder.bit_flip = values[0]
    else:
        encoder.eccentricity_1, encoder.phase_1, encoder.eccentricity_2, encoder.phase_2 = values


def _apply_imu(imu: Any, term: Term) -> None:
    """A term of the inertial sensor: its rate about the hip, or its roll (outer legs', positive leaning back)."""
    name, (value,) = term.form.name, term.values.values()
    if term.at == "roll":
        imu.roll_bias_rad += value
    elif name == "sensor_scale":
        imu.rate_scale *= value
    elif name == "sensor_offset":
        imu.bias_rad_s += value
    elif name == "sensor_lag":
        imu.lag_s += value
    else:
        imu.cross_x_from_z += value


def load(path: str | pathlib.Path) -> Model:
    """The model of a TOML file; UserError with file, term, field and limit for every fault.

    An effect found by a diagnosis that no form describes is refused, unless the file marks it as left out.
    """
    content = content_of(path)
    model = Model(content.get("term", []), str(path))
    for effect in content.get("diagnosis", {}).get("effect", []):
        if isinstance(effect, dict) and "no_form" in effect:
            name = f"{effect.get('cause')} at {effect.get('at')}"
            if effect.get("left_out") is not True:
                raise ModelError(
                    f"{path}: {name} cannot be simulated: {effect['no_form']}; "
                    "with left_out = true in its table the simulator runs without it"
                )
            model.left_out.append(name)
    return model


def content_of(path: str | pathlib.Path) -> dict[str, Any]:
    """The tables of a model file; in [diagnosis] it checks types, and that numbers are finite."""
    path = pathlib.Path(path)
    content = toml_file.load(path)
    unknown = [key for key in content if key not in ("term", "title", "diagnosis")]
    if unknown:
        raise ModelError(
            f"{path}: {unknown[0]} is not known here; a model file holds [[term]] tables, a title, and [diagnosis]"
        )
    if not isinstance(content.get("term", []), list):
        raise ModelError(f"{path}: term is written [[term]], once per term")
    told = content.get("diagnosis", {})
    if not isinstance(told, dict) or not isinstance(told.get("effect", []), list):
        raise ModelError(f"{path}: [diagnosis] is a table, its effects are written [[diagnosis.effect]]")
    parameters = told.get("parameters", {})
    if not isinstance(parameters, dict) or not all(map(is_number, parameters.values())):
        raise ModelError(f"{path}: [diagnosis.parameters] holds numbers")
    if not isinstance(told.get("experiment", ""), str):
        raise ModelError(f"{path}: diagnosis.experiment is {told['experiment']!r}, a name is expected")
    gear = told.get("gear", 1.0)
    if not is_number(gear) or gear <= 0.0:
        raise ModelError(f"{path}: diagnosis.gear is {gear!r}, a number above 0 is expected")
    return content


def is_number(value: Any) -> bool:
    """True for a finite number of a TOML file."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
