"""The appendix's own formulation, corrected: angles q1 ... q4 that swap names at heel-strike, massless feet.

It is the second derivation of the body (angular momentum balances about P1, A1, H and A2, where
`plant/mechanics/stance_equations.py` uses Lagrange's equations in fixed legs) and the model of the benchmarks of the
appendix's section 6. Numbers in parentheses are the appendix's equations; the corrections are the errata listed in
plant/EQUATIONS.md, section 13.

Angles are counter-clockwise, 0 upright (the appendix's section 5 counts q1 from pi, its section 6 from 0):
psi1 = q1 stance foot, phi1 = q1 + q2 stance leg, phi2 = phi1 - q3 swing leg, psi2 = phi2 - q4 swing foot.
A state is the vector q1, q2, q2m, q3, q4, q4m; rates likewise. Arrays are numpy; nothing here runs in a step.
"""

import dataclasses

import numpy as np

STANCE_FOOT, STANCE_ANKLE, STANCE_MOTOR, HIP, SWING_ANKLE, SWING_MOTOR = range(6)


@dataclasses.dataclass(frozen=True)
class PaperParameters:
    """Symbols of the appendix 1.1.1; defaults as robot.md P3 settles them."""

    el: float = 0.96
    r: float = 0.2
    d: float = 0.11
    w: float = 0.0
    c: float = 0.72 / 4.955
    kh: float = 7.6
    ks: float = 14.0
    Jl: float = 0.55 - 0.72 * 0.72 / 4.955  # about the centre of mass: J_hip - m c^2
    m: float = 4.955
    M: float = 0.0  # at the hip (erratum 10)
    g: float = 9.81
    gamma: float = 0.0
    C1: float = 0.05
    C2: float = 0.05
    JA: float = 34.0 * 34.0 * 1.6e-6  # G_A^2 J_m
    JH: float = 66.0 * 66.0 * 1.6e-6  # G_H^2 J_m (erratum 9)

    @property
    def gravity(self):
        return np.array([self.g * np.sin(self.gamma), -self.g * np.cos(self.gamma)])


@dataclasses.dataclass(frozen=True)
class Torques:
    """Output torques of the motors without their rotors' inertia: stance ankle, hip (T3), swing ankle; N m."""

    stance: float = 0.0
    hip: float = 0.0
    swing: float = 0.0


def cross(a, b):
    """z component of the product of two plane vectors."""
    return a[0] * b[1] - a[1] * b[0]


def turned(a):
    """k x a."""
    return np.array([-a[1], a[0]])


class Geometry:
    """Points of the robot relative to the stance contact point P1, from the corrected eq. 4 and 5."""

    def __init__(self, p: PaperParameters, q):
        psi1, phi1 = q[0], q[0] + q[1]
        phi2 = phi1 - q[3]
        psi2 = phi2 - q[4]
        self.angles = psi1, phi1, phi2, psi2
        self.P1 = np.zeros(2)
        self.A1 = np.array([p.d * np.sin(psi1), p.r - p.d * np.cos(psi1)])
        self.H = self.A1 + p.el * np.array([-np.sin(phi1), np.cos(phi1)])
        self.A2 = self.H + p.el * np.array([np.sin(phi2), -np.cos(phi2)])
        self.P2 = self.A2 + np.array([-p.d * np.sin(psi2), p.d * np.cos(psi2) - p.r])
        self.G1 = self.H + _mass_arm(p, phi1)
        self.G2 = self.H + _mass_arm(p, phi2)


def _mass_arm(p, phi):
    """Centre of mass of a leg seen from the hip: c down the leg, w ahead of it."""
    return np.array([p.c * np.sin(phi) + p.w * np.cos(phi), -p.c * np.cos(phi) + p.w * np.sin(phi)])


def chain(p: PaperParameters, psi, phi):
    """Hip from the point where the foot's sweet spot touches, corrected eq. 4 and 5: x_h - x_p, y_h."""
    return np.array(
        [
            -p.el * np.sin(phi) + p.d * np.sin(psi) - p.r * psi,
            p.r + p.el * np.cos(phi) - p.d * np.cos(psi),
        ]
    )


def chain_rate(p, psi, phi, psi_rate, phi_rate):
    """First derivative of `chain`."""
    return np.array(
        [
            -p.el * np.cos(phi) * phi_rate + p.d * np.cos(psi) * psi_rate - p.r * psi_rate,
            -p.el * np.sin(phi) * phi_rate + p.d * np.sin(psi) * psi_rate,
        ]
    )


def chain_acceleration(p, psi, phi, psi_rate, phi_rate, psi_acc, phi_acc):
    """Second derivative of `chain`."""
    return chain_rate(p, psi, phi, psi_acc, phi_acc) + np.array(
        [
            p.el * np.sin(phi) * phi_rate**2 - p.d * np.sin(psi) * psi_rate**2,
            -p.el * np.cos(phi) * phi_rate**2 + p.d * np.cos(psi) * psi_rate**2,
        ]
    )


def rates_of(u):
    """psi1, phi1, phi2, psi2 rates (or accelerations, or angles) of a vector of six."""
    psi1, phi1 = u[0], u[0] + u[1]
    phi2 = phi1 - u[3]
    return psi1, phi1, phi2, phi2 - u[4]


def balances(p: PaperParameters, q, u, T: Torques, acc, P=None):
    """Residuals of the balances (6-13) for trial accelerations `acc` and a trial force P on the trailing foot.

    P None: single stance (11-13) with erratum 8, six residuals. Otherwise double stance (6-10), eight.
    """
    double = P is not None
    geometry = Geometry(p, q)
    psi1, phi1, phi2, psi2 = geometry.angles
    dpsi1, dphi1, dphi2, dpsi2 = rates_of(u)
    ddpsi1, ddphi1, ddphi2, ddpsi2 = rates_of(acc)
    aH = chain_acceleration(p, psi1, phi1, dpsi1, dphi1, ddpsi1, ddphi1)
    g = p.gravity
    arm1, arm2 = geometry.G1 - geometry.H, geometry.G2 - geometry.H
    aG1 = aH - dphi1**2 * arm1 + ddphi1 * turned(arm1)
    aG2 = aH - dphi2**2 * arm2 + ddphi2 * turned(arm2)
    T2S = p.ks * (q[2] - q[1])
    T4S = p.ks * (q[5] - q[4])
    T3S = p.kh * q[3]
    T3 = T.hip - p.JH * acc[3]  # erratum 9
    T1FW = -p.C1 * dpsi1
    T2FW = -p.C2 * dpsi2 if double else 0.0
    force = np.asarray(P) if double else np.zeros(2)

    def about(point, bodies):
        """Moment of gravity and the trailing foot's force less the rate of angular momentum."""
        moment = cross(geometry.P2 - point, force)
        for G, aG, alpha in bodies:
            moment += cross(G - point, p.m * (g - aG)) - p.Jl * alpha
        return moment

    legs = [(geometry.G1, aG1, ddphi1), (geometry.G2, aG2, ddphi2)]
    residuals = [
        about(geometry.P1, legs) + cross(geometry.H - geometry.P1, p.M * (g - aH)) + T1FW + T2FW,
        about(geometry.A1, legs) + cross(geometry.H - geometry.A1, p.M * (g - aH)) + T2S + T2FW,
        about(geometry.H, legs[1:]) - (T3 - T3S) + T2FW,  # erratum 3
        T.stance - p.JA * acc[2] - T2S,
    ]
    if not double:
        residuals += [T.swing - p.JA * acc[5], acc[4] - acc[5]]  # 13 and erratum 8
        return np.array(residuals)
    aH2 = chain_acceleration(p, psi2, phi2, dpsi2, dphi2, ddpsi2, ddphi2)
    residuals += [
        T.swing - p.JA * acc[5] - T4S,
        cross(geometry.P2 - geometry.A2, force) - T4S + T2FW,  # erratum 4
        *(aH - aH2),  # 9, 10
    ]
    return np.array(residuals)


def solve_affine(function, size):
    """The zero of a function that is affine in its `size` unknowns, by the appendix's own method: b from the zero
    vector, columns of A from the unit vectors (text after eq. 14)."""
    b = function(np.zeros(size))
    A = np.column_stack([function(row) - b for row in np.eye(size)])
    return np.linalg.solve(A, -b)


def single_stance(p: PaperParameters, q, u, T: Torques = Torques()):
    """Six accelerations in single stance (15)."""
    return solve_affine(lambda X: balances(p, q, u, T, X), 6)


def double_stance(p: PaperParameters, q, u, T: Torques = Torques()):
    """Six accelerations in double stance and the force (P_x, P_y) on the trailing foot (14)."""
    X = solve_affine(lambda X: balances(p, q, u, T, X[:6], X[6:]), 8)
    return X[:6], X[6:]


def stance_force(p: PaperParameters, q, u, acc, P=(0.0, 0.0)):
    """Force of the floor on the stance foot: the whole robot's momentum balance less P."""
    geometry = Geometry(p, q)
    psi1, phi1, phi2, _ = geometry.angles
    dpsi1, dphi1, dphi2, _ = rates_of(u)
    ddpsi1, ddphi1, ddphi2, _ = rates_of(acc)
    aH = chain_acceleration(p, psi1, phi1, dpsi1, dphi1, ddpsi1, ddphi1)
    arm1, arm2 = geometry.G1 - geometry.H, geometry.G2 - geometry.H
    aG1 = aH - dphi1**2 * arm1 + ddphi1 * turned(arm1)
    aG2 = aH - dphi2**2 * arm2 + ddphi2 * turned(arm2)
    return p.m * (aG1 + aG2 - 2.0 * p.gravity) + p.M * (aH - p.gravity) - np.asarray(P)


def hip_acceleration(p, q, u, acc):
    """x_h'', y_h''."""
    psi1, phi1, _, _ = rates_of(q)
    dpsi1, dphi1, _, _ = rates_of(u)
    ddpsi1, ddphi1, _, _ = rates_of(acc)
    return chain_acceleration(p, psi1, phi1, dpsi1, dphi1, ddpsi1, ddphi1)


def swapped(q):
    """Names after the strike, eq. 16."""
    return np.array([q[0] + q[1] - q[3] - q[4], q[4], q[5], -q[3], q[1], q[2]])


def momenta(p: PaperParameters, q, u, point_name, bodies):
    """Angular momentum of the named legs (and the hip mass when both are meant) about a point of the robot."""
    geometry = Geometry(p, q)
    point = getattr(geometry, point_name)
    psi1, phi1, _, _ = geometry.angles
    dpsi1, dphi1, dphi2, _ = rates_of(u)
    vH = chain_rate(p, psi1, phi1, dpsi1, dphi1)
    total = 0.0
    for leg in bodies:
        G, omega = (geometry.G1, dphi1) if leg == 1 else (geometry.G2, dphi2)
        vG = vH + omega * turned(G - geometry.H)
        total += cross(G - point, p.m * vG) + p.Jl * omega
    if len(bodies) == 2:
        total += cross(geometry.H - point, p.M * vH)
    return total


def strike_to_double(p: PaperParameters, r, v):
    """Angles, rates and the impulse (P_x*, P_y*) on the trailing foot after a strike into double stance (16-20).

    r, v: angles and rates before. The motors keep their rates (18). Without a rotor at the hip (JH = 0) this is the
    appendix's rule; with one, the rotor takes its part at the hip (erratum 9).
    """
    q = swapped(r)
    before = Geometry(p, r)
    # in the frame of `before`: the new stance contact is P2', the trailing one P1'
    lever = {name: before.P1 - getattr(before, name) for name in ("P2", "A2", "H", "A1")}
    old = {
        "P1": momenta(p, r, v, "P2", (1, 2)),
        "A1": momenta(p, r, v, "A2", (1, 2)),
        "H": momenta(p, r, v, "H", (1,)),
    }

    def residual(X):
        u, P = X[:6], X[6:]
        psi1, phi1, phi2, psi2 = rates_of(q)
        dpsi1, dphi1, dphi2, dpsi2 = rates_of(u)
        closing = chain_rate(p, psi1, phi1, dpsi1, dphi1) - chain_rate(p, psi2, phi2, dpsi2, dphi2)
        return np.array(
            [
                momenta(p, q, u, "P1", (1, 2)) - old["P1"] - cross(lever["P2"], P),
                momenta(p, q, u, "A1", (1, 2)) - old["A1"] - cross(lever["A2"], P),
                momenta(p, q, u, "H", (2,)) - old["H"] - cross(lever["H"], P) - p.JH * (u[3] + v[3]),
                -cross(lever["A1"], P),
                u[2] - v[5],
                u[5] - v[2],
                *closing,
            ]
        )

    X = solve_affine(residual, 8)
    return q, X[:6], X[6:]


def strike_to_single(p: PaperParameters, r, v):
    """Angles and rates after a strike into single stance (21-27, with errata 5 to 7)."""
    q = swapped(r)
    q[4] = r[2]  # erratum 7: a massless foot in the air stands where its motor is
    old = (
        momenta(p, r, v, "P2", (1, 2)),
        momenta(p, r, v, "A2", (1, 2)),
        momenta(p, r, v, "H", (1,)),
    )

    def residual(u):
        return np.array(
            [
                momenta(p, q, u, "P1", (1, 2)) - old[0],
                momenta(p, q, u, "A1", (1, 2)) - old[1],
                momenta(p, q, u, "H", (2,)) - old[2] - p.JH * (u[3] + v[3]),
                u[4] - v[2],
                u[2] - v[5],
                u[5] - v[2],
            ]
        )

    return q, solve_affine(residual, 6)


def energy(p: PaperParameters, q, u, x_p=0.0):
    """Kinetic and potential energy; `x_p` is the anchor of the stance foot (it matters on a slope)."""
    geometry = Geometry(p, q)
    psi1, phi1, phi2, _ = geometry.angles
    dpsi1, dphi1, dphi2, _ = rates_of(u)
    vH = chain_rate(p, psi1, phi1, dpsi1, dphi1)
    H = chain(p, psi1, phi1) + np.array([x_p, 0.0])
    total = 0.5 * p.M * vH @ vH - p.M * p.gravity @ H
    for phi, dphi in ((phi1, dphi1), (phi2, dphi2)):
        arm = _mass_arm(p, phi)
        vG = vH + dphi * turned(arm)
        total += 0.5 * p.m * vG @ vG + 0.5 * p.Jl * dphi**2 - p.m * p.gravity @ (H + arm)
    total += 0.5 * p.ks * ((q[2] - q[1]) ** 2 + (q[5] - q[4]) ** 2) + 0.5 * p.kh * q[3] ** 2
    return total + 0.5 * p.JA * (u[2] ** 2 + u[5] ** 2) + 0.5 * p.JH * u[3] ** 2


def fixed_legs(q, stance):
    """Angles (or rates) of the body's coordinates from the appendix's: foot o, leg o, leg i, foot i, motor o, i.

    stance 0: the outer legs are the stance legs, 1: the inner ones (EQUATIONS 1).
    """
    psi1, phi1, phi2, psi2 = rates_of(q)
    s = (-psi1, -phi1, q[2])
    w = (-psi2, -phi2, q[5])
    outer, inner = (s, w) if stance == 0 else (w, s)
    return np.array([outer[0], outer[1], inner[1], inner[0], outer[2], inner[2]])


def paper_angles(x, stance):
    """The inverse of `fixed_legs`."""
    outer, inner = (x[0], x[1], x[4]), (x[3], x[2], x[5])
    s, w = (outer, inner) if stance == 0 else (inner, outer)
    return np.array([-s[0], s[0] - s[1], s[2], w[1] - s[1], w[0] - w[1], w[2]])
