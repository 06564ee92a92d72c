"""The appendix's section 6: Ranger's equations reduced to walkers about which everything is known.

Both reductions use the balances and momenta of `paper_model.py` with the parameters of the appendix's table 1,
integrated by scipy's DOP853 near rounding, the strike polished by Newton steps on its time. Run as a module it prints
the figures. `step_errors` measures the running plant's step length and friction smoothing (EQUATIONS 15).
"""

import dataclasses
import math

import numpy as np
from scipy.integrate import solve_ivp

from ranger_sim.plant.mechanics.body import SINGLE, Body
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.stance import on_feet
from tests.plant.mechanics import paper_model as pm

RTOL = 2.3e-14  # about 100 roundings, the least scipy accepts
ATOL = 1e-15

# Table 1 of the appendix; its J_l is one leg's, hence 0.5 for the wheel (robot.md P2).
WHEEL = pm.PaperParameters(
    el=1.0, r=0.0, d=0.0, c=0.0, kh=0.0, ks=0.0, Jl=0.25, m=0.0, M=1.0, g=1.0, gamma=0.2, C1=0.0, C2=0.0, JH=0.0
)
WHEEL_SPOKES = 6
SIMPLEST = pm.PaperParameters(
    el=1.0, r=0.0, d=0.0, c=1.0, kh=0.0, ks=0.0, Jl=0.0, m=1.0, M=1e6, g=1.0, gamma=0.009, C1=0.0, C2=0.0, JH=0.0
)
# Published values [appendix 6.2, 6.3; robot.md P2].
WHEEL_FIXED_POINT = (0.523598775598299, -0.460341126609458)
WHEEL_EIGENVALUE = 4.0 / 9.0
SIMPLEST_FIXED_POINT = (0.200310750572952, -0.199832546623605, 0.400621501145903, -0.015822982402147)
SIMPLEST_EIGENVALUE = complex(-0.1901062134, 0.5575865781)  # central differences of 1e-5
SIMPLEST_EIGENVALUE_TRUE = complex(-0.1901064148, 0.5575860809)  # Richardson


def integrate_to(rhs, y0, event, slope, limit_s, armed_from_s):
    """State where `event` falls to 0 after `armed_from_s`, polished by Newton on the time with `slope` = d event/dt."""
    first = solve_ivp(rhs, (0.0, armed_from_s), y0, "DOP853", rtol=RTOL, atol=ATOL)

    def stop(_t, y):
        return event(y)

    stop.terminal = True  # type: ignore[attr-defined]  # scipy wants it so
    done = solve_ivp(rhs, (armed_from_s, limit_s), first.y[:, -1], "DOP853", events=stop, rtol=RTOL, atol=ATOL)
    if not len(done.t_events[0]):
        raise ArithmeticError(f"the walker does not strike within {limit_s} s")
    y = done.y_events[0][0]
    for _ in range(3):
        step = -event(y) / slope(y)
        # two terms of the Taylor series: the step is some 1e-13 s
        mid = y + 0.5 * step * np.asarray(rhs(0.0, y))
        y = y + step * np.asarray(rhs(0.0, mid))
    return y


# ---- rimless wheel: hip and ankles locked, masses at the hip -------------------------------------------------


def wheel_step(state, p=WHEEL, spokes=WHEEL_SPOKES):
    """The stride function (q1, q1') of Coleman's wheel, just after one strike to just after the next."""
    between = 2.0 * math.pi / spokes
    still = np.zeros(6)

    def posture(q1, u1):
        return np.array([q1, 0, 0, -between, 0, 0]), np.array([u1, 0, 0, 0, 0, 0])

    def rhs(_, y):
        q, u = posture(*y)

        def about_P1(X):
            trial = still.copy()
            trial[0] = X[0]
            return pm.balances(p, q, u, pm.Torques(), trial)[:1]

        return np.array([y[1], pm.solve_affine(about_P1, 1)[0]])

    y = integrate_to(rhs, np.asarray(state, float), lambda y: y[0] + between / 2, lambda y: y[1], 20.0, 0.1)
    r, v = posture(*y)
    q = pm.swapped(r)
    old = pm.momenta(p, r, v, "P2", (1, 2))

    def residual(X):
        u = np.array([X[0], 0, 0, 0, 0, 0])
        return np.array([pm.momenta(p, q, u, "P1", (1, 2)) - old])

    return np.array([q[0], pm.solve_affine(residual, 1)[0]])


# ---- simplest walker: point feet, masses at hip and feet -----------------------------------------------------


def simplest_step(state, p=SIMPLEST):
    """The stride function (q1, q1', q3, q3') of the simplest walker; mid-stance scuffing is ignored as it must be."""

    def spread(y):
        return np.array([y[0], 0, 0, y[2], 0, 0]), np.array([y[1], 0, 0, y[3], 0, 0])

    def rhs(_, y):
        q, u = spread(y)

        def about_P1_and_H(X):
            trial = np.array([X[0], 0, 0, X[1], 0, 0])
            return pm.balances(p, q, u, pm.Torques(), trial)[[0, 2]]

        a1, a3 = pm.solve_affine(about_P1_and_H, 2)
        return np.array([y[1], a1, y[3], a3])

    # The heel's height is 0 where the legs coincide (the scuff) and where q3 = 2 q1 (the strike).
    y = integrate_to(rhs, np.asarray(state, float), lambda y: 2 * y[0] - y[2], lambda y: 2 * y[1] - y[3], 6.0, 2.5)
    r, v = spread(y)
    q = pm.swapped(r)
    old = pm.momenta(p, r, v, "P2", (1, 2)), pm.momenta(p, r, v, "H", (1,))

    def residual(X):
        u = np.array([X[0], 0, 0, X[1], 0, 0])
        return np.array([pm.momenta(p, q, u, "P1", (1, 2)) - old[0], pm.momenta(p, q, u, "H", (2,)) - old[1]])

    u1, u3 = pm.solve_affine(residual, 2)
    return np.array([q[0], u1, q[3], u3])


def jacobian(step, x, h):
    """Central differences of a stride function."""
    columns = []
    for k in range(len(x)):
        e = np.zeros(len(x))
        e[k] = h
        columns.append((step(x + e) - step(x - e)) / (2 * h))
    return np.column_stack(columns)


def fixed_point(step, guess, rounds=3):
    """Newton's method on step(x) - x: a Jacobian at the guess, a second one nearer, `rounds` corrections with each."""
    x = np.asarray(guess, float)
    for h in (1e-4, 1e-5):
        J = jacobian(step, x, h) - np.eye(len(x))
        for _ in range(rounds):
            x = x - np.linalg.solve(J, step(x) - x)
    return x


def largest_eigenvalue(J):
    """By magnitude; of a conjugate pair the one with the positive imaginary part."""
    values = np.linalg.eigvals(J)
    value = complex(max(values, key=abs))
    return complex(value.real, abs(value.imag))


def richardson(step, x, h):
    """Jacobian without the h^2 term of its truncation error."""
    return (4.0 * jacobian(step, x, h / 2) - jacobian(step, x, h)) / 3.0


# ---- the running plant: what its step and its smoothing cost -------------------------------------------------


def swing_state(body):
    """A step's worth of single stance without a strike: mid-swing posture, motors pulling."""
    body.outer.angle, body.inner.angle = -0.05, 0.15
    body.outer.foot_angle, body.inner.foot_angle = 0.1, 0.15 - 1.2
    body.outer.motor_angle, body.inner.motor_angle = 0.17, -1.2
    body.outer.rate, body.inner.rate = 0.7, -1.0
    body.outer.foot_rate, body.inner.foot_rate = 0.9, -1.0
    body.outer.motor_rate, body.inner.motor_rate = 0.0, 0.0
    body.mode = SINGLE
    body.hip.drive, body.hip.coulomb, body.hip.viscous = 1.2, 0.22, 0.01
    body.outer.drive, body.outer.coulomb, body.outer.viscous = 0.5, 0.15, 0.01
    body.inner.drive, body.inner.coulomb, body.inner.viscous = 0.3, 0.13, 0.01


def swing_end(step_s, smoothing, seconds=0.1):
    """Angles after `seconds` of that swing with the step and the smoothing (rad/s) given."""
    body = Body(dataclasses.replace(BodyParameters(), friction_smoothing_rad_s=smoothing))
    swing_state(body)
    for _ in range(round(seconds / step_s)):
        on_feet(body, step_s, 4)
    return np.array([body.outer.foot_angle, body.outer.angle, body.inner.angle, body.inner.foot_angle])


def step_errors(steps_us=(500.0, 250.0, 125.0, 62.5, 31.25), smoothings=(0.05, 0.01)):
    """Rows (step us, smoothing rad/s, largest angle error rad against steps of 3.90625 us) of 0.1 s of swing."""
    rows = []
    for smoothing in smoothings:
        exact = swing_end(3.90625e-6, smoothing)
        for step in steps_us:
            error = np.abs(swing_end(step * 1e-6, smoothing) - exact).max()
            rows.append((step, smoothing, float(error)))
    return rows


def smoothing_errors(smoothings=(0.1, 0.05, 0.02, 0.01)):
    """Rows (smoothing rad/s, largest angle difference rad from a smoothing of 0.001 rad/s) of 0.1 s of swing."""
    sharp = swing_end(7.8125e-6, 0.001)
    return [(s, float(np.abs(swing_end(15.625e-6, s) - sharp).max())) for s in smoothings]


def report() -> str:
    """Every figure as text."""
    wheel = fixed_point(wheel_step, (0.5, -0.45))
    walker = fixed_point(simplest_step, (0.2003, -0.1998, 0.4006, -0.0158))
    lines = [
        f"rimless wheel      {wheel[0]:.15f} {wheel[1]:.15f}",
        f"  eigenvalue       {largest_eigenvalue(jacobian(wheel_step, wheel, 1e-5)).real:.15f}  (4/9)",
        "simplest walker    " + " ".join(f"{x:.15f}" for x in walker),
        f"  eigenvalue       {largest_eigenvalue(jacobian(simplest_step, walker, 1e-5)):.10f}  (differences of 1e-5)",
        f"  eigenvalue       {largest_eigenvalue(richardson(simplest_step, walker, 2e-4)):.10f}  (Richardson)",
        "step of the plant, smoothing, angle error after 0.1 s",
        *(f"  {step:7.2f} us {smoothing:6.3f} rad/s {error:.1e} rad" for step, smoothing, error in step_errors()),
        "smoothing, angle difference from a sharp one after 0.1 s",
        *(f"  {smoothing:6.3f} rad/s {error:.1e} rad" for smoothing, error in smoothing_errors()),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    print(report())
