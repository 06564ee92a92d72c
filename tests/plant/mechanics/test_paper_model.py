"""Known answers for the corrected equations: the figures of another implementation of the same robot.

Those figures (robot.md C5.1) carry 9 to 10 digits; agreement is asked to a few units of
their last digit, which is 1e-9 of the largest term. The other implementation's parameters differ from ours (hip
inertia 0.53, ground friction 0.1, hip viscosity 0.1, no hip rotor), so they are set here.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ranger_sim.foundation.random_stream import RandomStream
from tests.plant.mechanics import paper_model as pm

C = 0.72 / 4.955
SIM = pm.PaperParameters(c=C, Jl=0.53 - 0.72 * C, C1=0.1, C2=0.1, JH=0.0)
FREE = pm.PaperParameters(c=C, Jl=0.53 - 0.72 * C, C1=0.0, C2=0.0, JH=0.0)
GK_HIP, GK_ANKLE = 66 * 0.018, 34 * 0.018


def motor(gk, current, rate, c1, c0=0.1, mu=0.1):
    """Output torque with the other implementation's smoothing, which is not ours."""
    return gk * current * (1 - mu * math.tanh(100 * current * rate)) - c1 * rate - c0 * math.tanh(100 * rate)


def torques(u, stance=0.0, hip=0.0, swing=0.0):
    return pm.Torques(
        motor(GK_ANKLE, stance, u[2], 0.01), motor(GK_HIP, hip, u[3], 0.1), motor(GK_ANKLE, swing, u[5], 0.01)
    )


S1_Q = np.array([-0.10, 0.15, 0.17, -0.30, 0.5, 0.5])  # q1 counted from upright
S1_U = np.array([-0.9, 0.2, 0.1, 1.5, 0.3, 0.3])
S2_Q = np.array([0.05, -0.1, -0.1, 0.2, 0.3, 0.3])
S2_U = np.array([-1.2, 0.1, 0.0, 1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("p", "q", "u", "currents", "expected"),
    [
        (SIM, S1_Q, S1_U, (0, 0), (46.34874916, -50.78653874, -205.9904842, 3.762153608, 91.94759599)),
        (SIM, S1_Q, S1_U, (0.8, 1.5), (16.13137677, -17.7031745, 32.24481587, 9.729717842, 93.21077409)),
        (FREE, S1_Q, S1_U, None, (24.14173534, -26.44266293, -151.384083, 6.388076151, 93.30446347)),
        (FREE, S2_Q, S2_U, None, (4.806010686, -5.450920494, 0.0, -6.314813451, 90.20283641)),
    ],
    ids=["friction", "friction and currents", "free", "free, other state"],
)
def test_single_stance_accelerations_agree_with_another_implementation(p, q, u, currents, expected):
    T = pm.Torques() if currents is None else torques(u, stance=currents[0], hip=currents[1])
    acc = pm.single_stance(p, q, u, T)
    found = [*acc[:4], pm.stance_force(p, q, u, acc)[1]]
    # ten significant digits are printed; the largest acceleration is 206
    assert found == pytest.approx(expected, rel=2e-9, abs=1e-8)


def test_the_hip_accelerates_as_another_implementation_says():
    for p, T, expected in (
        (SIM, torques(S1_U), (0.0905011, -0.67721904)),
        (FREE, pm.Torques(), (0.0525122, -0.53587545)),
    ):
        acc = pm.single_stance(p, S1_Q, S1_U, T)
        assert pm.hip_acceleration(p, S1_Q, S1_U, acc) == pytest.approx(expected, abs=1e-7)


SWING_START = np.array([0.0, 0.2, 0.2, 0.4, 0.2, 0.2, -0.9, 0.0, 0.0, -1.5, 0.0, 0.0])


def swing(t_eval, p, currents=None, tolerance=1e-11):
    """Single stance from the published start; the 13th state is the motors' energy by the published formula."""

    def positive(power):
        return 0.5 * (power + math.sqrt(power * power + 0.01))

    def rhs(_, y):
        q, u = y[:6], y[6:12]
        if currents is None:
            return [*u, *pm.single_stance(p, q, u), 0.0]
        i_s, i_h = currents
        acc = pm.single_stance(p, q, u, torques(u, stance=i_s, hip=i_h))
        power = 0.0  # of the hip and the stance ankle; that implementation leaves the swing ankle out
        for gk, i, rate in ((GK_HIP, i_h, u[3]), (GK_ANKLE, i_s, u[2])):
            volts = i * (1.0 + 1.5 / math.sqrt(i * i + 1e-4)) + gk * rate
            power += positive(volts * i)
        return [*u, *acc, power]

    y0 = [*SWING_START, 0.0]
    done = solve_ivp(rhs, (0, t_eval[-1]), y0, "DOP853", t_eval=t_eval, rtol=tolerance, atol=1e-12)
    return done.y.T


# t: q1 u1 q2 u2 q2m u2m q3 u3 (q1 from pi)
FREE_SWING = {
    0.05: (2.990065289, -2.840152015, 0.319842956, 2.253535068, 0.337602867, 5.497537711, 0.325218866, -1.710113479),
    0.10: (2.939909190, 2.836636106, 0.334334795, -3.886985940, 0.335545601, -2.398375794, 0.222940172, -2.548539975),
    0.20: (
        3.201388918,
        -3.474891272,
        -0.022891997,
        3.138899484,
        -0.041467575,
        -0.011762952,
        -0.042548754,
        -2.112292813,
    ),
    0.30: (3.074811266, 4.711056951, 0.049283460, -5.837496377, 0.094339568, -3.059029869, -0.257506140, -2.466812095),
}
DRIVEN_SWING = {  # and the motors' energy
    0.05: (3.004313875, -2.501761247, 0.304168138, 1.879173050,
           0.323393067, 4.108321177, 0.325968771, -1.656997149, 0.056789754),
    0.10: (2.953563264, 0.980833947, 0.319145700, -1.847267526,
           0.351709408, -0.940358530, 0.230155180, -2.202702618, 0.090315313),
    0.20: (3.083262541, 0.041981564, 0.106487804, -0.704484023,
           0.117989932, -0.655628290, 0.000660352, -2.150266147, 0.106469512),
    0.30: (3.084583426, 0.593772731, 0.040047225, -1.307890193,
           0.065287478, -1.474351606, -0.194406492, -1.731738449, 0.152999185),
}  # fmt: skip


def in_their_order(row):
    q, u = row[:6], row[6:12]
    return [q[0] + math.pi, u[0], q[1], u[1], q[2], u[2], q[3], u[3]]


def test_a_free_swing_follows_the_published_trajectory():
    for row, expected in zip(swing(list(FREE_SWING), FREE), FREE_SWING.values(), strict=True):
        # both integrations run at 1e-11 and are expanded by the stance foot's rocking; 1e-8 is their printed digit x 10
        assert in_their_order(row) == pytest.approx(expected, abs=1e-8)


def test_a_driven_swing_follows_the_published_trajectory_and_energy():
    rows = swing(list(DRIVEN_SWING), SIM, currents=(0.3, 0.5), tolerance=1e-9)
    for row, expected in zip(rows, DRIVEN_SWING.values(), strict=True):
        # their own tolerance was 1e-9; two such runs share 1e-8 in rates of up to 4 rad/s
        assert in_their_order(row) == pytest.approx(expected[:8], abs=2e-8)
        assert row[12] == pytest.approx(expected[8], abs=2e-8)


def test_energy_is_kept_in_a_free_swing():
    e = [pm.energy(FREE, row[:6], row[6:12]) for row in swing([0.0, 0.1, 0.3], FREE)]
    # relative tolerance 1e-11 per step over some hundred steps
    assert np.ptp(e) < 1e-9 * abs(e[0])
    # published total energy; their swing ankle motor stands still as ours does
    assert e[0] == pytest.approx(91.468716929, abs=1e-9)


Y0_Q = np.array([3.1416 - math.pi, 0.2462, 0.2462, 0.4924, -0.2462, -0.0672])
Y0_U = np.array([-12.2162, 12.3709, 0.0, 0.3094, 8.8608, 8.3202])


@pytest.mark.parametrize(
    ("p", "currents", "expected"),
    [
        (SIM, (0, 0, 0), (-178.9460891, 198.2064999,
               0, 6.572086404, 123.7704845, -1453.937067, 125.0250379, 91.17872419)),
        (SIM, (0.5, 1, 3), (-194.3260003, 215.0730988,
               165.4411765, 9.545655085, 106.9018894, -560.5547145, 123.5621673, 89.7160487)),
        (FREE, None, (-231.0848453, 252.8284382, 0, 11.53877341, 122.045263, -1354.887543, 82.74832039, 128.568754)),
    ],
    ids=["friction", "friction and currents", "free"],
)  # fmt: skip
def test_double_stance_accelerations_agree_with_another_implementation(p, currents, expected):
    T = pm.Torques() if currents is None else torques(Y0_U, *currents)
    acc, P = pm.double_stance(p, Y0_Q, Y0_U, T)
    found = [*acc, pm.stance_force(p, Y0_Q, Y0_U, acc, P)[1], P[1]]
    # the published start is known to the digits printed above, the results to ten digits
    assert found == pytest.approx(expected, rel=2e-9, abs=2e-8)


def stride_end(p, until, stop_at_toe_off=True):
    """Double stance from Y0 without currents: time, q, u, accelerations, rear force at the end."""

    def solved(y):
        q, u = y[:6], y[6:]
        T = pm.Torques() if p is FREE else torques(u)
        return q, u, *pm.double_stance(p, q, u, T)

    def rhs(_, y):
        _, u, acc, _ = solved(y)
        return [*u, *acc]

    def rear(_, y):
        return solved(y)[3][1]

    rear.terminal = stop_at_toe_off
    done = solve_ivp(rhs, (0, until), [*Y0_Q, *Y0_U], "DOP853", events=rear, rtol=1e-10, atol=1e-12)
    return done.t[-1], *solved(done.y[:, -1])


def test_double_stance_follows_the_published_trajectory():
    _, q, u, acc, P = stride_end(FREE, 0.010)
    expected = (3.0104321, -13.3955205, 0.3799273, 13.7091154, 0.2619503, 4.6659276, 0.4957111, 0.2864605)
    found = in_their_order([*q, *u])
    # seven decimals are printed
    assert found == pytest.approx(expected, abs=2e-7)
    assert (q[4], u[4], q[5], u[5]) == pytest.approx((-0.1497551, 10.5412966, -0.0464766, -3.2096480), abs=2e-7)
    assert (pm.stance_force(FREE, q, u, acc, P)[1], P[1]) == pytest.approx((227.1533, 50.9359), abs=1e-4)


@pytest.mark.parametrize(
    ("p", "t_off", "angles", "rates", "front"),
    [
        (FREE, 0.0229439, (2.87307671, 0.51841438, 0.40963496, 0.49582284, -0.01148698),
         (-7.01628118, 6.77973489, 18.01414395, -0.27613397, 9.88822969), 106.4866),
        (SIM, 0.01796316, (2.93563006, 0.45459934, 0.31956069, 0.49494716, -0.06610395),
         (-7.64962865, 7.47135319, 11.28847343, -0.24012511, 10.19154103), 145.6026),
    ],
    ids=["free", "friction"],
)  # fmt: skip
def test_the_rear_foot_leaves_when_another_implementation_says(p, t_off, angles, rates, front):
    t, q, u, acc, P = stride_end(p, 0.1)
    # Their linkage had opened by 3.4e-6 m at the end, which shifts the crossing by about 1e-6 s (the rear force falls
    # by 5 kN/s); angles turn at up to 18 rad/s, rates change by up to 1.5e3 rad/s^2; their integration adds as much.
    assert t == pytest.approx(t_off, abs=2e-6)
    assert [q[0] + math.pi, *q[1:5]] == pytest.approx(angles, abs=6e-5)
    assert u[:5] == pytest.approx(rates, abs=4e-3)
    assert pm.stance_force(p, q, u, acc, P)[1] == pytest.approx(front, abs=0.05)


R = np.array([0.0, -0.2, -0.2, -0.4, 0.2, 0.2])


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((-1.0, 0.05, 0.05, -0.3, 0.1, 0.0), (-13.18456025, 13.52118569, 0, 0.6732508907, 5.809740706, 0.05)),
        ((-0.7, 0.0, 0.05, 0.0, 0.0, 0.0), (-8.617303798, 8.780601063, 0, 0.3265945293, 5.039773118, 0.05)),
    ],
)
def test_heel_strike_gives_the_published_rates(before, after):
    q, u, P = pm.strike_to_double(FREE, R, np.array(before))
    assert q == pytest.approx([0, 0.2, 0.2, 0.4, -0.2, -0.2], abs=1e-15)
    assert u == pytest.approx(after, rel=2e-9, abs=2e-9)
    assert P[1] < 0.0  # the rule of the appendix pulls at the trailing foot here


@pytest.mark.parametrize("foot", ["stance", "trailing"])
def test_rolling_friction_takes_exactly_its_power(foot):
    """The test that settles the signs of the rolling friction's moments (errata 3 and 4)."""
    p = pm.PaperParameters(C1=0.1 if foot == "stance" else 0.0, C2=0.1 if foot == "trailing" else 0.0)
    q, u, _ = pm.strike_to_double(p, R, np.array([-1.0, 0.05, 0.05, -0.3, 0.1, 0.0]))
    acc, _ = pm.double_stance(p, q, u)
    step = 1e-6

    def energy_after(dt):
        return pm.energy(p, q + u * dt + acc * dt * dt / 2, u + acc * dt)

    power = (energy_after(step) - energy_after(-step)) / (2 * step)
    rate = u[0] if foot == "stance" else pm.rates_of(u)[3]
    # central difference: third derivatives of the energy (1e7 W/s^2 here) times step^2
    assert power == pytest.approx(-0.1 * rate**2, abs=1e-4)


def test_no_strike_gives_energy():
    """Random postures and rates, both kinds of strike: kinetic energy falls, momentum balances hold."""
    stream = RandomStream(1, "strikes")
    p = pm.PaperParameters()
    for _ in range(200):
        lean = 0.15 + 0.2 * stream.uniform()
        ankles = [0.4 * stream.normal() for _ in range(2)]
        r = np.array([-ankles[0], ankles[0] - lean + 0.05 * stream.normal(), 0.1, -2 * lean, ankles[1], 0.2])
        v = np.array([stream.normal() for _ in range(6)])
        for strike in (lambda r, v: pm.strike_to_double(p, r, v)[:2], lambda r, v: pm.strike_to_single(p, r, v)):
            q, u = strike(r, v)
            legs_only = dataclasses.replace(p, JA=0.0, ks=0.0, g=0.0, kh=0.0)
            # sums of terms of order 10 J: 1e-12 relative is their rounding
            assert pm.energy(legs_only, q, u) <= pm.energy(legs_only, r, v) * (1 + 1e-12)
