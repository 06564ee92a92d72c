"""What drives a machine, on the fine grid: steps, a chirp, a sum of sines, or the target of a feedback law."""

import numpy as np

H_S = 1e-4  # of the integration; a row has 10 of them at 1000 Hz


def steps(draw, count, level):
    """Levels of both signs, held for 0.3 to 0.9 s; they change between two rows like anything else."""
    out, at = np.zeros(count), round(0.2 / H_S)
    sign = draw.choice((-1.0, 1.0))
    while at < count:
        end = at + round(draw.uniform(0.3, 0.9) / H_S)
        out[at:end] = sign * draw.uniform(0.4, 1.0) * level
        at, sign = end, -sign if draw.uniform() < 0.75 else sign
    return out


def chirp(draw, count, level, slowest_hz=0.15, fastest_hz=3.0):
    """From slow to fast and back, so that both are at both ends of a battery or a temperature."""
    time_s = np.arange(count) * H_S
    share = 1.0 - np.abs(2.0 * time_s / time_s[-1] - 1.0)
    rate = slowest_hz * (fastest_hz / slowest_hz) ** share
    return level * np.sin(2.0 * np.pi * np.cumsum(rate) * H_S + draw.uniform(0.0, 6.28))


def multisine(draw, count, level, slowest_hz=0.15, fastest_hz=3.0, lines=7):
    time_s = np.arange(count) * H_S
    out = np.zeros(count)
    for line in np.geomspace(slowest_hz, fastest_hz, lines) * draw.uniform(0.9, 1.1, lines):
        out += (slowest_hz / line) ** 0.3 * np.sin(2.0 * np.pi * line * time_s + draw.uniform(0.0, 6.28))
    return out * level / np.max(np.abs(out))


def of(kind, draw, count, level):
    return {"steps": steps, "chirp": chirp, "multisine": multisine}[kind](draw, count, level)


def held(values, per_row):
    """What a converter gives out that is set once a row."""
    return np.repeat(values[::per_row], per_row)[: len(values)]
