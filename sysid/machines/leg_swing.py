"""A leg that hangs from the hip, swung by the hip's motor: angle, current, and the motor's voltage if measured.

    electric     I = (V - K q' - V_c sgn I) / R - (L / R) dI/dt, nothing inside the drop           appendix eq. 32
    mechanical   J q'' = K I - k_h q - m g (c sin q - w cos q) - C_1 q' - (C_0 + mu K |I|) sgn q'      eq. 33 to 35

q from the vertical, K at the joint, gear included. m c is known (from the leg held level, appendix 7.2): without
one known torque nothing here has a scale. The leg is simulated (sysid/free_simulation): driven by the measured
voltage, with angle and current as outputs; without a voltage driven by the measured current, and then the leg follows
the current's noise.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.free_simulation import (
    Output,
    Port,
    Ports,
    Quantities,
    Shape,
    SimulatedMachine,
    SimulatedRecording,
    Term,
    held,
    standing,
)
from ranger_sim.sysid.machine import Effect, Known, Quantity, Recording, Values
from ranger_sim.sysid.machines.forms import (
    CURRENT_SHARES,
    HEAT_TIMES_S,
    MOST_PERIODS,
    SPEED_SHARES,
    bristles,
)

FIRST_MOMENT_KG_M = 0.72  # c m of a leg, appendix table 2
GRAVITY_M_PER_S2 = 9.81
HIP_GEAR = 66.0
GUESS_S = 0.02  # Gaussian for the angle's first guess: ten times faster than the leg's own swing
CURRENT_S = 0.003  # Gaussian for a current or a voltage whose slope multiplies a sensor's lag
# Gaussian for the driving signal whose slope multiplies the inductance. Without it the slope is mostly the voltage's
# noise: the fit returned L = 0, and the inductance's share of every jump went into V_c. Chosen by us: half of a
# laboratory supply's own lag, so that jumps keep their shape to a seventh.
SLOPE_S = 0.004
CALM_S = 0.04  # Gaussian for the current that sorts a misfit: four times the memory of a converter's noise
FINE_S = 0.002  # longest step of the integration: friction settles in some milliseconds where it holds
# Where friction holds it may be anything up to its limit (eq. 35). Below this rate it is open (`standing`): such
# stretches carry little information on torques. One count of the encoder (0.77 mrad) takes 0.08 s there. Chosen by us.
STANDSTILL_RAD_S = 0.01
MOVES_RAD_S = 0.03
JUMP_SHARE, JUMP_ROWS = 0.03, 4  # of the voltage's range within a sample; samples before and after. Chosen by us
LARGEST_ECCENTRICITY_RAD = 0.01  # a disc of 10 mm radius that is 0.1 mm off its axis; chosen by us
SLIDES_RAD = (0.0001, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1)
NEAR_ZERO_DUTY = 0.02  # of the largest voltage, within which a sensor's step at zero duty is crossed

M, E, S = "mechanical", "electrical", "sensor"
Made = Callable[[SimulatedRecording, Shape, Values], Ports]


class LegSwing:
    """The leg, driven by the voltage where measured. gear: of its motor; first_moment_kg_m: about the hip."""

    name = "leg-swing"
    quantities = (
        Quantity("hip_angle_rad", "rad", "of the leg from the vertical"),
        Quantity("current_A", "A", "of the hip's motor", drives=True),
        Quantity("voltage_V", "V", "at the motor's terminals", needed=False),
    )

    def __init__(self, gear: float = HIP_GEAR, first_moment_kg_m: float = FIRST_MOMENT_KG_M) -> None:
        self.by_voltage = _Leg(True, gear, first_moment_kg_m)
        self.by_current = _Leg(False, gear, first_moment_kg_m)
        self.parameters = self.by_voltage.parameters

    def prepare(self, table: Table) -> Recording:
        """The leg fitted to one recording."""
        return (self.by_voltage if "voltage_V" in table else self.by_current).prepare(table)

    def effects(self, recordings: Sequence[Recording]) -> list[Effect]:
        """Candidate causes in a swinging leg. UserError when only some of the recordings have the voltage."""
        kinds = {self._of(recording).with_voltage for recording in recordings}
        if len(kinds) > 1:
            without = ", ".join(r.table.name for r in recordings if "voltage_V" not in r.table)
            raise ModelError(f"{without}: no voltage_V, which the other recordings have; diagnose it separately")
        return self._of(recordings[0]).effects(recordings)

    def generic(self, recording: Recording) -> dict[str, dict[str, Array]]:
        """Signals over which a misfit is sought without a cause in mind."""
        return self._of(recording).generic(recording)

    def again(
        self, recording: Recording, effects: Sequence[tuple[Effect, Shape, Sequence[float]]], fixed: bool = False
    ) -> Recording:
        """The recording with these effects in the simulated leg."""
        return self._of(recording).again(recording, effects, fixed)

    def free(self, recording: Recording) -> Recording:
        """The recording as errors of free simulation."""
        return self._of(recording).free(recording)

    def _of(self, recording: Recording) -> "_Leg":
        return self.by_voltage if "voltage_V" in recording.table else self.by_current


class _Leg(SimulatedMachine):
    """Equations of the leg, driven by a voltage or by a current."""

    name = "leg-swing"
    quantities = LegSwing.quantities
    states = ("q", "w")
    shortest_s = 3.0
    free_candidates = False  # its own terms are the catalogue's; a scale of the current is in its parameters

    def __init__(self, with_voltage: bool, gear: float, first_moment_kg_m: float) -> None:
        self.gear, self.with_voltage = gear, with_voltage
        self.weight_Nm = first_moment_kg_m * GRAVITY_M_PER_S2
        k = 0.018 * gear
        # values: appendix tables 2 and 3; limits chosen by us, a hundred times either way
        self.parameters = (
            Known("torque_constant_Nm_per_A", "N m/A", k, 0.0, 100.0 * k, "K at the joint, gear included"),
            Known("inertia_kg_m2", "kg m^2", 0.557, 1e-3, 50.0, "J of leg and rotor about the hip"),
            Known("hip_spring_Nm_per_rad", "N m/rad", 7.6, -100.0, 760.0, "k_h"),
            Known("ahead_kg_m", "kg m", 0.0, -1.0, 1.0, "w m, centre of mass ahead of the leg"),
            Known("constant_friction_Nm", "N m", 0.1, 0.0, 10.0, "C_0 of motor and gearbox"),
            Known("viscous_friction_Nms", "N m s/rad", 0.01, -0.1, 10.0, "C_1 of motor and gearbox"),
            Known("load_friction_Nm_per_A", "N m/A", 0.1 * k, 0.0, 10.0 * k, "mu K"),
        )
        angle = Output("hip_angle_rad", "M", M, "rad")
        self.outputs: tuple[Output, ...] = (angle,)
        self.noisy_inputs = {"I": None}
        self.ports = (
            Port("torque_Nm", "N m", M, "moves"),
            Port("constant_share", "1", M),
            Port("angle_shown_rad", "rad", S),
            Port("current_shown_A", "A", S),
        )
        if with_voltage:
            self.parameters += (
                Known("resistance_ohm", "ohm", 1.3, 0.01, 130.0, "R of winding, brushes and leads"),
                Known("contact_drop_V", "V", 0.7, 0.0, 70.0, "V_c at the brushes, both together"),
                Known("inductance_H", "H", 1e-4, -0.01, 0.1, "L of the winding; next to nothing at this sampling"),
            )
            self.outputs = (angle, Output("current_A", "E", E, "A"))
            self.noisy_inputs = {"V": None}
            self.ports += (Port("drop_V", "V", E),)

    def inputs(self, table: Table) -> dict[str, Array]:
        """Voltage, and the slope of the signal that drives the current; or the current."""
        if not self.with_voltage:
            return {"I": table["current_A"]}
        turning = signals.derivative(table, table["hip_angle_rad"], GUESS_S / table.step_s)
        driving = table["voltage_V"] - self.parameters[0].value * turning
        return {"V": table["voltage_V"], "slope": signals.derivative(table, driving, SLOPE_S / table.step_s)}

    def first_guess(self, table: Table) -> dict[str, Array]:
        """Angle and rate by a Gaussian."""
        width = GUESS_S / table.step_s
        q = table["hip_angle_rad"]
        return {"q": signals.smooth(table, q, width), "w": signals.derivative(table, q, width)}

    def _current(self, w: Array, u: Quantities, p: Quantities) -> Array:
        """Through the winding."""
        if not self.with_voltage:
            return u["I"] - u["current_shown_A"]
        driving = u["V"] - u["drop_V"] - p["torque_constant_Nm_per_A"] * (1.0 + u["constant_share"]) * w
        current = held(driving, p["contact_drop_V"]) / p["resistance_ohm"]
        flows = np.abs(driving) > p["contact_drop_V"]
        return current - flows * p["inductance_H"] * u["slope"] / p["resistance_ohm"] ** 2

    def _torques(self, q: Array, w: Array, u: Quantities, p: Quantities) -> tuple[Array, Array]:
        """(torque without dry friction, limit of dry friction)."""
        current = self._current(w, u, p)
        torque = p["torque_constant_Nm_per_A"] * (1.0 + u["constant_share"]) * current + u["torque_Nm"]
        torque = torque - p["hip_spring_Nm_per_rad"] * q - self.weight_Nm * np.sin(q)
        torque = torque + GRAVITY_M_PER_S2 * p["ahead_kg_m"] * np.cos(q) - p["viscous_friction_Nms"] * w
        return torque, p["constant_friction_Nm"] + p["load_friction_Nm_per_A"] * np.abs(current)

    def _acceleration(self, q: Array, w: Array, u: Quantities, p: Quantities) -> Array:
        torque, friction = self._torques(q, w, u, p)
        return (torque - friction * np.tanh(w / STANDSTILL_RAD_S)) / p["inertia_kg_m2"]

    def step(self, x: Quantities, u: Quantities, p: Quantities, step_s: float) -> Quantities:
        """By the midpoint rule."""
        q, w = x["q"], x["w"]
        parts = max(1, math.ceil(step_s / FINE_S - 1e-9))
        fine_s = step_s / parts
        for _ in range(parts):
            middle = w + 0.5 * fine_s * self._acceleration(q, w, u, p)
            q_middle = q + 0.5 * fine_s * w
            q, w = q + fine_s * middle, w + fine_s * self._acceleration(q_middle, middle, u, p)
        return {"q": q, "w": w}

    def observe(self, x: Quantities, u: Quantities, p: Quantities) -> Quantities:
        """Angle, and the current from the voltage."""
        seen = {"hip_angle_rad": x["q"] + u["angle_shown_rad"]}
        if self.with_voltage:
            seen["current_A"] = self._current(x["w"], u, p) + u["current_shown_A"]
        return seen

    def loose(self, x: Quantities, u: Quantities, p: Quantities, step_s: float) -> Quantities:
        """Near standstill friction is open."""
        _, friction = self._torques(x["q"], x["w"], u, p)
        return {"w": standing(x["w"], friction, STANDSTILL_RAD_S, step_s) / p["inertia_kg_m2"]}

    def extra_signals(self, along: dict[str, Array], table: Table) -> dict[str, Array]:
        """Current as simulated, signs, slopes, the rotor's angle."""
        current = along["current_A"] if self.with_voltage else along["I"]
        w = along["w"]
        slope_s = CURRENT_S / table.step_s
        # 0 at standstill, where friction balances any torque and the fitted rate is noise
        moves = 1.0 - np.exp(-0.5 * (w / MOVES_RAD_S) ** 2)
        made = {
            "I": current,
            "sgn_I": np.sign(current),
            "sgn_w": np.tanh(w / STANDSTILL_RAD_S),
            "moves": moves,
            "w_moving": np.where(moves > 0.5, w, 0.0),
            "angle": self.gear * along["q"],
            "dI": signals.derivative(table, current, slope_s),
        }
        if self.with_voltage:
            made["dV"] = signals.derivative(table, along["V"], slope_s)
        return made

    def counts(self, along: Quantities, table: Table) -> dict[str, np.ndarray]:
        """Exclude the current near a jump or a change of sign of the voltage: its time between samples is unknown."""
        if not self.with_voltage:
            return {}
        V, sign = along["V"], along["sgn_I"]
        jump = np.abs(np.diff(V, prepend=V[0])) > JUMP_SHARE * np.ptp(V)
        turn = np.diff(sign, prepend=sign[0]) != 0.0
        near = np.convolve(jump | turn, np.ones(2 * JUMP_ROWS + 1), mode="same")
        return {"current_A": near < 0.5}

    def looked_over(self, recording: SimulatedRecording) -> dict[str, dict[str, Array]]:
        """An unknown torque that depends on the motion, and an unknown drop."""
        s = recording.signals
        # a held level has no cells for its own noise, which is in the residual as well
        calm = signals.smooth(recording.table, s["I"], CALM_S / recording.table.step_s)
        motion = {"q": s["q"], "w": s["w_moving"], "I": calm, "t": s["t"]}
        found = {"torque_Nm": motion}
        if self.with_voltage:
            found["drop_V"] = {name: motion[name] for name in ("I", "w", "t")}
        return found

    def terms(self, recordings: Sequence[SimulatedRecording]) -> list[Term]:
        """The motor's and the gearbox's causes, the spring's bend, and the sensors' errors.

        Excluded are effects that the leg's own parameters explain: a scale of the current, all but the bend of sin q.
        """
        top = {
            name: max(float(np.quantile(np.abs(r.signals[name]), 0.98)) for r in recordings)
            for name in ("w", "I", *(("V",) if self.with_voltage else ()))
        }
        made = _friction(max(top["w"], MOVES_RAD_S)) + _periodic() + _angle() + _current_shown(top.get("V"))
        made.append(Term("torque_constant_temperature", "hip_motor", E, ("per_heat",),
                         lambda r, p, _: {"constant_share": _heat(r, p)}, _heats()))  # fmt: skip
        return made + (_electric(max(top["I"], 1e-3), top["V"]) if self.with_voltage else [])


def _torque(make: Callable[[dict[str, Array], Shape], Array]) -> Made:
    """A torque that drives the joint."""
    return lambda r, shape, _: {"torque_Nm": make(r.signals, shape)}


def _drop(make: Callable[[dict[str, Array], Shape], Array]) -> Made:
    """A voltage missing at the winding."""
    return lambda r, shape, _: {"drop_V": make(r.signals, shape)}


def _heats() -> list[dict[str, float]]:
    return [{"time_constant_s": time_s} for time_s in HEAT_TIMES_S]


def _heat(r: SimulatedRecording, shape: Shape) -> Array:
    """The winding's losses behind a first-order filter."""
    return signals.lagged(r.table, r.signals["I"] ** 2, shape["time_constant_s"])


def _friction(top_w: float) -> list[Term]:
    speeds = [{"speed_rad_s": share * top_w} for share in SPEED_SHARES]

    def presliding(r: SimulatedRecording, shape: Shape, _: Values) -> Ports:
        missing = r.signals["sgn_w"] - bristles(r, r.signals["w"], shape["slide_rad"])
        return {"torque_Nm": missing}

    def warm_up(r: SimulatedRecording, shape: Shape, _: Values) -> Ports:
        travel = signals.lagged(r.table, np.abs(r.signals["w"]), shape["time_constant_s"])
        return {"torque_Nm": r.signals["sgn_w"] * travel}

    motor = "hip_motor"
    return [
        Term("hip_spring_bend", "hip_joint", M, ("cubic_Nm_per_rad3",), _torque(lambda s, _: -(s["q"] ** 3)),
             meaning="a spring that is not linear"),
        Term("stribeck", motor, M, ("excess_Nm",),
             _torque(lambda s, p: -s["sgn_w"] * np.exp(-((s["w"] / p["speed_rad_s"]) ** 2))), speeds,
             lambda found: found["excess_Nm"] > 0.0, "friction that is larger at low speed"),
        Term("presliding", motor, M, ("friction_Nm",), presliding, [{"slide_rad": slide} for slide in SLIDES_RAD],
             lambda found: found["friction_Nm"] > 0.0, "friction that builds up over a way after a reversal"),
        Term("load_friction", motor, M, ("per_A",),
             _torque(lambda s, _: -np.abs(s["I"]) * s["sgn_w"] * (s["I"] * s["w"] > 0.0)),
             meaning="friction under load that differs between driving and being driven"),
        Term("direction_friction", motor, M, ("coulomb_Nm",), _torque(lambda s, _: -np.abs(s["sgn_w"]))),
        Term("direction_friction", motor, M, ("viscous_Nms",), _torque(lambda s, _: -np.abs(s["w"]))),
        Term("friction_warm_up", motor, M, ("Nm_s_per_rad",), warm_up, _heats(),
             lambda found: found["Nm_s_per_rad"] > 0.0, "friction that falls as the gearbox warms"),
        Term("drag", motor, M, ("quadratic_Nms2",), _torque(lambda s, _: -s["w"] * np.abs(s["w"])),
             admissible=lambda found: found["quadratic_Nms2"] > 0.0),
    ]  # fmt: skip


def _periodic() -> list[Term]:
    turns = [{"periods_per_turn": float(n)} for n in range(1, MOST_PERIODS + 1)]

    def waves(angle: str, port: str) -> Made:
        def made(r: SimulatedRecording, shape: Shape, _: Values) -> Ports:
            turned = shape["periods_per_turn"] * r.signals[angle]
            return {port: np.column_stack((np.cos(turned), np.sin(turned)))}

        return made

    both = ("cosine_Nm", "sine_Nm")
    return [
        Term("cogging", "hip_motor", M, both, waves("angle", "torque_Nm"), turns, phase_is_free=True),
        Term("commutation_ripple", "hip_motor", M, ("cosine", "sine"), waves("angle", "constant_share"), turns,
             phase_is_free=True),
        Term("once_per_turn", "hip_joint", M, both, waves("q", "torque_Nm"), turns[:3]),
    ]  # fmt: skip


def _electric(top_I: float, top_V: float) -> list[Term]:
    limits = [{"limit_V": share * top_V} for share in (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)]

    def emptied(r: SimulatedRecording, _: Shape, __: Values) -> Ports:
        return {"drop_V": r.signals["V"] * signals.integral(r.table, np.abs(r.signals["I"]))}

    motor, supply = "hip_motor", "supply"
    return [
        Term("contact_drop_change", motor, E, ("change_V",),
             _drop(lambda s, p: s["sgn_I"] * (1.0 - np.exp(-np.abs(s["I"]) / p["current_A"]))),
             [{"current_A": share * top_I} for share in CURRENT_SHARES], meaning="a drop that depends on the current"),
        Term("resistance_temperature", motor, E, ("ohm_per_heat",),
             lambda r, p, _: {"drop_V": r.signals["I"] * _heat(r, p)}, _heats(),
             meaning="resistance that grows with the winding's temperature"),
        Term("dead_time", motor, E, ("drop_V",), _drop(lambda s, _: s["sgn_I"] * (np.abs(s["V"]) > 0.02 * top_V))),
        Term("pwm_ripple", motor, E, ("V_per_V",), _drop(lambda s, _: s["V"] * (1.0 - np.abs(s["V"]) / top_V))),
        Term("battery_sag", supply, E, ("per_A",), _drop(lambda s, _: s["V"] * np.abs(s["I"]))),
        Term("charge_drift", supply, E, ("per_As",), emptied),
        Term("voltage_clip", "voltage_V", E, ("share",),
             _drop(lambda s, p: np.sign(s["V"]) * np.maximum(np.abs(s["V"]) - p["limit_V"], 0.0)), limits),
        Term("sensor_offset", "voltage_V", S, ("offset_V",), _drop(lambda s, _: np.ones_like(s["V"]))),
        Term("sensor_lag", "voltage_V", S, ("time_constant_s",), _drop(lambda s, _: -s["dV"])),
    ]  # fmt: skip


def _angle() -> list[Term]:
    def eccentric(r: SimulatedRecording, shape: Shape, _: Values) -> Ports:
        angle = shape["periods_per_turn"] * r.signals["q"]
        return {"angle_shown_rad": np.column_stack((np.cos(angle), np.sin(angle)))}

    angle = "hip_angle_rad"
    return [
        Term("sensor_lag", angle, S, ("time_constant_s",), lambda r, *_: {"angle_shown_rad": -r.signals["w"]}),
        Term("eccentricity", angle, S, ("cosine_rad", "sine_rad"), eccentric,
             [{"periods_per_turn": n} for n in (1.0, 2.0)],
             lambda found: np.hypot(found["cosine_rad"], found["sine_rad"]) < LARGEST_ECCENTRICITY_RAD),
    ]  # fmt: skip


def _current_shown(top_V: float | None) -> list[Term]:
    """top_V: None where the current is the input; then no voltage shows when the duty crosses zero."""

    def shown(make: Callable[[dict[str, Array]], Array]) -> Made:
        return lambda r, *_: {"current_shown_A": make(r.signals)}

    at = "current_A"
    made = [
        Term("sensor_lag", at, S, ("time_constant_s",), shown(lambda s: -s["dI"])),
        Term("clock_drift", at, "timing", ("share",), shown(lambda s: s["t"] * s["dI"])),
    ]
    if top_V is None:
        return [*made, Term("current_step_at_zero_duty", at, S, ("offset_A",), shown(lambda s: s["sgn_I"]))]
    near_V = NEAR_ZERO_DUTY * top_V
    return [
        *made,
        Term("sensor_offset", at, S, ("offset_A",), shown(lambda s: np.ones_like(s["I"]))),
        Term("current_step_at_zero_duty", at, S, ("offset_A",), shown(lambda s: np.tanh(s["V"] / near_V))),
    ]
