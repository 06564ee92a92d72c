"""A geared brushed motor on the bench: voltage, current, speed and torque at the output of its gearbox.

    electric     V = R I + V_c sgn I + K G w + L dI/dt                                        appendix eq. 32
    mechanical   T = K G I - C_0 sgn w - C_1 w - mu K G |I| sgn w - J dw/dt                   appendix eq. 33, 35
    transmission dtheta_m/dt / G = w                            where the motor's angle is measured as well

K is in both: a change of one side of it only is a sensor's scale. Near standstill friction may be anything up to
its limit (eq. 35), and near zero current so may the brushes' drop: rows whose sign is within the noise do not count.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machine import Columns, Effect, Equation, Known, Quantity, Recording, Values
from ranger_sim.sysid.machines.forms import Made, Shape
from ranger_sim.sysid.machines.motor_bench.electrical import electrical
from ranger_sim.sysid.machines.motor_bench.friction import friction
from ranger_sim.sysid.machines.motor_bench.rotor import periodic
from ranger_sim.sysid.machines.motor_bench.rows import Rows, rows_of
from ranger_sim.sysid.machines.motor_bench.sensors import sensors
from ranger_sim.sysid.machines.motor_bench.stand_ins import (
    away,
    current_by_torque,
    current_by_voltage,
    inner,
    mean_sign,
    no_jump,
    one_sign,
    own_noise,
    rough_electrics,
    spread,
)
from ranger_sim.sysid.machines.motor_bench.transmission import transmission

CALM = 20.0  # samples; Gaussian of two speeds for their comparison
SLOW = 5.0  # samples; Gaussian of signals that must not have the noise of a derivative
TORQUE = 7.0  # samples; at 5 its derivative's noise makes a lag too small by a fifth, at 10 it loses fast changes
FINE = 2.0  # samples; Gaussian of the speed by the angle: its counts are small, and a reversal keeps its place
REACH = 4  # samples about a jump or a standstill that do not count: two deviations of the finer Gaussian
JUMP_IN_STEPS = 0.06  # of the whole range, within one sample
SIGN_IN_NOISE = 4.0  # deviations of noise within which a sign means nothing
# Least own noise of a stand-in, of its difference to the measurement. Three spreads cannot estimate less of a current;
# and a friction that changes its sign within 0.05 rad/s is not a cause.
OWN_I, OWN_W = 0.3, 0.5
SIMPSON = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)  # mean over two rows, by three values
HALF_WAY, AS_WELL = 0.25, 1.05  # rows about half a row, times what a lag of any size leaves
SAME_MOTION = 0.7  # correlation of angle and speed; slip and lost counts leave more
SAME_SPEED = 2.0  # times: rpm, degrees and thousands are more


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
            # below zero by what a channel a few milliseconds late does to it, at any sampling
            Known("inductance_H", "H", 1e-4, -0.005, 0.1, "of the winding; next to nothing at this sampling"),
            Known("constant_friction_Nm", "N m", 0.01, 0.0, 1.0, "of motor and gearbox"),
            Known("viscous_friction_Nms", "N m s/rad", 0.0, -0.01, 1.0, "of motor and gearbox"),
            Known("load_friction_Nm_per_A", "N m/A", 0.1 * k, 0.0, 10.0 * k, "mu K G"),
            Known("inertia_kg_m2", "kg m^2", 1.6e-6 * gear * gear, 0.0, 1.0, "of the rotor as the output feels it"),
        )

    def prepare(self, table: Table) -> Recording:
        """Signals and the two or three equations of one recording."""
        missing = [each.name for each in self.quantities if each.needed and each.name not in table]
        if missing:
            raise ModelError(
                f"{table.name}: {self.name} needs {', '.join(missing)}; there are {', '.join(table.columns)}"
            )
        table = signals.uniform(table)
        V, I, w, T = (table[each.name] for each in self.quantities[:4])  # noqa: E741  (the paper's letters)
        s: dict[str, Array] = {"V": V, "t": table.elapsed_s}
        measured = "motor_angle_rad" in table
        s["angle"] = table["motor_angle_rad"] if measured else self.gear * signals.integral(table, w)
        if measured:
            _same_motion(table, s["angle"] / self.gear, w)
        # stand-ins: speed by the angle, current by voltage and speed; neither has the noise of the measured column
        s["w"] = signals.derivative(table, s["angle"], FINE) / self.gear if measured else signals.smooth(table, w, FINE)
        s["dw"] = np.gradient(signals.smooth(table, s["w"], SLOW), table.step_s)
        rough = rough_electrics(V, I, s["w"])
        _one_way(table, V - rough[0] * I - rough[1] * np.sign(I), s["w"])
        s["I"] = current_by_voltage(V, s["w"], *rough)
        s["w_by_voltage"] = signals.smooth(table, V - rough[0] * I - rough[1] * np.sign(s["I"]), SLOW) / rough[2]
        if not measured:
            s["dw"] = np.gradient(s["w_by_voltage"], table.step_s)
        s["dI"] = np.gradient(s["I"], table.step_s)
        s["dT"] = signals.derivative(table, T, TORQUE)
        s["dV"] = np.gradient(V, table.step_s)
        steady = no_jump(V, JUMP_IN_STEPS, REACH) & inner(table, int(3.0 * SLOW))
        s["sgn_I"], s["sgn_w"] = mean_sign(s["I"]), mean_sign(s["w"])
        # the signals that sort the electric balance must not have the voltage's or the current's own noise
        s["I_by_torque"] = signals.smooth(table, current_by_torque(T, I, s), SLOW)
        s["V_by_torque"] = rough[0] * s["I_by_torque"] + rough[1] * s["sgn_I"] + rough[2] * s["w"]
        noise_I = own_noise(s["I"], I, s["I_by_torque"], steady, OWN_I)
        noise_w = spread(w - s["w"], steady)
        if measured:
            noise_w = own_noise(s["w"], w, s["w_by_voltage"], steady, OWN_W)
        if "temperature_C" in table:
            s["warmth"] = signals.smooth(table, table["temperature_C"], 50.0) - 25.0
        firm_I = steady & away(s["I"], SIGN_IN_NOISE * noise_I, REACH) & one_sign(s["I"])
        firm_w = steady & away(s["w"], SIGN_IN_NOISE * noise_w, 2) & one_sign(s["w"])
        loaded = -s["sgn_w"] * np.sign(s["I"])
        mechanical = rows_of(table, rough, s, w, T, firm_w)
        ways = {"voltage_V": "held"} if mechanical.held else {}
        if mechanical.held:  # where current or friction changes its sign within a row, its mean is another one
            firm_w &= firm_I
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
                mechanical.mean(T),
                {
                    "torque_constant_Nm_per_A": mechanical.current(I, w),
                    "constant_friction_Nm": -mechanical.mean(s["sgn_w"]),
                    "viscous_friction_Nms": -mechanical.mean_speed(w),
                    "load_friction_Nm_per_A": loaded * mechanical.current(I, w),
                    "inertia_kg_m2": -mechanical.slope(w),
                },
                firm_w,
                {
                    "torque_constant_Nm_per_A": mechanical.current(s["I"], s["w"]),
                    "viscous_friction_Nms": -mechanical.mean_speed(s["w"]),
                    "load_friction_Nm_per_A": loaded * mechanical.current(s["I"], s["w"]),
                    "inertia_kg_m2": -(mechanical.slope(s["w"]) if mechanical.held else s["dw"]),
                },
            ),
        }
        if measured:
            turning = np.gradient(s["angle"], table.step_s) / self.gear
            no_kink = no_jump(V, JUMP_IN_STEPS, 1) & inner(table, REACH)  # Simpson's rule takes the speed for smooth
            follows = no_kink & firm_w if mechanical.held else no_kink
            mean_w, ways["speed_rad_per_s"] = _mean_speed(turning, w, no_kink, mechanical)
            equations["transmission"] = Equation(
                "transmission", "T", "transmission", "rad/s", turning - mean_w, {}, follows, lines=False
            )
        regimes = _regimes(s, firm_w)
        return Recording(table, s, equations, regimes, firm=True, between_rows=ways)

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which each equation is examined without a cause in mind."""
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

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """The catalogue's causes that such a bench can have."""
        top_w = max(float(np.quantile(np.abs(r.signals["w"]), 0.98)) for r in recordings)
        top_I = max(float(np.quantile(np.abs(r.signals["I"]), 0.98)) for r in recordings)
        top_V = max(float(np.max(np.abs(r.signals["V"]))) for r in recordings)
        made = electrical(top_I, top_V, all("warmth" in r.signals for r in recordings))
        made += sensors(self.gear, top_w, top_V)
        made += friction(top_w)
        made += periodic(self.gear)
        if all("transmission" in r.equations for r in recordings):
            made += transmission()
        return [dataclasses.replace(each, columns=_as_the_balance(each.columns)) for each in made]


def _as_the_balance(make: Made) -> Made:
    """Columns of an effect; in the mechanical balance means where it is one of means."""

    def columns(r: Recording, shape: Shape, values: Values) -> Columns:
        found = make(r, shape, values)
        if "voltage_V" in r.between_rows and "mechanical" in found:
            mean = Rows(r.table, True, 0.0).mean
            found["mechanical"] = np.column_stack([mean(each) for each in found["mechanical"].T])
        return found

    return columns


def _mean_speed(turning: Array, w: Array, counts: np.ndarray, rows: Rows) -> tuple[Array, str]:
    """(mean of the speed over the two rows of the angle's slope, way of the speed's samples), by what it leaves.

    Simpson's rule where angle and speed are samples of a kind, points or means; row by row where a held voltage
    bends the speed at every row. Where the speed alone is a mean over
    the time from row to row, the two means are exact; then Simpson's rule with a lag of any size leaves no less.
    """
    like = np.convolve(w, SIMPSON, mode="same")
    if rows.held:
        after = rows.mean_speed(w)
        like = 0.5 * (after + np.append(after[:1], after[:-1]))
    left, slope = (turning - like)[counts], np.gradient(w)[counts]
    lag = float(slope @ left) / max(float(slope @ slope), 1e-300)  # rows by which the angle is early
    ways = {
        "a mean after its row": (-0.5, 0.5 * (w + np.append(w[:1], w[:-1]))),
        "a mean before its row": (0.5, 0.5 * (w + np.append(w[1:], w[-1:]))),
    }
    for name, (early, mean) in ways.items():
        rest = float(np.linalg.norm((turning - mean)[counts]))
        if abs(lag - early) < HALF_WAY and rest <= AS_WELL * float(np.linalg.norm(left - lag * slope)):
            return mean, name
    return like, "like the angle"


def _same_motion(table: Table, angle: Array, w: Array) -> None:
    """Raise UserError when the rotor's angle over the gear and the speed are different motions or in different units.

    Twist, slip and lost counts are a part of it; other motion, or a multiple of the speed, is not a machine's fault.
    """
    turning, speed = signals.derivative(table, angle, CALM), signals.smooth(table, w, CALM)
    if len(table) < 10 * CALM or not np.std(turning) > 0.0 or not np.std(speed) > 0.0:
        return
    factor = float(np.std(turning) / np.std(speed))
    alike = float(np.corrcoef(turning, speed)[0, 1])
    if abs(alike) < SAME_MOTION:
        raise ModelError(
            f"{table.name}: motor_angle_rad and speed_rad_per_s are not the same motion (correlation {alike:.2f}); "
            "nothing is concluded from such data"
        )
    if alike < 0.0 or not 1.0 / SAME_SPEED < factor < SAME_SPEED:
        told = f"{factor:.3g} times as fast" if alike > 0.0 else "the other way round"
        raise ModelError(
            f"{table.name}: motor_angle_rad over the gear turns {told} as speed_rad_per_s: another gear (--gear), or "
            "one of the two in another unit; nothing is concluded from such data"
        )


def _one_way(table: Table, induced: Array, w: Array) -> None:
    """Raise UserError when the voltage without the winding's drop opposes the speed: no motor turns so."""
    if np.std(induced) > 0.0 and np.std(w) > 0.0 and float(np.corrcoef(induced, w)[0, 1]) < -SAME_MOTION:
        raise ModelError(
            f"{table.name}: voltage_V and speed_rad_per_s have opposite signs: what resistance and brushes leave of "
            "the voltage goes against the speed; nothing is concluded from such data"
        )


def _regimes(s: Mapping[str, Array], moving: np.ndarray) -> dict[str, np.ndarray]:
    """Rows by the machine's state: standstill, low speed, cruise, accelerating; signs of rate and power."""
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
