"""Recordings of three machines with one hidden effect each: a thrust stand, a heated rod, an elastic joint.

Runge and Kutta's method in plain numbers, with steps far finer than the samples; nothing of the diagnosis is used, and
the hidden effects are written otherwise than its candidates: a winding that heats by what it dissipates, friction of
constant sign, radiation in kelvin, a low-pass as a further state.
"""

import math

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table

FINE = 8  # steps of the integration per sample


def integrated(rates, state, drive, step_s):
    """(rows, states) at each sample. drive: (rows * FINE + 1,), straight lines between the fine steps."""
    out, h = [], step_s / FINE
    for number in range((len(drive) - 1) // FINE):
        out.append(state)
        for fine in range(number * FINE, (number + 1) * FINE):
            low, high = drive[fine], drive[fine + 1]
            middle = 0.5 * (low + high)
            a = rates(state, low)
            b = rates([x + 0.5 * h * d for x, d in zip(state, a, strict=True)], middle)
            c = rates([x + 0.5 * h * d for x, d in zip(state, b, strict=True)], middle)
            d = rates([x + h * e for x, e in zip(state, c, strict=True)], high)
            state = [x + h / 6.0 * (p + 2.0 * (q + r) + s) for x, p, q, r, s in zip(state, a, b, c, d, strict=True)]
    return np.array(out)


def table(name, time_s, **columns):
    return Table(time_s, columns, (slice(0, len(time_s)),), name)


def thrust_stand(cause, size, seed, seconds=20.0, rate_hz=200.0):
    """Motor and propeller; voltage, thrust, speed and current are logged."""
    draw = generator(seed, "thrust stand")
    rows = round(seconds * rate_hz)
    fine_s = np.arange(rows * FINE + 1) / rate_hz / FINE
    levels = draw.uniform(5.0, 13.0, int(seconds) + 2)
    waves = [(f, draw.uniform(0.0, 6.28)) for f in (0.3, 0.7, 1.3, 2.1, 3.7)]

    def given(at_s):
        slow = np.interp(at_s, np.arange(len(levels)), levels)
        return slow + sum(0.35 * np.sin(2.0 * np.pi * f * at_s + phase) for f, phase in waves)

    volts = given(fine_s)
    driven = given(fine_s - size) if cause == "late" else volts  # before the recording it was another one
    resistance, constant, thrust = 0.145, 0.0113, 7.9e-6

    def current(speed, heat, v):
        return (v - constant * speed) / (resistance * (1.0 + (size * heat if cause == "heating" else 0.0)))

    def rates(state, v):
        speed, heat, lagging, clock_s = state
        bearing = 2.1e-5 * (1.0 + (size * math.exp(-clock_s / 3.0) if cause == "warming" else 0.0))
        bearing *= 1.0 + (size if cause == "seizing" and clock_s > 0.43 * seconds else 0.0)
        i = current(speed, heat, v)
        torque = constant * i - bearing * speed - 1.15e-7 * speed * speed
        torque -= math.copysign(size, speed) if cause == "coulomb" else 0.0
        filtered = (thrust * speed * speed - lagging) / size if cause == "lag" else 0.0
        return torque / 4.2e-5, (i * i / 100.0 - heat) / 8.0, filtered, 1.0

    done = integrated(rates, [400.0, 0.0, thrust * 400.0**2, 0.0], driven.tolist(), 1.0 / rate_hz)
    pull = done[:, 2] if cause == "lag" else thrust * done[:, 0] ** 2
    pull = pull * (1.0 + (size if cause == "scale" else 0.0)) + (size if cause == "offset" else 0.0)
    return table(
        f"thrust stand {cause} {seed}",
        fine_s[:-1:FINE],
        voltage_V=volts[:-1:FINE],
        thrust_N=pull + 0.02 * draw.normal(size=rows),
        speed_rad_per_s=done[:, 0] + 0.5 * draw.normal(size=rows),
        current_A=current(done[:, 0], done[:, 1], driven[:-1:FINE]) + 0.05 * draw.normal(size=rows),
    )


def heated_rod(cause, size, seed, seconds=6000.0, step_s=5.0):
    """A rod that is heated at one end in steps of 300 s; the temperatures of both ends are logged."""
    draw = generator(seed, "heated rod")
    rows = round(seconds / step_s)
    power = np.repeat(draw.choice([0.0, 20.0, 40.0, 60.0], int(seconds / 300.0) + 1), round(300.0 / step_s))[:rows]
    power[: rows // 8] = 40.0
    air = 22.0

    def rates(state, watts):
        hot, cold, clock_s = state
        loss = 0.35 / (1.0 + (0.35 * size * clock_s if cause == "fouling" else 0.0))  # a layer grows, in series
        loss *= 1.0 + (size if cause == "opening" and clock_s > 0.55 * seconds else 0.0)
        through = 1.6 * (hot - cold)
        given = watts * (1.0 - (size if cause == "heater" else 0.0)) - through - 0.25 * (hot - air)
        given -= size * ((hot + 273.15) ** 4 - (air + 273.15) ** 4) if cause == "radiation" else 0.0
        return given / 150.0, (through - loss * (cold - air)) / 220.0, 1.0

    held = np.repeat(power, FINE)
    if cause == "late":
        after = round(size / step_s * FINE)
        held = np.concatenate((held[:1].repeat(after), held))[: len(held)]
    out, state = [], [air, air, 0.0]
    for number in range(rows):  # the power of a sample until the next
        part = held[number * FINE : (number + 1) * FINE].tolist()
        out.append(state)
        state = integrated(rates, state, [*part, part[-1], *part], step_s)[1].tolist()
    done, time_s = np.array(out), np.arange(rows) * step_s
    return table(
        f"heated rod {cause} {seed}",
        time_s,
        heater_W=power,
        hot_C=done[:, 0] + 0.05 * draw.normal(size=rows),
        cold_C=done[:, 1] + (size * time_s / seconds if cause == "drift" else 0.0) + 0.05 * draw.normal(size=rows),
    )


def elastic_joint(cause, size, seed, seconds=20.0, rate_hz=250.0):
    """A motor turns a link through a compliant gear; its torque and both angles in counts of 14 bits are logged."""
    draw = generator(seed, "elastic joint")
    rows = round(seconds * rate_hz)
    fine_s = np.arange(rows * FINE + 1) / rate_hz / FINE
    torque = sum(
        draw.uniform(1.0, 3.0) * np.sin(2.0 * np.pi * f * fine_s + draw.uniform(0.0, 6.28))
        for f in (0.25, 0.6, 1.1, 1.9, 3.1, 5.3)
    )
    torque *= 8.0 / np.max(np.abs(torque))

    def rates(state, given):
        motor, link, motor_rate, link_rate, clock_s = state
        twist = motor - link
        gear = 180.0 + (size * clock_s if cause == "softening" else 0.0)
        gear += size if cause == "cracking" and clock_s > 0.31 * seconds else 0.0
        through = gear * twist + 0.15 * (motor_rate - link_rate)
        through += size * twist**3 if cause == "cubic" else 0.0
        given += size if cause == "leaning" and clock_s > 0.57 * seconds else 0.0
        load = 0.06 * link_rate
        load += size * math.sin(link) if cause == "gravity" else 0.0
        load += size * link_rate * abs(link_rate) if cause == "drag" else 0.0
        return motor_rate, link_rate, (given - through - 0.12 * motor_rate) / 0.02, (through - load) / 0.11, 1.0

    done = integrated(rates, [0.0] * 5, torque.tolist(), 1.0 / rate_hz)
    angles = done[:, :2] + 2e-4 * draw.normal(size=(rows, 2))
    angles[:, 1] *= 1.0 + (size if cause == "scale" else 0.0)
    angles[:, 1] += (size if cause == "slipping" else 0.0) * (fine_s[:-1:FINE] > 0.64 * seconds)
    count = 2.0 * np.pi / 16384
    motor, link = (np.round(angles / count) * count).T
    return table(
        f"elastic joint {cause} {seed}", fine_s[:-1:FINE], torque_Nm=torque[:-1:FINE], motor_rad=motor, link_rad=link
    )
