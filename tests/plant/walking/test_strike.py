"""A strike that neither pulls nor holds beyond friction: known answers, momentum and energy, and another derivation.

The other derivation takes masses and contact directions from numerical Lagrange (`test_body_equations.Lagrange`,
complex steps, no formula of the body), and the impulses from the linear complementarity problem of Stewart and
Trinkle (1996), solved by Lemke's pivots. It shares no code with `plant/mechanics/contact_equations.py`, which tries
all states.
"""

import math

import numpy as np
import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.mechanics.body import SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations import APART, SLIDES_BACK, SLIDES_ON, STICKS
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.walking.impact import collide
from tests.plant.mechanics.test_body_equations import Lagrange, closed_posture, set_random_rates, to_z

# ---- known answers: a body whose mass is all at the hip, on point feet ------------------------------------------


def frame(mu=0.9, inertia=0.5, contact="coulomb"):
    """Two upright legs without mass moment on point feet: each has its inertia about the hip; nothing couples
    them, no springs either."""
    body = Body(
        BodyParameters(
            outer_mass_moment_kg_m=0.0,
            inner_mass_moment_kg_m=0.0,
            hip_rotor=False,
            outer_foot_radius_m=0.0,
            inner_foot_radius_m=0.0,
            outer_ankle_offset_m=0.0,
            inner_ankle_offset_m=0.0,
            floor_friction=mu,
            contact=contact,
        )
    )
    body.hip.k = body.ankle.k = 0.0
    body.inner.angle = body.inner.foot_angle = 0.0
    for leg in (body.outer, body.inner):  # beyond the limits of parameters too
        leg.J = inertia
        leg.m22 = body.M * leg.el * leg.el + inertia
        leg.i33 = 1.0 / inertia
    return body


def strike(body, leg, other_stands=False):
    collide(body, leg, other_stands)
    return body.equations.state[leg.side]


@pytest.mark.parametrize("forwards", [1.0, -1.0])
@pytest.mark.parametrize("leg", [OUTER, INNER])
def test_a_foot_under_an_upright_leg_sticks_within_friction_and_slides_beyond(forwards, leg):
    """Along and across do not mix: the floor stops M, and along itself the mass seen at the foot, 1/(1/M + l^2/J)."""
    mu, down, inertia = 0.5, 0.4, 0.5
    for speed, expected in ((0.2, STICKS), (4.0, SLIDES_ON if forwards > 0 else SLIDES_BACK)):
        body = frame(mu, inertia)
        foot = body.leg(leg)
        body.hip_vx, body.hip_vy = forwards * speed, -down
        seen = 1.0 / (1.0 / body.M + foot.el**2 / inertia)
        assert strike(body, foot) == expected
        assert foot.impulse_y == pytest.approx(body.M * down, rel=1e-12)
        along = -forwards * min(seen * speed, mu * body.M * down)
        assert foot.impulse_x == pytest.approx(along, rel=1e-12)
        assert body.hip_vy == pytest.approx(0.0, abs=1e-14)
        assert body.hip_vx == pytest.approx(forwards * speed + along / body.M, rel=1e-12)
        assert foot.rate == pytest.approx(-foot.el * along / inertia, rel=1e-12)


def test_a_foot_dropped_straight_down_stops_without_friction_and_keeps_its_other_rates():
    body = frame()
    body.hip_vy = -1.5
    assert strike(body, body.outer) == STICKS
    assert (body.outer.impulse_x, body.outer.impulse_y) == pytest.approx((0.0, 1.5 * body.M))
    assert (body.hip_vx, body.hip_vy, body.outer.rate, body.inner.rate) == pytest.approx((0.0,) * 4, abs=1e-14)


@pytest.mark.parametrize("lean", [0.5, -0.5])
@pytest.mark.parametrize("mu", [0.2, 0.9])
def test_a_foot_under_a_leaning_leg_takes_the_impulse_of_the_two_by_two_equations(lean, mu):
    """W = 1/M + l^2/J (cos^2, -sin cos; ., sin^2): sticking by Cramer's rule, sliding by one division."""
    inertia, vx, vy = 0.5, 0.3, -0.7
    body = frame(mu, inertia)
    body.outer.angle = lean
    body.hip_vx, body.hip_vy = vx, vy
    lever = body.outer.el**2 / inertia
    Wxx = 1 / body.M + lever * math.cos(lean) ** 2
    Wyy = 1 / body.M + lever * math.sin(lean) ** 2
    Wxy = -lever * math.sin(lean) * math.cos(lean)
    det = Wxx * Wyy - Wxy * Wxy
    Px, Py = (-vx * Wyy + vy * Wxy) / det, (-vy * Wxx + vx * Wxy) / det
    if abs(Px) > mu * Py:
        sign = -math.copysign(1.0, Px)  # the way it slides: against the friction that sticking asks for
        Py = -vy / (Wyy - sign * mu * Wxy)
        Px = -sign * mu * Py
    assert strike(body, body.outer) == (STICKS if abs(Px) < mu * Py * 0.999 else SLIDES_ON if Px < 0.0 else SLIDES_BACK)
    assert (body.outer.impulse_x, body.outer.impulse_y) == pytest.approx((Px, Py), rel=1e-11)


@pytest.mark.parametrize("forwards", [1.0, -1.0])
@pytest.mark.parametrize(("half_angle", "stays"), [(0.3, False), (0.9, True)])
def test_of_two_thin_legs_the_trailing_one_leaves_when_they_are_less_than_a_right_angle_apart(
    forwards, half_angle, stays
):
    """The rimless wheel: impulses act along legs without inertia. At rest on both the trailing leg is pushed with
    M u (tan - cot) / 2 along itself, a pull below 45 degrees; then the leading one alone takes M u sin 2 alpha.
    """
    body = frame(mu=1.5, inertia=1e-9)
    trailing, leading = (body.outer, body.inner) if forwards > 0 else (body.inner, body.outer)
    u = 0.8
    trailing.angle, leading.angle = forwards * half_angle, -forwards * half_angle
    body.hip_vx, body.hip_vy = forwards * u * math.cos(half_angle), -u * math.sin(half_angle)
    trailing.rate = forwards * u / trailing.el
    assert strike(body, leading, True) == STICKS
    assert body.equations.state[trailing.side] == (STICKS if stays else APART)
    tan = math.tan(half_angle)
    pushed = 0.5 * body.M * u * (tan - 1.0 / tan) if stays else 0.0
    leads = 0.5 * body.M * u * (tan + 1.0 / tan) if stays else body.M * u * math.sin(2 * half_angle)
    # inertias of 1e-9 beside masses of 10: what the thin legs keep is 1e-9 of the whole, rounding 1e-7
    for leg, along, sign in ((trailing, pushed, 1.0), (leading, leads, -1.0)):
        expected = (forwards * sign * along * math.sin(half_angle), along * math.cos(half_angle))
        assert (leg.impulse_x, leg.impulse_y) == pytest.approx(expected, abs=1e-6)


# ---- another derivation on random states ------------------------------------------------------------------------


def lemke(M, q):
    """z >= 0 with w = M z + q >= 0 and z w = 0 by Lemke's complementary pivots; None on a ray."""
    n = len(q)
    if q.min() >= 0.0:
        return np.zeros(n)
    # columns: w, z, z0, right-hand side
    table = np.hstack([np.eye(n), -M, -np.ones((n, 1)), q[:, None]])
    basis = list(range(n))
    row, entering = int(np.argmin(q)), 2 * n
    for _ in range(200):
        table[row] /= table[row, entering]
        for other in range(n):
            if other != row:
                table[other] -= table[other, entering] * table[row]
        leaving, basis[row] = basis[row], entering
        if leaving == 2 * n:
            z = np.zeros(2 * n + 1)
            z[basis] = table[:, -1]
            return z[n : 2 * n]
        entering = leaving + n if leaving < n else leaving - n
        column = table[:, entering]
        rows = [i for i in range(n) if column[i] > 1e-10]
        if not rows:
            return None
        # lexicographic smallest ratio, so that degenerate pivots do not cycle; z0 first among equals
        row = min(rows, key=lambda i: (*(np.round(table[i, [-1, *range(n)]] / column[i], 11)), basis[i] != 2 * n))
    return None


class Strike:
    """What another derivation knows of one strike: masses, contact directions, rates before, all in `Lagrange`'s z."""

    def __init__(self, body):
        other = Lagrange(body.parameters)
        z, self.before = to_z(body)
        J = other.jacobian(other.coordinates, z)
        self.mass = J.T @ (other.weights(z)[:, None] * J)
        self.J = np.vstack([other.jacobian(other.contact(foot), z) for foot in (OUTER, INNER)])
        # rates of the contacts by impulses on them; the motors turn relative to their legs and take no part
        self.W = self.J @ np.linalg.solve(self.mass, self.J.T)

    def energy(self, rates):
        return 0.5 * rates @ self.mass @ rates

    def complementarity(self, mu, feet):
        """Impulses (x, y of the outer, of the inner foot) by Lemke. Unknown per foot: normal, on, back, speed."""
        n = len(feet)
        normal, along = [2 * f + 1 for f in feet], [2 * f for f in feet]
        E = np.zeros((4, 3 * n))
        for k in range(n):
            E[normal[k], k] = 1.0
            E[along[k], n + 2 * k], E[along[k], n + 2 * k + 1] = 1.0, -1.0
        M = np.zeros((4 * n, 4 * n))
        unit = np.abs(self.W).max()  # of rates by impulses, so that pivots are about 1
        M[: 3 * n, : 3 * n] = E.T @ self.W @ E / unit
        for k in range(n):
            M[n + 2 * k : n + 2 * k + 2, 3 * n + k] = 1.0
            M[3 * n + k, k] = mu
            M[3 * n + k, n + 2 * k : n + 2 * k + 2] = -1.0
        q = np.concatenate([E.T @ self.J @ self.before, np.zeros(n)])
        z = lemke(M, q)
        return None if z is None else E @ z[: 3 * n] / unit

    def solutions(self, mu, feet):
        """Impulses of every pair of states that satisfies everything, by the 4 x 4 matrix of the contacts."""
        found = []
        for states in np.ndindex(*(4,) * len(feet)):
            A, c = np.eye(4), np.zeros(4)
            free = self.J @ self.before
            for foot, state in zip(feet, states, strict=True):
                x, y = 2 * foot, 2 * foot + 1
                if state == APART:
                    continue
                A[y], c[y] = self.W[y], -free[y]
                if state == STICKS:
                    A[x], c[x] = self.W[x], -free[x]
                else:
                    A[x, y] = mu if state == SLIDES_ON else -mu
            P = np.linalg.solve(A, c)
            rates = free + self.W @ P
            good = True
            for foot, state in zip(feet, states, strict=True):
                Px, Py, vx, vy = *P[2 * foot : 2 * foot + 2], *rates[2 * foot : 2 * foot + 2]
                good &= vy > -1e-9 and Py > -1e-9 and abs(Px) < mu * Py + 1e-9
                good &= (state != SLIDES_ON or vx > -1e-9) and (state != SLIDES_BACK or vx < 1e-9)
            if good and not any(np.allclose(P, other, atol=1e-6) for other in found):
                found.append(P)
        return found


def random_strike(seed, stream):
    """A body with one foot standing and the other about to meet the floor, with random parameters and rates."""
    parameters = BodyParameters(
        outer_mass_offset_kg_m=0.06 * stream.normal(),
        inner_mass_offset_kg_m=0.06 * stream.normal(),
        inner_mass_moment_kg_m=0.5 + 0.4 * stream.uniform(),
        foot_inertia_kg_m2=0.0001 + 0.004 * stream.uniform(),
        outer_ankle_offset_m=0.13 + 0.01 * stream.uniform(),
        inner_ankle_offset_m=0.13 + 0.01 * stream.uniform(),
        floor_friction=0.1 + 1.1 * stream.uniform(),
        contact="coulomb",
    )
    body = Body(parameters)
    closed_posture(body, stream, seed % 2)
    trailing, leading = body.swing, body.stance
    body.mode = SINGLE
    body.stand_on(trailing)
    set_random_rates(body, stream)
    for leg in (body.outer, body.inner):
        leg.foot_rate *= 5.0  # feet turn faster than legs: 5 rad/s and more in a push-off
    body.update_hip_rates()
    if Strike(body).J[2 * leading.side + 1] @ to_z(body)[1] > 0.0:  # it would rise: turned round it strikes
        for leg in (body.outer, body.inner):
            leg.rate, leg.foot_rate = -leg.rate, -leg.foot_rate
        body.update_hip_rates()
    return body, trailing, leading


def test_a_strike_obeys_coulomb_and_complementarity_in_another_derivation():
    stream = RandomStream(0, "coulomb strike")
    kinds = set()
    for trial in range(240):
        body, trailing, leading = random_strike(trial, stream)
        one = Strike(body)
        mu = body.parameters.floor_friction
        collide(body, leading, True)
        kinds.add(tuple(body.equations.state))
        P = np.array([body.outer.impulse_x, body.outer.impulse_y, body.inner.impulse_x, body.inner.impulse_y])
        after = to_z(body)[1]
        # momentum: rounding 1e-16 times a condition of 1e6 times impulses of 10 N s
        assert one.mass @ (after - one.before) == pytest.approx(one.J.T @ P, abs=1e-8)
        rates = one.J @ after
        size = max(1.0, np.abs(P).max())
        for foot in (OUTER, INNER):
            Px, Py, vx, vy = *P[2 * foot : 2 * foot + 2], *rates[2 * foot : 2 * foot + 2]
            assert Py >= -1e-11 * size and abs(Px) <= mu * Py + 1e-11 * size
            assert vy >= -1e-9 * size and abs(vy * Py) < 1e-8 * size**2
            assert abs(vx) < 1e-9 * size or Px * math.copysign(1.0, vx) == pytest.approx(-mu * Py, abs=1e-10 * size)
        # never gains; both derivations' rounding
        assert one.energy(after) <= one.energy(one.before) * (1.0 + 1e-10)
    assert len(kinds) >= 3 and {STICKS, SLIDES_ON, SLIDES_BACK} <= {state for pair in kinds for state in pair}


@pytest.mark.parametrize("seed", range(3))
def test_a_strike_has_the_impulses_of_lemkes_algorithm(seed):
    """Where there is one solution. Friction may allow several: then ours and Lemke's are both among them."""
    stream = RandomStream(seed, "lemke")
    compared = several = 0
    for _ in range(60):
        body, trailing, leading = random_strike(seed, stream)
        one = Strike(body)
        mu = body.parameters.floor_friction
        theirs = one.complementarity(mu, (OUTER, INNER))
        every = one.solutions(mu, (OUTER, INNER))
        collide(body, leading, True)
        ours = np.array([body.outer.impulse_x, body.outer.impulse_y, body.inner.impulse_x, body.inner.impulse_y])
        size = max(1.0, np.abs(ours).max())
        assert any(np.allclose(ours, P, atol=1e-8 * size) for P in every)
        assert theirs is not None
        if len(every) == 1:
            assert theirs == pytest.approx(ours, abs=1e-8 * size)
            compared += 1
        else:
            several += 1
    assert compared >= 50, several


@pytest.mark.parametrize("leg", [OUTER, INNER])
def test_a_landing_on_one_foot_has_the_impulses_of_lemkes_algorithm(leg):
    stream = RandomStream(leg, "landing")
    for _ in range(60):
        body, _, _ = random_strike(leg, stream)
        body.hip_vy -= 1.0
        one = Strike(body)
        theirs = one.complementarity(body.parameters.floor_friction, (leg,))
        collide(body, body.leg(leg), False)
        foot = body.leg(leg)
        assert (foot.impulse_x, foot.impulse_y) == pytest.approx(theirs[2 * leg : 2 * leg + 2], abs=1e-8)
        assert body.other(foot).impulse_x == body.other(foot).impulse_y == 0.0


def test_a_foot_that_comes_down_slowly_takes_an_impulse_in_proportion():
    """No threshold: a strike at a millionth of the rates has a millionth of the impulses and the same states."""
    stream = RandomStream(3, "slow")
    for _ in range(20):
        found = []
        body, trailing, leading = random_strike(1, stream)
        rates = [(leg.rate, leg.foot_rate) for leg in (body.outer, body.inner)]
        for factor in (1.0, 1e-6):
            for leg, (rate, foot_rate) in zip((body.outer, body.inner), rates, strict=True):
                leg.rate, leg.foot_rate = factor * rate, factor * foot_rate
            body.stand_on(trailing)
            body.mode = SINGLE
            body.update_hip_rates()
            collide(body, leading, True)
            found.append((tuple(body.equations.state), leading.impulse_y / factor, trailing.impulse_x / factor))
        assert found[0][0] == found[1][0]
        assert found[1][1:] == pytest.approx(found[0][1:], rel=1e-9, abs=1e-9)
