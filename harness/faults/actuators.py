"""Faults between the bridges and the joints: bridge, winding, magnets, cable, joint.

Windings and joints get other numbers, or torques in addition to the existing ones (plant/mechanics/term_torques.py);
what the firmware has written stays.
"""

import math
from typing import Any, ClassVar

from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, WholeNumber
from ranger_sim.harness.faults.kinds import BRIDGE, CABLE, JOINT, MOTOR
from ranger_sim.plant import wiring_points as point
from ranger_sim.plant.electrics.drive import DRIVEN, HELD_HIGH, HELD_LOW, HELD_OPEN
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.term_torques import ANKLE_CABLE, ANKLE_JOINT, HIP_JOINT, SPRING, VISCOUS, TermTorques

SIDES = {point.OUTER_ANKLE: OUTER, point.INNER_ANKLE: INNER}


class MotorFault(Fault):
    """A fault of one motor. `usual`: its own numbers, by name of the field."""

    unit = "A"
    fields: ClassVar[tuple[str, ...]] = ()

    def connect(self) -> None:
        plant = self.robot.plant
        self.number: int = self.place.details["motor"]
        self.motor: Any = plant.motors[self.number]

    def rate_rad_s(self) -> float:
        """Rate of the motor now, over the gear."""
        plant = self.robot.plant
        body = plant.body
        if self.number == point.HIP:
            return float(body.outer.rate - body.inner.rate)
        if self.number == point.STEERING:
            return float(plant.steering.rate)
        return float((body.outer if self.number == point.OUTER_ANKLE else body.inner).motor_rate)

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.usual = {name: getattr(self.motor, name) for name in self.fields}
        self.change()

    def change(self) -> None:
        """Set the motor's numbers with the fault."""
        raise NotImplementedError

    def finish(self, now_ns: int) -> None:
        self._put(self.usual)

    def _put(self, numbers: dict[str, float]) -> None:
        for name, value in numbers.items():
            setattr(self.motor, name, value)
        self.motor.known_s = 0.0  # its stored exponential of a step belongs to other numbers

    def settled_A(self) -> float:
        """The current, in the joint's sense, to which the present voltage and rate lead (EQUATIONS 10.2)."""
        motor, drive = self.motor, self.motor.drive
        battery_V = self.robot.plant.electrics.battery.voltage_V
        back_V = motor.mounting * motor.gear * motor.K * motor.angle_factor * self.rate_rad_s()
        if drive.is_open:
            volts, drop = -back_V, motor.contact_drop_V + battery_V + 2.0 * motor.diode_drop_V
        else:
            volts, drop = drive.duty * battery_V - back_V, motor.contact_drop_V + motor.dead_time_fraction * battery_V
        if abs(volts) <= drop:
            return 0.0
        loop_ohm = motor.winding_ohm + motor.series_ohm
        return float(motor.mounting * math.copysign((abs(volts) - drop) / loop_ohm, volts))

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether its numbers are its own again; a motor that warms computes those of its temperature."""
        p, motor = self.motor.parameters, self.motor
        if not motor.heat_matters:
            return all(getattr(motor, name) == value for name, value in self.usual.items())
        ohm = p.resistance_ohm * (1.0 + motor.resistance_per_K * (motor.rotor_temperature_C - 25.0))
        K = p.torque_constant_Nm_per_A * (1.0 + motor.torque_constant_per_K * (motor.housing_temperature_C - 25.0))
        return math.isclose(motor.winding_ohm, ohm, rel_tol=1e-9) and math.isclose(motor.K, K, rel_tol=1e-9)


class WindingFault(MotorFault):
    """Other numbers of winding or magnets: measured by the currents without and with them."""

    def before(self, now_ns: int) -> None:
        self.change()  # again: a motor that warms has just computed its numbers anew
        with_fault = self.settled_A()
        changed = {name: getattr(self.motor, name) for name in self.fields}
        self._put(self.usual)
        without = self.settled_A()
        self._put(changed)
        if with_fault != without:
            self.note(now_ns, with_fault - without)


@mode
class OpenWinding(WindingFault):
    """The winding's circuit is broken: a present current ends in an arc, and no new one flows.

    The arc's voltage acts as the brushes' drop: chosen by us, 100 V, more than battery and motor have together.
    """

    mode = "open_winding"
    kinds = (MOTOR,)
    needs = "a motor"
    meaning = "has a broken winding: no current flows"
    fields = ("contact_drop_V", "ripple_per_ohm2")
    ARC_V: ClassVar[float] = 100.0

    def change(self) -> None:
        self.motor.contact_drop_V = self.ARC_V
        self.motor.ripple_per_ohm2 = 0.0


@mode
class ShortedTurns(WindingFault):
    """Some of the winding's turns are shorted: less resistance, less torque and voltage, far less inductance."""

    mode = "short"
    kinds = (MOTOR,)
    needs = "a motor"
    meaning = "has a share of its winding's turns shorted"
    fields = ("winding_ohm", "K", "inductance_H")
    parameters = (Parameter("share", "1", 0.5, 0.0, 0.95, "share of the turns", "chosen by us: every other turn"),)

    def change(self) -> None:
        left = 1.0 - self.values["share"]
        self._put(
            {
                "winding_ohm": self.usual["winding_ohm"] * left,
                "K": self.usual["K"] * left,
                "inductance_H": self.usual["inductance_H"] * left * left,
            }
        )


@mode
class WeakMotor(WindingFault):
    """Magnets that have lost their strength: less torque per ampere, less voltage per rate."""

    mode = "weak_motor"
    kinds = (MOTOR,)
    needs = "a motor"
    meaning = "has weak magnets: a share of the torque for the same current"
    unit = "N m"
    fields = ("K",)
    parameters = (
        Parameter("share", "1", 0.7, 0.0, 1.5, "of the torque constant", "chosen by us: motors lose some by heat"),
    )

    def change(self) -> None:
        self.motor.K = self.usual["K"] * self.values["share"]

    def before(self, now_ns: int) -> None:
        self.change()
        missing_Nm = (self.motor.K - self.usual["K"]) * self.motor.gear * self.motor.current_A
        if missing_Nm:
            self.note(now_ns, missing_Nm)


@mode
class OneLeg(Fault):
    """One of the bridge's two half-bridges does not follow its PWM."""

    mode = "one_leg"
    kinds = (BRIDGE,)
    needs = "a bridge"
    meaning = "has a leg that does not follow the PWM: open, or held low or high"
    unit = "of the battery voltage"
    parameters = (
        WholeNumber("leg", "1", 2.0, 2.0, 6.0, "2: the lead of MR2, 6: that of MR6", "two leads (robot.md N4.4)"),
        WholeNumber("state", "1", 0.0, 0.0, 2.0, "0: open, 1: held low, 2: held high", "what a transistor can do"),
    )

    def connect(self) -> None:
        self.drive: Any = self.robot.plant.motors[self.place.details["motor"]].drive
        if self.values["leg"] not in (2.0, 6.0):
            raise FaultError(f"fault {self.text()}: leg is {self.values['leg']:g}, there are 2 and 6")

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self._hold((HELD_OPEN, HELD_LOW, HELD_HIGH)[int(self.values["state"])])

    def before(self, now_ns: int) -> None:
        drive = self.drive
        if drive.healthy_open != drive.is_open or drive.healthy_duty != drive.duty:
            self.note(now_ns, drive.duty - drive.healthy_duty)

    def finish(self, now_ns: int) -> None:
        self._hold(DRIVEN)

    def _hold(self, state: int) -> None:
        self.drive.hold_leg(int(self.values["leg"]), state)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether duty and openness are those set in the registers."""
        drive = self.drive
        return bool(drive.is_open == drive.healthy_open and drive.duty == drive.healthy_duty)


# --- torques in addition to existing ones --------------------------------------------------------------------


class TorqueFault(Fault):
    """Rows of torques that the body has while the fault works."""

    unit = "N m"

    def connect(self) -> None:
        self.number: int = self.place.details["motor"]
        self.side = SIDES.get(self.number, -1)
        self.body: Any = self.robot.plant.body
        self.rows: list[tuple[int, int, int, tuple[float, ...]]] = []

    def add(self, *rows: tuple[int, int, int, tuple[float, ...]]) -> None:
        """Add torques (form, place, side, parameters) of plant/mechanics/term_torques.py."""
        self.rows.extend(rows)
        self._build(rows_of(self.body.terms) + [row_with_zeros(row) for row in rows])

    def finish(self, now_ns: int) -> None:
        rows = rows_of(self.body.terms)
        for row in self.rows:
            rows.remove(row_with_zeros(row))
        self.rows.clear()
        self._build(rows)

    def _build(self, rows: list[tuple[int, int, int, tuple[float, ...]]]) -> None:
        """Set the body's additional torques."""
        plant = self.robot.plant
        if not rows:
            self.body.terms = None
            for leg in (self.body.outer, self.body.inner):
                leg.extra_ankle = leg.extra_motor = 0.0
            return
        p = plant.parameters
        terms = TermTorques(p.ankle_zero_rad, p.hip_gear, p.ankle_gear, p.friction_smoothing_rad_s)
        for row in rows:
            terms.add(*row)
        self.body.terms = terms

    def joint(self) -> tuple[float, float]:
        """Present angle and rate of the joint, rad and rad/s."""
        body, plant = self.body, self.robot.plant
        if self.side < 0:
            return float(body.outer.angle - body.inner.angle), float(body.outer.rate - body.inner.rate)
        leg = body.leg(self.side)
        return float(leg.foot_angle - leg.angle + plant.zero), float(leg.foot_rate - leg.rate)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether no torque of the fault is left among the body's or kept in its legs."""
        body = self.body
        kept = any(leg.extra_ankle or leg.extra_motor for leg in (body.outer, body.inner))
        return not self.rows and (body.terms is not None or not kept)


def rows_of(terms: Any) -> list[tuple[int, int, int, tuple[float, ...]]]:
    """The rows of additional torques (None: none)."""
    if terms is None:
        return []
    return [
        (terms.forms[i], terms.places[i], terms.sides[i], tuple(terms.parameters[4 * i : 4 * i + 4]))
        for i in range(terms.count)
    ]


def row_with_zeros(row: tuple[int, int, int, tuple[float, ...]]) -> tuple[int, int, int, tuple[float, ...]]:
    """A row with all four of its parameters."""
    return (*row[:3], row[3] + (0.0,) * (4 - len(row[3])))


@mode
class JammedJoint(TorqueFault):
    """An object is caught in the joint: it is held at its angle.

    Held as by the ankles' stops (plant/mechanics/parameters.py): a spring of 400 N m/rad with half of critical damping
    for a foot; at the hip, where a leg of 0.5 kg m^2 swings, five times as stiff. The steering's is a damper:
    it creeps.
    """

    mode = "jammed"
    kinds = (JOINT,)
    needs = "a joint"
    meaning = "is held at the angle that it had"
    ANKLE: ClassVar[tuple[float, float]] = (400.0, 0.9)  # N m/rad, N m s/rad
    HIP: ClassVar[tuple[float, float]] = (2000.0, 30.0)
    STEERING_Nms: ClassVar[float] = 40.0  # chosen by us: 0.3 ms to rest, 1 degree a second under 0.7 N m

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        steering = self.robot.plant.steering
        if self.number == point.STEERING:
            self.usual_Nms = steering.damping
            steering.damping = self.STEERING_Nms
            return
        self.angle = self.joint()[0]
        self.stiffness, self.damping = self.HIP if self.side < 0 else self.ANKLE
        place = HIP_JOINT if self.side < 0 else ANKLE_JOINT
        self.add(
            (SPRING, place, self.side, (self.stiffness, 0.0, 0.0, self.angle)),
            (VISCOUS, place, self.side, (self.damping,)),
        )

    def after(self, start_ns: int, end_ns: int) -> None:
        if self.number == point.STEERING:
            steering = self.robot.plant.steering
            torque_Nm = -(steering.damping - self.usual_Nms) * steering.rate
        else:
            angle, rate = self.joint()
            torque_Nm = -self.stiffness * (angle - self.angle) - self.damping * rate
        if torque_Nm:
            self.note(end_ns, torque_Nm)

    def finish(self, now_ns: int) -> None:
        if self.number == point.STEERING:
            self.robot.plant.steering.damping = self.usual_Nms
        else:
            super().finish(now_ns)


@mode
class CableSlip(TorqueFault):
    """The cable jumps on its pulley: the angle between motor and joint changes.

    The cable's torque is then k (stretch - angle) instead of k stretch (EQUATIONS 2.3). It jumps back at the end.
    """

    mode = "cable_slip"
    kinds = (CABLE,)
    needs = "a cable"
    meaning = "has jumped on its pulley by an angle"
    parameters = (
        Parameter(
            "angle",
            "rad",
            0.2,
            -1.0,
            1.0,
            "by which the motor is ahead of an unstretched cable",
            "chosen by us: below the 0.3 rad at which the board sees a stretched cable (robot.md N4.8)",
        ),
    )

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        stiffness = self.body.ankle.k
        self.torque_Nm = -stiffness * self.values["angle"]
        # two springs at the cable whose difference is a constant torque: k (s - angle) - k s
        self.add(
            (SPRING, ANKLE_CABLE, self.side, (-stiffness, 0.0, 0.0, self.values["angle"])),
            (SPRING, ANKLE_CABLE, self.side, (stiffness, 0.0, 0.0, 0.0)),
        )

    def after(self, start_ns: int, end_ns: int) -> None:
        if self.torque_Nm:
            self.note(end_ns, self.torque_Nm)
