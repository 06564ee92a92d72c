"""The body's equations of motion against two other derivations, on random states, and its energy.

1. Massless feet: `tests/plant/mechanics/paper_model.py`, the appendix's angular momentum balances in q1 ... q4.
2. Feet with inertia, arc ends, stops, flight: Lagrange's equations with multipliers in floating coordinates, all
   derivatives taken numerically by complex steps (exact to rounding), written here without a formula of the body.
"""

import cmath
import dataclasses
import math

import numpy as np
import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.mechanics.air import in_air
from ranger_sim.plant.mechanics.body import DOUBLE, FLIGHT, HELD, SINGLE, Body
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.parameters import BodyParameters, hip_spring_torque_Nm
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.plant.ranger import STEP_NS
from ranger_sim.plant.walking import handling
from ranger_sim.plant.walking.impact import impact
from ranger_sim.plant.walking.motion import advance
from tests.plant.mechanics import paper_model as pm

STEP_S = STEP_NS * 1e-9


def set_state(body, x, v):
    """Angles and rates in the order foot outer, leg outer, leg inner, foot inner, motor outer, motor inner."""
    o, i = body.outer, body.inner
    o.foot_angle, o.angle, i.angle, i.foot_angle, o.motor_angle, i.motor_angle = map(float, x)
    o.foot_rate, o.rate, i.rate, i.foot_rate, o.motor_rate, i.motor_rate = map(float, v)


def state(body):
    o, i = body.outer, body.inner
    return (
        np.array([o.foot_angle, o.angle, i.angle, i.foot_angle, o.motor_angle, i.motor_angle]),
        np.array([o.foot_rate, o.rate, i.rate, i.foot_rate, o.motor_rate, i.motor_rate]),
    )


def accelerations(body):
    o, i = body.outer, body.inner
    return np.array([o.foot_acc, o.acc, i.acc, i.foot_acc, o.motor_acc, i.motor_acc])


def set_random_rates(body, stream):
    """Of both legs and feet."""
    o, i = body.outer, body.inner
    o.foot_rate, o.rate, i.rate, i.foot_rate = (stream.normal() for _ in range(4))


def set_motors(body, stream):
    """Random torque laws; returns them by motor (drive, coulomb, viscous)."""
    laws = {}
    for motor in ("hip", "outer", "inner"):
        law = (4 * stream.normal(), abs(stream.normal()), abs(0.1 * stream.normal()))
        at = getattr(body, motor)
        at.drive, at.coulomb, at.viscous = law
        laws[motor] = law
    return laws


def torque(law, rate, smoothing=0.05):
    drive, coulomb, viscous = law
    return drive - coulomb * math.tanh(rate / smoothing) - viscous * rate


def paper_parameters(p: BodyParameters):
    m = p.total_mass_kg / 2
    c = p.outer_mass_moment_kg_m / m
    w = p.outer_mass_offset_kg_m / m
    return pm.PaperParameters(
        el=p.leg_length_m,
        r=p.outer_foot_radius_m,
        d=p.outer_ankle_offset_m,
        c=c,
        w=w,
        kh=p.hip_spring_Nm_per_rad,
        ks=p.ankle_spring_Nm_per_rad,
        m=m,
        Jl=p.outer_hip_inertia_kg_m2 - m * (c * c + w * w),
        gamma=p.slope_rad,
        C1=p.outer_rolling_friction_Nms,
        C2=p.outer_rolling_friction_Nms,
        JA=p.ankle_rotor_inertia_kg_m2,
        JH=p.hip_rotor_inertia_kg_m2,
    )


MASSLESS = BodyParameters(
    foot_inertia_kg_m2=0.0, outer_mass_offset_kg_m=0.04, inner_mass_offset_kg_m=0.04, slope_rad=0.03
)


def paper_torques(laws, v, stance):
    """The body's motor laws as the appendix's torques on q2m, q3, q4m."""
    h_rate = v[1] - v[2]
    outer, inner = torque(laws["outer"], v[4]), torque(laws["inner"], v[5])
    hip = torque(laws["hip"], h_rate)
    if stance == OUTER:
        return pm.Torques(outer, -hip, inner)
    return pm.Torques(inner, hip, outer)


def random_posture(stream):
    foot = [0.25 * (stream.uniform() - 0.3) for _ in range(2)]
    lean = [0.3 * stream.normal() for _ in range(2)]
    return np.array([foot[0], lean[0], lean[1], foot[1], 0.3 * stream.normal(), 0.3 * stream.normal()])


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_single_stance_agrees_with_the_appendix_formulation(stance):
    stream = RandomStream(stance, "single")
    p = paper_parameters(MASSLESS)
    for _ in range(100):
        body = Body(MASSLESS)
        x, v = random_posture(stream), np.array([2 * stream.normal() for _ in range(6)])
        w = (3, 2, 5) if stance == OUTER else (0, 1, 4)
        x[w[0]], v[w[0]] = x[w[1]] + x[w[2]], v[w[1]] + v[w[2]]  # q4 = q4m
        set_state(body, x, v)
        laws = set_motors(body, stream)
        body.mode = SINGLE
        body.stand_on(body.leg(stance))
        on_feet(body, 0.0, 1)
        q, u = pm.paper_angles(x, stance), pm.paper_angles(v, stance)
        acc = pm.single_stance(p, q, u, paper_torques(laws, v, stance))
        force = pm.stance_force(p, q, u, acc)
        ours = (body.stance.Fx, body.stance.Fy)
        # two solutions of systems with condition numbers up to 1e5 in accelerations up to 1e4
        scale = np.abs(acc).max()
        assert accelerations(body) == pytest.approx(pm.fixed_legs(acc, stance), abs=1e-10 * scale, rel=1e-9)
        assert ours == pytest.approx(force, abs=1e-8, rel=1e-9)


def closed_posture(body, stream, stance):
    """A random posture with both feet on the floor, moving with both contacts at rest."""
    body.mode = DOUBLE
    body.stand_on(body.leg(stance))
    s, w = body.stance, body.swing
    lean = 0.15 + 0.15 * stream.uniform()
    feet = [0.2 * (stream.uniform() - 0.3) for _ in range(2)]
    s.foot_angle, w.foot_angle = feet
    s.angle = -lean
    # the lean of the other leg that puts its foot on the floor: heights are equal
    want = s.chain_y(feet[0], -lean) - w.chain_y(feet[1], 0.0) + w.el
    w.angle = math.acos(want / w.el)
    body.outer.motor_angle, body.inner.motor_angle = 0.3 * stream.normal(), 0.3 * stream.normal()
    body.outer.motor_rate, body.inner.motor_rate = stream.normal(), stream.normal()
    body.outer.anchor = body.inner.anchor = 0.0
    body.update_pose()
    w.anchor = body.hip_x - w.chain_x(w.foot_angle, w.angle)
    # rates: random, then stopped by an impact of both feet
    set_random_rates(body, stream)
    body.hip_vx, body.hip_vy = stream.normal(), stream.normal()
    impact(body, True, True)
    body.update_pose()


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_double_stance_agrees_with_the_appendix_formulation(stance):
    stream = RandomStream(stance, "double")
    p = paper_parameters(MASSLESS)
    for _ in range(100):
        body = Body(MASSLESS)
        laws = set_motors(body, stream)
        closed_posture(body, stream, stance)
        x, v = state(body)
        on_feet(body, 0.0, 1)
        q, u = pm.paper_angles(x, stance), pm.paper_angles(v, stance)
        acc, P = pm.double_stance(p, q, u, paper_torques(laws, v, stance))
        front = pm.stance_force(p, q, u, acc, P)
        found = [(body.outer.Fx, body.outer.Fy), (body.inner.Fx, body.inner.Fy)]
        if stance == INNER:
            found.reverse()
        # the posture is closed to 1e-15 m; condition numbers up to 1e6
        scale = np.abs(acc).max()
        assert accelerations(body) == pytest.approx(pm.fixed_legs(acc, stance), abs=1e-9 * scale, rel=1e-8)
        assert [*found[0], *found[1]] == pytest.approx([*front, *P], abs=1e-6, rel=1e-8)


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_the_strike_agrees_with_the_appendix_formulation(stance):
    """`stance` carries before the strike; the other leg strikes."""
    stream = RandomStream(stance, "strike")
    p = paper_parameters(MASSLESS)
    for _ in range(100):
        body = Body(MASSLESS)
        closed_posture(body, stream, 1 - stance)
        body.mode = SINGLE
        body.stand_on(body.leg(stance))
        set_random_rates(body, stream)
        body.update_hip_rates()
        x, v = state(body)
        r, rr = pm.paper_angles(x, stance), pm.paper_angles(v, stance)
        q, u, P = pm.strike_to_double(p, r, rr)
        impact(body, True, True)
        _, after = state(body)
        assert pm.fixed_legs(q, 1 - stance) == pytest.approx(x, abs=1e-14)
        scale = np.abs(u).max()
        assert after == pytest.approx(pm.fixed_legs(u, 1 - stance), abs=1e-9 * scale)
        assert (body.stance.impulse_x, body.stance.impulse_y) == pytest.approx(P, abs=1e-8 * scale)


# ---- Lagrange with numerical derivatives ----------------------------------------------------------------------


class Lagrange:
    """z = hip x, hip y, leg o, leg i, foot o, foot i, motor o, motor i. Masses as points and bodies, no formulas."""

    def __init__(self, p: BodyParameters):
        self.p = p

    def points(self, z):
        """(mass, x, y) of point masses that add up to the robot's inertial numbers, complex allowed."""
        p = self.p
        hip = (z[0], z[1])
        result = []
        rest = p.total_mass_kg
        for leg, mc, mw in (
            (z[2], p.outer_mass_moment_kg_m, p.outer_mass_offset_kg_m),
            (z[3], p.inner_mass_moment_kg_m, p.inner_mass_offset_kg_m),
        ):
            m = p.total_mass_kg / 2
            x = hip[0] - (mc / m) * cmath.sin(leg) + (mw / m) * cmath.cos(leg)
            y = hip[1] - (mc / m) * cmath.cos(leg) - (mw / m) * cmath.sin(leg)
            result.append((m, x, y))
            rest -= m
        assert abs(rest) < 1e-12
        return result

    def spins(self, z):
        """(inertia, angle) of everything that turns."""
        p = self.p
        m = p.total_mass_kg / 2
        legs = (
            (p.outer_hip_inertia_kg_m2, p.outer_mass_moment_kg_m, p.outer_mass_offset_kg_m, z[2]),
            (p.inner_hip_inertia_kg_m2, p.inner_mass_moment_kg_m, p.inner_mass_offset_kg_m, z[3]),
        )
        return [(J - (mc * mc + mw * mw) / m, leg) for J, mc, mw, leg in legs] + [
            (p.foot_inertia_kg_m2, z[4]),
            (p.foot_inertia_kg_m2, z[5]),
            (p.ankle_rotor_inertia_kg_m2, z[6]),
            (p.ankle_rotor_inertia_kg_m2, z[7]),
            (p.hip_rotor_inertia_kg_m2, z[2] - z[3]),
        ]

    def jacobian(self, function, z):
        """Derivatives of a list-valued function by complex steps."""
        columns = []
        for k in range(len(z)):
            step = np.array(z, complex)
            step[k] += 1e-40j
            columns.append(np.imag(function(step)) / 1e-40)
        return np.array(columns).T

    def coordinates(self, z):
        return np.array([c for _, x, y in self.points(z) for c in (x, y)] + [a for _, a in self.spins(z)])

    def weights(self, z):
        return np.array([m for m, _, _ in self.points(z) for _ in range(2)] + [J for J, _ in self.spins(z)])

    def curvature(self, function, z, zd):
        """Second derivative of `function` along straight motion z + zd t, by a central difference of J zd."""
        step = 1e-5
        ahead = self.jacobian(function, z + step * zd) @ zd
        behind = self.jacobian(function, z - step * zd) @ zd
        return (ahead - behind) / (2 * step)

    def contact(self, foot):
        """Hip less the chain of a standing foot: constant while it stands and rolls."""
        p = self.p
        r = (p.outer_foot_radius_m, p.inner_foot_radius_m)[foot]
        d = (p.outer_ankle_offset_m, p.inner_ankle_offset_m)[foot]

        def function(z):
            angle, leg = z[4 + foot], z[2 + foot]
            low, high = p.arc_heel_rad, p.arc_toe_rad
            rolled = low if angle.real < low else high if angle.real > high else angle
            x = z[0] - r * rolled
            y = z[1]
            # from the contact's material point on the arc to its centre, to the ankle, to the hip
            x -= r * cmath.sin(angle - rolled) - d * cmath.sin(angle)
            y -= r * cmath.cos(angle - rolled) - d * cmath.cos(angle)
            return np.array([x - p.leg_length_m * cmath.sin(leg), y - p.leg_length_m * cmath.cos(leg)])

        return function

    def potential(self, z):
        p = self.p
        g = (p.gravity_m_per_s2 * math.sin(p.slope_rad), -p.gravity_m_per_s2 * math.cos(p.slope_rad))
        total = -sum(m * (g[0] * x + g[1] * y) for m, x, y in self.points(z))
        for foot in range(2):
            total += 0.5 * p.ankle_spring_Nm_per_rad * (z[6 + foot] - (z[4 + foot] - z[2 + foot])) ** 2
            ankle = z[4 + foot] - z[2 + foot] + p.ankle_zero_rad
            total += 0.5 * p.ankle_return_Nm_per_rad * (ankle - p.ankle_return_rest_rad) ** 2
        total += 0.5 * p.hip_spring_Nm_per_rad * (z[2] - z[3]) ** 2
        return np.array([total])

    def solve(self, z, zd, laws, feet, limp=()):
        """Accelerations and forces on the feet named; those in `limp` stand where their motors hold them."""
        p = self.p
        J = self.jacobian(self.coordinates, z)
        W = self.weights(z)
        mass = J.T @ (W[:, None] * J)
        bias = J.T @ (W * self.curvature(self.coordinates, z, zd))
        Q = -self.jacobian(self.potential, z)[0]
        hip = torque(laws["hip"], zd[2] - zd[3])
        Q[2] += hip
        Q[3] -= hip
        Q[6] += torque(laws["outer"], zd[6])
        Q[7] += torque(laws["inner"], zd[7])
        for foot, C in ((0, p.outer_rolling_friction_Nms), (1, p.inner_rolling_friction_Nms)):
            if foot in feet:
                Q[4 + foot] -= C * zd[4 + foot]
            angle, rate = z[4 + foot] - z[2 + foot], zd[4 + foot] - zd[2 + foot]
            stop = 0.0
            if angle < p.ankle_stop_low_rad - p.ankle_zero_rad:
                into = p.ankle_stop_low_rad - p.ankle_zero_rad - angle
                stop = max(0.0, p.ankle_stop_Nm_per_rad * into - p.ankle_stop_Nms_per_rad * rate)
            if angle > p.ankle_stop_high_rad - p.ankle_zero_rad:
                into = p.ankle_stop_high_rad - p.ankle_zero_rad - angle
                stop = min(0.0, p.ankle_stop_Nm_per_rad * into - p.ankle_stop_Nms_per_rad * rate)
            Q[4 + foot] += stop
            Q[2 + foot] -= stop
        rows = [self.jacobian(self.contact(f), z) for f in feet]
        curved = [-self.curvature(self.contact(f), z, zd) for f in feet]
        for foot in limp:  # angle of the foot less those of leg and motor: constant
            row = np.zeros((1, 8))
            row[0, [4 + foot, 2 + foot, 6 + foot]] = 1.0, -1.0, -1.0
            rows.append(row)
            curved.append(np.zeros(1))
        A = np.vstack(rows) if rows else np.zeros((0, 8))
        c = np.concatenate(curved) if rows else np.zeros(0)
        n = len(c)
        system = np.block([[mass, -A.T], [A, np.zeros((n, n))]])
        x = np.linalg.solve(system, np.concatenate([Q - bias, c]))
        return x[:8], x[8:]


INERTIAL = BodyParameters(
    outer_mass_offset_kg_m=0.05,
    inner_mass_offset_kg_m=-0.03,
    inner_mass_moment_kg_m=0.65,
    outer_hip_inertia_kg_m2=0.6,
    inner_rolling_friction_Nms=0.08,
    slope_rad=-0.02,
    # unlike feet, and springs that return them
    outer_foot_radius_m=0.168,
    outer_ankle_offset_m=0.114,
    inner_foot_radius_m=0.23,
    inner_ankle_offset_m=0.176,
    ankle_return_Nm_per_rad=2.5,
    ankle_return_rest_rad=1.2,
)


def to_body(z_acc):
    return np.array([z_acc[4], z_acc[2], z_acc[3], z_acc[5], z_acc[6], z_acc[7]])


def to_z(body):
    return np.array(
        [
            body.hip_x,
            body.hip_y,
            body.outer.angle,
            body.inner.angle,
            body.outer.foot_angle,
            body.inner.foot_angle,
            body.outer.motor_angle,
            body.inner.motor_angle,
        ]
    ), np.array(
        [
            body.hip_vx,
            body.hip_vy,
            body.outer.rate,
            body.inner.rate,
            body.outer.foot_rate,
            body.inner.foot_rate,
            body.outer.motor_rate,
            body.inner.motor_rate,
        ]
    )


def forces(body):
    return {OUTER: (body.outer.Fx, body.outer.Fy), INNER: (body.inner.Fx, body.inner.Fy)}


@pytest.mark.parametrize("stance", [OUTER, INNER])
@pytest.mark.parametrize("foot", [-0.5, 0.1, 1.1], ids=["heel end", "arc", "toe end"])
def test_single_stance_agrees_with_numerical_lagrange(stance, foot):
    """Includes the stance foot beyond both ends of its arc and the swing ankle in both stops."""
    stream = RandomStream(stance, f"lagrange {foot}")
    reference = Lagrange(INERTIAL)
    for trial in range(25):
        body = Body(INERTIAL, Floor(INERTIAL.slope_rad))
        laws = set_motors(body, stream)
        x, v = random_posture(stream), np.array([2 * stream.normal() for _ in range(6)])
        s, w, wl = (0, 3, 2) if stance == OUTER else (3, 0, 1)
        x[s] = foot + 0.02 * stream.normal()
        x[w] = x[wl] + (-1.75, 0.3, 1.6)[trial % 3]
        set_state(body, x, v)
        body.mode = SINGLE
        body.stand_on(body.leg(stance))
        body.update_pose()
        body.update_hip_rates()
        on_feet(body, 0.0, 1)
        acc, force = reference.solve(*to_z(body), laws, (stance,))
        # the reference's curvature is a central difference of step 1e-5: 1e-10 of terms up to 1e4
        assert accelerations(body) == pytest.approx(to_body(acc), rel=1e-7, abs=2e-6)
        assert forces(body)[stance] == pytest.approx(force, rel=1e-7, abs=2e-6)


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_double_stance_agrees_with_numerical_lagrange(stance):
    stream = RandomStream(stance, "lagrange double")
    reference = Lagrange(INERTIAL)
    for _ in range(40):
        body = Body(INERTIAL, Floor(INERTIAL.slope_rad))
        laws = set_motors(body, stream)
        closed_posture(body, stream, stance)
        body.update_hip_rates()
        on_feet(body, 0.0, 1)
        acc, force = reference.solve(*to_z(body), laws, (OUTER, INNER))
        assert accelerations(body) == pytest.approx(to_body(acc), rel=1e-6, abs=1e-5)
        assert [*forces(body)[OUTER], *forces(body)[INNER]] == pytest.approx(force, rel=1e-6, abs=1e-5)


def test_flight_agrees_with_numerical_lagrange():
    """Both feet free and in either stop of their ankles, in turn."""
    stream = RandomStream(0, "lagrange flight")
    reference = Lagrange(INERTIAL)
    for trial in range(45):
        body = Body(INERTIAL, Floor(INERTIAL.slope_rad))
        laws = set_motors(body, stream)
        x = random_posture(stream)
        x[0] = x[1] + (-1.75, 0.3, 1.6)[trial % 3]
        x[3] = x[2] + (0.3, 1.6, -1.75)[trial // 3 % 3]
        set_state(body, x, [2 * stream.normal() for _ in range(6)])
        body.mode = FLIGHT
        body.hip_vx = 1.0
        body.hip_y = 1.1
        z, zd = to_z(body)
        acc, _ = reference.solve(z, zd, laws, ())
        in_air(body, 0.0, 1)
        assert accelerations(body) == pytest.approx(to_body(acc), rel=1e-7, abs=2e-6)
        # the hip's acceleration shows in a short step: v(h) - v(0) = a h + O(h^2) jerk, 1e4 m/s^3 x 1e-6 s
        in_air(body, 1e-6, 4)
        assert ((body.hip_vx - zd[0]) * 1e6, (body.hip_vy - zd[1]) * 1e6) == pytest.approx(acc[:2], abs=1e-2)


@pytest.mark.parametrize("mode", [SINGLE, FLIGHT])
@pytest.mark.parametrize("ankle", [-1.75, 0.3, 1.6], ids=["low stop", "free", "high stop"])
def test_a_massless_foot_in_the_air_agrees_with_numerical_lagrange(mode, ankle):
    """Stop and return spring of a massless foot load its motor and not its leg: only the joint's angle feels them."""
    massless = dataclasses.replace(INERTIAL, foot_inertia_kg_m2=0.0)
    stream = RandomStream(mode, f"massless {ankle}")
    reference = Lagrange(massless)
    for _ in range(20):
        body = Body(massless, Floor(massless.slope_rad))
        laws = set_motors(body, stream)
        set_state(body, random_posture(stream), [2 * stream.normal() for _ in range(6)])
        limp = (body.inner,) if mode == SINGLE else (body.outer, body.inner)
        for leg in limp:
            leg.motor_angle = ankle
            leg.limp()
        body.mode = mode
        body.stand_on(body.outer)
        body.update_pose()
        body.update_hip_rates()
        standing = (OUTER,) if mode == SINGLE else ()
        acc, _ = reference.solve(*to_z(body), laws, standing, [leg.side for leg in limp])
        if mode == SINGLE:
            on_feet(body, 0.0, 1)
        else:
            in_air(body, 0.0, 1)
        assert accelerations(body) == pytest.approx(to_body(acc), rel=1e-7, abs=2e-6)


def test_a_held_robot_swings_its_inner_leg_as_a_pendulum():
    """Small oscillation about the hip against eq. 29 of the appendix, with spring and rotor: known answer."""
    p = BodyParameters()
    body = Body(p)
    handling.place(body, 0.0, 0.01)
    stiffness = p.hip_spring_Nm_per_rad + p.inner_mass_moment_kg_m * p.gravity_m_per_s2
    period = 2 * math.pi * math.sqrt((p.inner_hip_inertia_kg_m2 + p.hip_rotor_inertia_kg_m2) / stiffness)
    assert body.mode == HELD
    crossings = []
    before = body.hip_angle()
    for k in range(round(3.75 / STEP_S)):
        advance(body, STEP_S)
        now = body.hip_angle()
        if before > 0 >= now:
            crossings.append((k + before / (before - now)) * STEP_S)
        before = now
    found = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    # amplitude 0.01 rad lengthens the period by theta^2/16 of the gravity part: 3e-6; the hanging foot pulls at the
    # leg through the cable with an inertia of 0.004 kg m^2 (0.3 % of the period)
    assert found == pytest.approx(period, rel=5e-3)
    assert found > period


@pytest.mark.parametrize("foot_inertia", [0.0, 0.002])
@pytest.mark.parametrize("mode", [SINGLE, DOUBLE, FLIGHT])
@pytest.mark.parametrize("exact_spring", [False, True])
def test_energy_is_kept_without_friction(mode, foot_inertia, exact_spring):
    p = BodyParameters(
        foot_inertia_kg_m2=foot_inertia,
        outer_rolling_friction_Nms=0.0,
        inner_rolling_friction_Nms=0.0,
        exact_hip_spring=exact_spring,
        slope_rad=0.02,
        arc_heel_rad=-0.2,
        ankle_return_Nm_per_rad=0.3,
        ankle_return_rest_rad=1.7,
    )
    body = Body(p, Floor(0.02))
    if mode == DOUBLE:
        closed_posture(body, RandomStream(3, "energy"), OUTER)
    else:
        set_state(body, (0.1, -0.05, 0.25, 0.75, 0.17, 0.5), (0.9, 0.7, 0.8, 0.5, 0.0, 0.0))
        body.mode = mode
        for leg in (body.outer, body.inner) if mode == FLIGHT else (body.inner,):
            if foot_inertia == 0.0:
                leg.limp()
        body.update_pose()
    before = body.energy_J()
    seconds = 0.03 if mode == DOUBLE else 0.2
    for _ in range(round(seconds / STEP_S)):
        if mode == FLIGHT:
            in_air(body, STEP_S, 4)
        else:
            on_feet(body, STEP_S, 4)
    # fourth order: robot.md P2 gives 4.5e-10 per second at 500 us, so 3e-11 at 250 us. The arc is long
    # enough not to roll over its end, where the acceleration jumps (that costs 1e-7).
    assert body.energy_J() == pytest.approx(before, rel=1e-10)


def opening(seed, steps):
    body = Body(BodyParameters(arc_heel_rad=-0.2))
    closed_posture(body, RandomStream(seed, "closed"), OUTER)
    worst = []
    for _ in range(steps):
        on_feet(body, STEP_S, 4)
        body.update_pose()
        worst.append(abs(body.inner.gap))
    return worst


def test_the_closed_linkage_stays_closed():
    # 50 ms on the arcs of both feet: the method's own error, 4e-12 m at 250 us and lost in rounding at 125 us
    assert max(opening(4, round(0.05 / STEP_S))) < 1e-11


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_a_linkage_of_unequal_feet_stays_closed(stance):
    """Each leg has its own foot: with other radii and ankle offsets both contacts still rest, along and upwards."""
    body = Body(BodyParameters(arc_heel_rad=-0.2))
    body.inner.r, body.inner.d = 0.23, 0.14
    closed_posture(body, RandomStream(4, "closed"), stance)
    w = body.swing
    for _ in range(round(0.05 / STEP_S)):
        on_feet(body, STEP_S, 4)
        body.update_pose()
        # as for equal feet: the method's own error
        assert abs(w.gap) < 1e-10
        assert abs(body.hip_x - w.chain_x(w.foot_angle, w.angle) - w.anchor) < 1e-10


def test_a_linkage_opened_by_the_end_of_an_arc_closes_again():
    # This stance rolls over the heel end inside a step: the jump of the acceleration (some 1e3 m/s^2) acts for at most
    # one step, 0.5 x 1e3 x (250 us)^2 = 31 um, and decays at 100 1/s.
    worst = opening(3, round(0.1 / STEP_S))
    assert 1e-7 < max(worst) < 4e-5
    assert worst[-1] < 0.02 * max(worst)


def test_the_exact_hip_spring_has_the_linear_one_as_its_tangent():
    p = BodyParameters(exact_hip_spring=True)
    linear = dataclasses.replace(p, exact_hip_spring=False)
    # the cubic term of eq. 1 is below 1 rad^-2 of the linear one
    assert hip_spring_torque_Nm(p, 1e-4) == pytest.approx(hip_spring_torque_Nm(linear, 1e-4), rel=1e-7)
    # figure 6c shows it nearly linear: 10 % at the largest hip angle of a walk
    assert hip_spring_torque_Nm(p, 0.4) == pytest.approx(hip_spring_torque_Nm(linear, 0.4), rel=0.1)
    body = Body(p)
    set_state(body, (0.1, 0.2, -0.2, 0.1, 0.1, 0.1), (0, 0, 0, 0, 0, 0))
    body.mode = FLIGHT
    step = 1e-6
    up, down = [], []
    for sign, store in ((1, up), (-1, down)):
        body.outer.angle = 0.2 + sign * step
        body.outer.motor_angle = body.outer.foot_angle - body.outer.angle
        body.gx = body.gy = 0.0
        store.append(body.energy_J())
    # torque of the drawing in eq. 1 is the slope of the stored energy: central difference, rounding 1e-16/1e-6
    assert (up[0] - down[0]) / (2 * step) == pytest.approx(hip_spring_torque_Nm(p, 0.4), abs=1e-8)
