"""A geared brushed motor on the bench: voltage, current, speed and torque at the output of its gearbox.

    electric     V = R I + V_c sgn I + K G w + L dI/dt                                        appendix eq. 32
    mechanical   T = K G I - C_0 sgn w - C_1 w - mu K G |I| sgn w - J dw/dt                   appendix eq. 33, 35
    transmission dtheta_m/dt / G = w                            where the motor's angle is measured as well

K stands in both: what changes one side of it only is a sensor's scale. Near standstill friction may be anything up to
its limit (eq. 35), and near zero current so may the brushes' drop: rows whose sign is within the noise do not count.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machine import Columns, Effect, Equation, Known, Quantity, Recording, Values

CALM = 20.0  # samples; Gaussian of two speeds that are held against each other
SLOW = 5.0  # samples; Gaussian of what must not have the noise of a derivative
TORQUE = 7.0  # samples; its derivative at 5 has noise that makes a lag small by a fifth, at 10 loses what is fast
FINE = 2.0  # samples; Gaussian of the speed by the angle: its counts are small, and a reversal stays where it was
REACH = 4  # samples about a jump or a standstill that do not count: two deviations of the finer Gaussian
JUMP_IN_STEPS = 0.06  # of the whole range, within one sample
SIGN_IN_NOISE = 4.0  # deviations of noise within which a sign means nothing
FLOWS = 0.15  # of the largest current: above it current flows, in any recording that excites a motor
# Least own noise of a stand-in, of its difference to what was measured. Three spreads cannot tell less of a current;
# and a friction that turns its sign within 0.05 rad/s is no cause.
OWN_I, OWN_W = 0.3, 0.5
HEAT_TIMES_S = (3.0, 10.0, 30.0, 100.0, 300.0)
SPEED_SHARES = (0.01, 0.02, 0.04, 0.08, 0.16, 0.3, 0.5)
CURRENT_SHARES = (0.1, 0.3, 1.0)
LAGS_S = (0.0005, 0.001, 0.002, 0.004, 0.01, 0.03)
SAME_MOTION = 0.7  # correlation of angle and speed; slip and lost counts leave more
SAME_SPEED = 2.0  # times: rpm, degrees and thousands are more
DEFLECTIONS_RAD = (1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3, 6.4e-3, 0.0128, 0.03, 0.1)
SAMPLES_A_WAVE = 4.0  # with fewer a sample's own interval and differences of samples change what a wave shows
MOST_WAVES = 24  # per turn of the rotor, of the general look
MOST_PERIODS = 60  # per turn of the rotor

Shape = Mapping[str, float]


def column(*parts: Array) -> Array:
    """(n, k) from k columns (n,)."""
    return np.column_stack(parts)


class MotorBench:
    """The bench of appendix figure 26. gear: turns of the rotor per turn of the output."""

    name = "motor-bench"
    quantities = (
        Quantity("voltage_V", "V", "at the motor's terminals"),
        Quantity("current_A", "A", "through the winding"),
        Quantity("speed_rad_per_s", "rad/s", "of the gearbox's output"),
        Quantity("torque_Nm", "N m", "at the gearbox's output, as the motor drives"),
        Quantity("temperature_C", "C", "of the motor's housing", needed=False),
        Quantity("motor_angle_rad", "rad", "of the rotor", needed=False),
    )

    motor = "hip_motor"  # of the simulator, whose winding and magnets are measured here
    labels: ClassVar = {
        "V": "voltage, V",
        "I": "current, A",
        "w": "speed of the output, rad/s",
        "angle": "angle of the rotor, rad",
        "t": "time, s",
    }

    def __init__(self, gear: float = 14.0) -> None:
        self.gear = gear
        k = 0.018 * gear
        # values: appendix table 3 at the 14:1 gearbox; limits chosen by us, a hundred times either way
        self.parameters = (
            Known("resistance_ohm", "ohm", 1.3, 0.0, 130.0, "winding, brushes and leads"),
            Known("contact_drop_V", "V", 0.7, 0.0, 70.0, "at the brushes, both together"),
            Known("torque_constant_Nm_per_A", "N m/A", k, 0.0, 100.0 * k, "at the output, gear included"),
            Known("inductance_H", "H", 1e-4, -0.01, 0.1, "of the winding; next to nothing at this sampling"),
            Known("constant_friction_Nm", "N m", 0.01, 0.0, 1.0, "of motor and gearbox"),
            Known("viscous_friction_Nms", "N m s/rad", 0.0, -0.01, 1.0, "of motor and gearbox"),
            Known("load_friction_Nm_per_A", "N m/A", 0.1 * k, 0.0, 10.0 * k, "mu K G"),
            Known("inertia_kg_m2", "kg m^2", 1.6e-6 * gear * gear, 0.0, 1.0, "of the rotor as the output feels it"),
        )

    def prepare(self, table: Table) -> Recording:
        """Signals and the two or three equations of one recording."""
        missing = [each.name for each in self.quantities if each.needed and each.name not in table]
        if missing:
            raise UserError(
                f"{table.name}: {self.name} needs {', '.join(missing)}; there are {', '.join(table.columns)}"
            )
        table = signals.uniform(table)
        V, I, w, T = (table[each.name] for each in self.quantities[:4])  # noqa: E741  (the paper's letters)
        s: dict[str, Array] = {"V": V, "t": table.time_s - table.time_s[0]}
        measured = "motor_angle_rad" in table
        s["angle"] = table["motor_angle_rad"] if measured else self.gear * signals.integral(table, w)
        if measured:
            _same_motion(table, s["angle"] / self.gear, w)
        # stand-ins: speed by the angle, current by voltage and speed; neither has the noise of what it stands for
        s["w"] = signals.derivative(table, s["angle"], FINE) / self.gear if measured else signals.smooth(table, w, FINE)
        s["dw"] = np.gradient(signals.smooth(table, s["w"], SLOW), table.step_s)
        rough = _rough_electrics(V, I, s["w"])
        s["I"] = _current(V, s["w"], *rough)
        s["w_by_voltage"] = signals.smooth(table, V - rough[0] * I - rough[1] * np.sign(s["I"]), SLOW) / rough[2]
        if not measured:
            s["dw"] = np.gradient(s["w_by_voltage"], table.step_s)
        s["dI"] = np.gradient(s["I"], table.step_s)
        s["dT"] = signals.derivative(table, T, TORQUE)
        s["dV"] = np.gradient(V, table.step_s)
        steady = _no_jump(V, JUMP_IN_STEPS, REACH) & _inner(table, int(3.0 * SLOW))
        s["sgn_I"], s["sgn_w"] = _mean_sign(s["I"]), _mean_sign(s["w"])
        # what the electric balance is sorted by must not have the voltage's or the current's own noise
        s["I_by_torque"] = signals.smooth(table, _current_by_torque(T, I, s), SLOW)
        s["V_by_torque"] = rough[0] * s["I_by_torque"] + rough[1] * s["sgn_I"] + rough[2] * s["w"]
        noise_I = _own_noise(s["I"], I, s["I_by_torque"], steady, OWN_I)
        noise_w = _spread(w - s["w"], steady)
        if measured:
            noise_w = _own_noise(s["w"], w, s["w_by_voltage"], steady, OWN_W)
        if "temperature_C" in table:
            s["warmth"] = signals.smooth(table, table["temperature_C"], 50.0) - 25.0
        firm_I = steady & _away(s["I"], SIGN_IN_NOISE * noise_I, REACH) & _one_sign(s["I"])
        firm_w = steady & _away(s["w"], SIGN_IN_NOISE * noise_w, 2) & _one_sign(s["w"])
        loaded = -s["sgn_w"] * np.sign(s["I"])
        equations = {
            "electric": Equation(
                "electric",
                "E",
                "electrical",
                "V",
                V,
                {
                    "resistance_ohm": I,
                    "contact_drop_V": s["sgn_I"],
                    "torque_constant_Nm_per_A": w,
                    "inductance_H": s["dI"],
                },
                firm_I,
                {"resistance_ohm": s["I_by_torque"], "torque_constant_Nm_per_A": s["w"]},
            ),
            "mechanical": Equation(
                "mechanical",
                "M",
                "mechanical",
                "N m",
                T,
                {
                    "torque_constant_Nm_per_A": I,
                    "constant_friction_Nm": -s["sgn_w"],
                    "viscous_friction_Nms": -w,
                    "load_friction_Nm_per_A": loaded * I,
                    "inertia_kg_m2": -np.gradient(w, table.step_s),
                },
                firm_w,
                {
                    "torque_constant_Nm_per_A": s["I"],
                    "viscous_friction_Nms": -s["w"],
                    "load_friction_Nm_per_A": loaded * s["I"],
                    "inertia_kg_m2": -s["dw"],
                },
            ),
        }
        if measured:
            turning = np.gradient(s["angle"], table.step_s) / self.gear
            everywhere = _inner(table, REACH)
            equations["transmission"] = Equation(
                "transmission", "T", "transmission", "rad/s", turning - w, {}, everywhere, lines=False
            )
        regimes = _regimes(s, firm_w)
        lags = (0, 10, 30, 100) if measured else (0, 100, 250)
        return Recording(table, s, equations, regimes, lags=lags)

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which each equation is looked at without a cause in mind."""
        s = recording.signals
        of_voltage = {"I": s["I_by_torque"], "V": s["V_by_torque"], "w": s["w"], "t": s["t"]}
        turn = np.remainder(s["angle"] / self.gear, 2.0 * np.pi)
        of_torque = {**{name: s[name] for name in ("I", "w", "V", "t")}, "angle": turn}
        if "transmission" not in recording.equations:
            of_torque["w"] = s["w_by_voltage"]
        measured_I = signals.smooth(recording.table, recording.table["current_A"], SLOW)
        of_speed = {**of_torque, "w": s["w_by_voltage"], "I": measured_I}
        made = {"electric": of_voltage, "mechanical": of_torque, "transmission": of_speed}
        return {name: made[name] for name in recording.equations}

    def features(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """More groups of columns (n, k) for that look: waves over the rotor's angle, also as large as V or I."""
        s = recording.signals
        groups = {}
        sizes = {"": np.ones_like(s["V"]), " as large as the voltage": s["V"], " as large as the current": s["I"]}
        for kind, size in sizes.items():
            for low in range(1, MOST_WAVES + 1, 4):
                each = [wave * size for n in range(low, low + 4) for wave in waves(recording, self.gear, n)]
                groups[f"{low} to {low + 3} waves a turn of the rotor{kind}"] = column(*each)
        return {"mechanical": groups}

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """The catalogue's causes that such a bench can have."""
        top_w = max(float(np.quantile(np.abs(r.signals["w"]), 0.98)) for r in recordings)
        top_I = max(float(np.quantile(np.abs(r.signals["I"]), 0.98)) for r in recordings)
        top_V = max(float(np.max(np.abs(r.signals["V"]))) for r in recordings)
        made = _electric(top_I, top_V, all("warmth" in r.signals for r in recordings))
        made += _sensors(self.gear, top_w, top_V)
        made += _friction(top_w)
        made += _periodic(self.gear)
        if all("transmission" in r.equations for r in recordings):
            made += _transmission()
        return made


def _same_motion(table: Table, angle: Array, w: Array) -> None:
    """UserError when the rotor's angle over the gear and the speed are not the same motion, or not in one unit.

    Twist, slip and lost counts are a part of it; what moves otherwise, or some times as fast, is no fault of a machine.
    """
    turning, speed = signals.derivative(table, angle, CALM), signals.smooth(table, w, CALM)
    if len(table) < 10 * CALM or not np.std(turning) > 0.0 or not np.std(speed) > 0.0:
        return
    factor = float(np.std(turning) / np.std(speed))
    alike = float(np.corrcoef(turning, speed)[0, 1])
    if abs(alike) < SAME_MOTION:
        raise UserError(
            f"{table.name}: motor_angle_rad and speed_rad_per_s are not the same motion (correlation {alike:.2f}); "
            "nothing is concluded from such data"
        )
    if alike < 0.0 or not 1.0 / SAME_SPEED < factor < SAME_SPEED:
        told = f"{factor:.3g} times as fast" if alike > 0.0 else "the other way round"
        raise UserError(
            f"{table.name}: motor_angle_rad over the gear turns {told} as speed_rad_per_s: another gear (--gear), or "
            "one of the two in another unit; nothing is concluded from such data"
        )


def _away(values: Array, limit: float, reach: int) -> np.ndarray:
    """True where the values stay `limit` away from 0, also `reach` samples before and after."""
    near = np.abs(values) < limit
    return np.convolve(near, np.ones(2 * reach + 1), mode="same") < 0.5


def _one_sign(values: Array) -> np.ndarray:
    """False for the two samples on either side of a change of sign: within them the acceleration jumps."""
    crossed = np.zeros(len(values), dtype=bool)
    crossed[1:] = values[1:] * values[:-1] < 0.0
    crossed[:-1] |= crossed[1:]
    return np.convolve(crossed, np.ones(3), mode="same") < 0.5


def _mean_sign(values: Array) -> Array:
    """(n,) mean sign over each sample, the values being straight lines between."""
    ends = np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]))
    rise = np.diff(ends)
    crossing = ends[1:] * ends[:-1] < 0.0
    mean = np.divide(np.diff(np.abs(ends)), rise, out=np.zeros_like(values), where=crossing)
    return np.where(crossing, mean, np.sign(values))


def _current_by_torque(T: Array, I: Array, s: Mapping[str, Array]) -> Array:  # noqa: E741
    """Current that the measured torque asks for, by a rough fit of the mechanical balance."""
    loaded = -s["sgn_w"] * np.sign(s["I"])
    rest = np.column_stack([s["sgn_w"], s["w"], s["dw"]])
    found = np.linalg.lstsq(np.column_stack([s["I"], loaded * s["I"], rest]), T, rcond=None)[0]
    per_ampere = found[0] + found[1] * loaded
    least = 0.2 * max(abs(float(found[0])), 1e-9)
    return (T - rest @ found[2:]) / np.where(np.abs(per_ampere) > least, per_ampere, least)


def _rough_electrics(V: Array, I: Array, w: Array) -> tuple[float, float, float]:  # noqa: E741
    """(R, V_c, K G) by plain least squares; good enough for a stand-in.

    Only where current surely flows: below the brushes' drop the sign of its noise would make the drop small.
    """
    flows = np.abs(I) > FLOWS * float(np.quantile(np.abs(I), 0.98))
    found = np.linalg.lstsq(np.column_stack([I, np.sign(I), w])[flows], V[flows], rcond=None)[0]
    resistance, drop, constant = (float(each) for each in found)
    return max(resistance, 1e-6), max(drop, 0.0), constant


def _current(V: Array, w: Array, resistance: float, drop: float, constant: float) -> Array:
    """What flows by the electric equation: nothing while the driving voltage stays below the brushes' drop."""
    driving = V - constant * w
    return np.sign(driving) * np.maximum(np.abs(driving) - drop, 0.0) / resistance


def _spread(difference: Array, where: np.ndarray) -> float:
    """Standard deviation of most of it: outliers have no say."""
    part = difference[where] if np.any(where) else difference
    return float(np.median(np.abs(part - np.median(part)))) / 0.6745


def _inner(table: Table, reach: int) -> np.ndarray:
    """False for so many rows at either end of each piece: Gaussians and differences are one-sided there."""
    inner = np.zeros(len(table), dtype=bool)
    for run in table.runs:
        inner[run.start + reach : run.stop - reach] = True
    return inner


def _own_noise(value: Array, second: Array, third: Array, where: np.ndarray, least: float) -> float:
    """Standard deviation of a value's own noise, from two others of the same quantity whose noises are independent.

    The three-cornered hat of clocks: half of what the value's differences to both have more than theirs to each other;
    at least so much of its difference to the second.
    """
    apart = [_spread(one - other, where) ** 2 for one, other in ((value, second), (value, third), (second, third))]
    return math.sqrt(max(0.5 * (apart[0] + apart[1] - apart[2]), least**2 * apart[0]))


def _no_jump(values: Array, limit: float, reach: int) -> np.ndarray:
    """True where nothing jumps, also `reach` samples before and after: between two samples nobody knows when it was.

    A jump is a step larger than `limit` times that which a sine over all values would make in a fiftieth of its period.
    """
    step = np.abs(np.diff(values, prepend=values[0]))
    sized = limit * (float(np.ptp(values)) or 1.0)
    return np.convolve(step > sized, np.ones(2 * reach + 1), mode="same") < 0.5


def _regimes(s: Mapping[str, Array], moving: np.ndarray) -> dict[str, np.ndarray]:
    """Rows by what the machine does: standstill, low speed, cruise, accelerating; signs of rate and power."""
    speed = np.abs(s["w"])
    top = float(np.quantile(speed, 0.98))
    changing = np.abs(s["dw"]) > float(np.quantile(np.abs(s["dw"]), 0.8))
    power = s["I"] * s["w"]
    return {
        "standstill": ~moving,
        "low speed": moving & (speed < 0.2 * top),
        "cruise": moving & (speed >= 0.2 * top) & ~changing,
        "accelerating": moving & changing,
        "forward": moving & (s["w"] > 0),
        "backward": moving & (s["w"] < 0),
        "driving": moving & (power > 0),
        "braking": moving & (power < 0),
    }


Made = Callable[[Recording, Shape, Values], Columns]


def _one(equation: str, make: Callable[[Mapping[str, Array], Shape, Values], Array]) -> Made:
    """An effect's `columns` for one equation and one coefficient."""
    return lambda r, shape, values: {equation: column(make(r.signals, shape, values))}


def _ones(s: Mapping[str, Array], _: Shape, __: Values) -> Array:
    return np.ones_like(s["V"])


def over(values: Array, limit: float) -> Array:
    """What of the values lies beyond the limit, either way."""
    return np.sign(values) * np.maximum(np.abs(values) - limit, 0.0)


def _minus(name: str) -> Callable[[Mapping[str, Array], Shape, Values], Array]:
    return lambda s, _, __: -s[name]


def _heat(r: Recording, shape: Shape) -> Array:
    """What warms with the winding's losses: measured, or I^2 behind a first-order filter."""
    if shape["time_constant_s"] == 0.0:
        return r.signals["warmth"]
    return signals.lagged(r.table, r.signals["I"] ** 2, shape["time_constant_s"])


def _electric(top_I: float, top_V: float, warmth: bool) -> list[Effect]:
    heats = [{"time_constant_s": time_s} for time_s in ((0.0,) if warmth else ()) + HEAT_TIMES_S]
    E = "electrical"

    def torque_constant(r: Recording, shape: Shape, _: Values) -> Columns:
        heat = _heat(r, shape)
        return {"electric": column(r.signals["w"] * heat), "mechanical": column(r.signals["I"] * heat)}

    def two_heats(r: Recording, shape: Shape, _: Values) -> Columns:
        """The winding is as warm as its housing, and warmer by its own losses and by what was left from before."""
        current = r.signals["I_by_torque"]
        own = signals.lagged(r.table, r.signals["I"] ** 2, shape["winding_time_s"])
        left = np.exp(-r.signals["t"] / shape["winding_time_s"])
        return {"electric": column(current * r.signals["warmth"], current * own, current * left)}

    above_housing = [
        Effect(
            "resistance_temperature",
            "hip_motor",
            E,
            ("ohm_per_heat", "ohm_per_A2", "ohm_at_start"),
            [{"winding_time_s": time_s} for time_s in HEAT_TIMES_S if warmth],
            two_heats,
            lambda found: found["ohm_per_heat"] > 0.0 and found["ohm_per_A2"] > 0.0,
            "resistance that grows with the winding's temperature",
            form="winding and housing",
            free=("ohm_at_start",),
        )
    ]
    return [
        Effect(
            "contact_drop_change",
            "hip_motor",
            E,
            ("change_V",),
            [{"current_A": share * top_I} for share in CURRENT_SHARES],
            _one("electric", lambda s, p, _: s["sgn_I"] * (1.0 - np.exp(-np.abs(s["I_by_torque"]) / p["current_A"]))),
            meaning="a drop at the brushes that depends on the current",
            scale="current_A",
        ),
        Effect(
            "resistance_temperature",
            "hip_motor",
            E,
            ("ohm_per_heat",),
            heats,
            lambda r, p, _: {"electric": column(r.signals["I_by_torque"] * _heat(r, p))},
            lambda found: found["ohm_per_heat"] > 0.0,
            "resistance that grows with the winding's temperature",
            form="one heat",
        ),
        *above_housing,
        Effect("torque_constant_temperature", "hip_motor", E, ("per_heat",), heats, torque_constant),
        Effect(
            "dead_time",
            "hip_motor",
            E,
            ("drop_V",),
            [{}],
            _one("electric", lambda s, p, _: s["sgn_I"] * (np.abs(s["V_by_torque"]) > 0.02 * top_V)),
            meaning="a drop against the current while the bridge switches",
        ),
        Effect(
            "battery_sag",
            "supply",
            E,
            ("per_A",),
            [{}],
            _one("electric", lambda s, p, _: s["V_by_torque"] * np.abs(s["I_by_torque"])),
        ),
        Effect(
            "charge_drift",
            "supply",
            E,
            ("per_As",),
            [{}],
            lambda r, p, _: {
                "electric": column(r.signals["V_by_torque"] * signals.integral(r.table, np.abs(r.signals["I"])))
            },
        ),
        Effect(
            "voltage_clip",
            "voltage_V",
            E,
            ("share",),
            [{"limit_V": share * top_V} for share in (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)],
            _one("electric", lambda s, p, _: over(s["V_by_torque"], p["limit_V"])),
            scale="limit_V",
        ),
        Effect(
            "pwm_ripple",
            "hip_motor",
            E,
            ("V_per_V",),
            [{}],
            _one("electric", lambda s, p, _: s["V_by_torque"] * (1.0 - np.abs(s["V_by_torque"]) / top_V)),
        ),
    ]


def _sensors(gear: float, top_w: float, top_V: float) -> list[Effect]:
    S = "sensor"

    def current_offset(mask: Callable[[Array], Array]) -> Made:
        def made(r: Recording, _: Shape, v: Values) -> Columns:
            where = mask(r.signals["V"])
            return {
                "electric": column(-v["resistance_ohm"] * mask(r.signals["V_by_torque"])),
                "mechanical": column(
                    -(
                        v["torque_constant_Nm_per_A"]
                        - v["load_friction_Nm_per_A"] * r.signals["sgn_w"] * r.signals["sgn_I"]
                    )
                    * where
                ),
            }

        return made

    def speed_offset(r: Recording, _: Shape, v: Values) -> Columns:
        ones = np.ones(len(r.table))
        return {
            "electric": column(-v["torque_constant_Nm_per_A"] * ones),
            "mechanical": column(v["viscous_friction_Nms"] * ones),
            "transmission": column(-ones),
        }

    def current_lag(r: Recording, _: Shape, v: Values) -> Columns:
        s = r.signals
        return {
            "electric": column(v["resistance_ohm"] * s["dI"]),
            "mechanical": column(v["torque_constant_Nm_per_A"] * s["dI"]),
        }

    def speed_lag(r: Recording, _: Shape, v: Values) -> Columns:
        s = r.signals
        return {
            "electric": column(v["torque_constant_Nm_per_A"] * s["dw"]),
            "mechanical": column(-v["viscous_friction_Nms"] * s["dw"]),
            "transmission": column(s["dw"]),
        }

    def eccentric_speed(r: Recording, shape: Shape, v: Values) -> Columns:
        """The output's encoder: once or twice per turn of the output."""
        s = r.signals
        angle = shape["periods_per_turn"] * s["angle"] / gear
        error, other = s["w"] * np.cos(angle), s["w"] * np.sin(angle)
        k = v["torque_constant_Nm_per_A"]
        return {"electric": column(-k * error, -k * other), "transmission": column(-error, -other)}

    def eccentric_angle(r: Recording, shape: Shape, _: Values) -> Columns:
        """The rotor's encoder: once or twice per turn of the rotor."""
        angle = shape["periods_per_turn"] * r.signals["angle"]
        return {T: column(*(np.gradient(f(angle), r.table.step_s) / gear for f in (np.cos, np.sin)))}

    def lost_angle(r: Recording, shape: Shape, _: Values) -> Columns:
        return {T: column(-over(r.signals["w_by_voltage"], shape["speed_rad_s"]))}

    def lost_speed(r: Recording, shape: Shape, v: Values) -> Columns:
        s = r.signals
        in_voltage = v["torque_constant_Nm_per_A"] * over(s["w"], shape["speed_rad_s"])
        return {"electric": column(in_voltage), T: column(over(s["w_by_voltage"], shape["speed_rad_s"]))}

    def drifting(s: Mapping[str, Array], _: Shape, __: Values) -> Array:
        return s["t"] * s["dT"]

    T = "transmission"
    fast = [{"speed_rad_s": share * top_w} for share in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)]
    turns = [{"periods_per_turn": n} for n in (1.0, 2.0)]
    return [
        # I measured = (1 + change) I: the torque constant counts as so much smaller, in this equation alone
        Effect(
            "sensor_scale",
            "current_A",
            S,
            ("change",),
            [{}],
            _one("mechanical", lambda s, _, v: -v["torque_constant_Nm_per_A"] * s["I"]),
        ),
        Effect("sensor_offset", "voltage_V", S, ("offset_V",), [{}], _one("electric", _ones)),
        Effect("sensor_offset", "current_A", S, ("offset_A",), [{}], current_offset(np.ones_like)),
        Effect("sensor_offset", "torque_Nm", S, ("offset_Nm",), [{}], _one("mechanical", _ones)),
        Effect("sensor_offset", "speed_rad_per_s", S, ("offset_rad_s",), [{}], speed_offset),
        Effect(
            "current_step_at_zero_duty",
            "current_A",
            S,
            ("offset_A",),
            [{}],
            current_offset(lambda voltage: np.tanh(voltage / (0.02 * top_V))),
        ),
        Effect("sensor_lag", "voltage_V", S, ("time_constant_s",), [{}], _one("electric", _minus("dV"))),
        Effect("sensor_lag", "current_A", S, ("time_constant_s",), [{}], current_lag),
        Effect("sensor_lag", "speed_rad_per_s", S, ("time_constant_s",), [{}], speed_lag),
        Effect("sensor_lag", "torque_Nm", S, ("time_constant_s",), [{}], _one("mechanical", _minus("dT"))),
        Effect("eccentricity", "speed_rad_per_s", S, ("cosine", "sine"), turns, eccentric_speed, phase_is_free=True),
        Effect("eccentricity", "motor_angle_rad", S, ("cosine_rad", "sine_rad"), turns, eccentric_angle, phase_is_free=True),  # noqa: E501
        Effect("lost_counts", "speed_rad_per_s", S, ("share",), fast, lost_speed, scale="speed_rad_s"),
        Effect("lost_counts", "motor_angle_rad", S, ("share",), fast, lost_angle, scale="speed_rad_s"),
        Effect("clock_drift", "torque_Nm", S, ("share",), [{}], _one("mechanical", drifting)),
    ]  # fmt: skip


def _friction(top_w: float) -> list[Effect]:
    M = "mechanical"
    speeds = [{"speed_rad_s": share * top_w} for share in SPEED_SHARES]

    def presliding(r: Recording, shape: Shape, v: Values) -> Columns:
        s = r.signals
        limit = v["constant_friction_Nm"] + v["load_friction_Nm_per_A"] * np.abs(s["I"])
        return {"mechanical": column(limit * (s["sgn_w"] - bristles(r, s["w"], shape["deflection_rad"])))}

    def warm_up(r: Recording, shape: Shape, _: Values) -> Columns:
        s = r.signals
        worked = signals.lagged(r.table, np.abs(s["w"]), shape["time_constant_s"])
        return {"mechanical": column(s["sgn_w"] * worked)}

    def direction(kind: str) -> Made:
        def made(s: Mapping[str, Array], _: Shape, __: Values) -> Array:
            return -np.ones_like(s["w"]) if kind == "coulomb" else -np.abs(s["w"])

        return _one("mechanical", made)

    return [
        Effect(
            "stribeck",
            "hip_motor",
            M,
            ("excess_Nm",),
            speeds,
            _one("mechanical", lambda s, p, _: -s["sgn_w"] * np.exp(-((s["w"] / p["speed_rad_s"]) ** 2))),
            lambda found: found["excess_Nm"] > 0.0,
            "friction that is larger at low speed",
            scale="speed_rad_s",
        ),
        Effect(
            "presliding",
            "hip_motor",
            M,
            ("share_of_friction",),
            [{"deflection_rad": way} for way in DEFLECTIONS_RAD],
            presliding,
            lambda found: 0.3 < found["share_of_friction"] < 3.0,
            "friction that builds up over a way after a reversal",
            scale="deflection_rad",
        ),
        Effect(
            "load_friction",
            "hip_motor",
            M,
            ("per_A",),
            [{}],
            _one("mechanical", lambda s, p, _: -np.abs(s["I"]) * s["sgn_w"] * (s["I"] * s["w"] > 0.0)),
            meaning="friction under load that differs between driving and being driven",
        ),
        Effect("direction_friction", "hip_motor", M, ("coulomb_Nm",), [{}], direction("coulomb")),
        Effect("direction_friction", "hip_motor", M, ("viscous_Nms",), [{}], direction("viscous")),
        Effect(
            "friction_warm_up",
            "hip_motor",
            M,
            ("Nm_s_per_rad",),
            [{"time_constant_s": time_s} for time_s in HEAT_TIMES_S],
            warm_up,
            lambda found: found["Nm_s_per_rad"] > 0.0,
            "friction that falls as the gearbox warms",
        ),
        Effect(
            "drag",
            "hip_motor",
            M,
            ("quadratic_Nms2",),
            [{}],
            _one("mechanical", lambda s, p, _: -s["w"] * np.abs(s["w"])),
            lambda found: found["quadratic_Nms2"] > 0.0,
        ),
    ]


def waves(r: Recording, gear: float, periods_per_turn: float, through_speed: bool = True) -> tuple[Array, Array]:
    """Cosine and sine of so many periods a turn of the rotor; nothing where samples do not follow them.

    through_speed: as much smaller as the speed's difference over two samples shows them.
    """
    advance = np.abs(periods_per_turn * gear * r.signals["w"]) * r.table.step_s  # rad of the wave in a sample
    size = np.where(advance < 2.0 * np.pi / SAMPLES_A_WAVE, 1.0, 0.0)
    if through_speed:
        size = size * np.sinc(advance / np.pi)
    angle = periods_per_turn * r.signals["angle"]
    return size * np.cos(angle), size * np.sin(angle)


def _periodic(gear: float) -> list[Effect]:
    M = "mechanical"
    each = [{"periods_per_turn": float(n)} for n in range(1, MOST_PERIODS + 1)]

    def cogging(r: Recording, shape: Shape, _: Values) -> Columns:
        return {"mechanical": column(*waves(r, gear, shape["periods_per_turn"]))}

    def commutation(r: Recording, shape: Shape, v: Values) -> Columns:
        """K itself ripples: in the torque and in the voltage that the turning rotor makes."""
        k = v["torque_constant_Nm_per_A"]
        periods = shape["periods_per_turn"]
        return {
            "electric": column(*(k * r.signals["w"] * each for each in waves(r, gear, periods, through_speed=False))),
            "mechanical": column(*(k * r.signals["I"] * each for each in waves(r, gear, periods))),
        }

    def turn(r: Recording, shape: Shape, _: Values) -> Columns:
        angle = shape["periods_per_turn"] * r.signals["angle"] / gear
        return {"mechanical": column(np.cos(angle), np.sin(angle))}

    return [
        Effect("cogging", "hip_motor", M, ("cosine_Nm", "sine_Nm"), each, cogging, phase_is_free=True),
        Effect("commutation_ripple", "hip_motor", M, ("cosine", "sine"), each, commutation, phase_is_free=True),
        Effect("once_per_turn", "hip_joint", M, ("cosine_Nm", "sine_Nm"), each[:3], turn, phase_is_free=True),
    ]  # fmt: skip


def _torque(r: Recording, v: Values, share_of_inertia: float = 1.0) -> Array:
    """Torque behind the gearbox by the model, with so much of the rotor's inertia before it; the load cell's noise is
    not in it."""
    s = r.signals
    pulls = (v["torque_constant_Nm_per_A"] - v["load_friction_Nm_per_A"] * s["sgn_w"] * np.sign(s["I"])) * s["I"]
    rest = v["constant_friction_Nm"] * s["sgn_w"] + v["viscous_friction_Nms"] * s["w"]
    return np.asarray(pulls - rest - share_of_inertia * v["inertia_kg_m2"] * s["dw"])


def _transmission() -> list[Effect]:
    T = "transmission"

    def play(r: Recording, shape: Shape, v: Values) -> Columns:
        """The output lies against the flank that carries the load, and crosses the gap in some milliseconds."""
        load = _torque(r, v, shape["share_of_inertia"])
        flank = signals.lagged(r.table, np.tanh(load / shape["torque_Nm"]), shape["crossing_s"])
        rate = np.gradient(flank, r.table.step_s)
        jerk = np.gradient(rate, r.table.step_s)
        return {
            "electric": column(v["torque_constant_Nm_per_A"] * rate),
            "mechanical": column(-v["viscous_friction_Nms"] * rate - v["inertia_kg_m2"] * jerk),
            T: column(rate),
        }

    plays = [
        {"share_of_inertia": share, "torque_Nm": load, "crossing_s": time_s}
        for share in (0.0, 0.25, 0.5, 0.75, 1.0)
        for load in (0.02, 0.05)
        for time_s in (0.002, 0.004, 0.008)
    ]
    return [
        Effect("cable_stiffening", T, T, ("rad_per_Nm",), [{}], _one(T, lambda s, p, _: s["dT"])),
        Effect("cable_backlash", T, T, ("half_gap_rad",), plays, play),
        Effect("pulley_slip", T, T, ("share",), [{}], _one(T, lambda s, p, _: s["w_by_voltage"])),
    ]  # fmt: skip


def bristles(r: Recording, rate: Array, slide: float) -> Array:
    """Dahl's state over its limit: goes to the sign of the rate over a way of `slide`, run by run."""
    way = rate * r.table.step_s / slide
    keep = np.exp(-np.abs(way)).tolist()
    sign = np.sign(way).tolist()
    out, state = [], 0.0
    starts = {run.start for run in r.table.runs}
    for number, (share, direction) in enumerate(zip(keep, sign, strict=True)):
        if number in starts:
            state = 0.0
        state = direction + (state - direction) * share if direction else state
        out.append(state)
    return np.asarray(out)
