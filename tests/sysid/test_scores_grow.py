"""A larger effect is never harder to see: the score of a cause grows with its size, also in noise as slow as it.

The generator is a robot joint on a sum of sines with noise that remembers; nothing of it is the diagnosis's.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.diagnose import words
from tests.sysid.robot_joint import Joint

STEP_S = 0.01
STRENGTHS = (1.0, 2.0, 4.0, 8.0, 25.0, 100.0)


def run(seed, memory, effect, size, rows=3000):
    draw = generator(seed, "joint on sines")
    time_s = np.arange(rows) * STEP_S
    angle, rate, acceleration = np.zeros(rows), np.zeros(rows), np.zeros(rows)
    for hertz in (0.07, 0.19, 0.41, 0.83):
        high, turn, phase = draw.uniform(0.3, 0.5) / hertz**0.6, 2.0 * np.pi * hertz, draw.uniform(0.0, 6.28)
        angle += high * np.sin(turn * time_s + phase)
        rate += high * turn * np.cos(turn * time_s + phase)
        acceleration -= high * turn**2 * np.sin(turn * time_s + phase)
    shocks = draw.normal(size=rows + 1000) * np.sqrt(1.0 - memory**2)
    noise = 0.05 * lfilter([1.0], [1.0, -memory], shocks)[1000:]
    current = 0.06 * acceleration + 0.35 * rate + 0.25 * np.tanh(rate / 0.01) + 0.02 + noise
    current += size * {"gravity": np.cos(angle), "drag": rate * np.abs(rate)}[effect]
    columns = {"angle_rad": angle, "rate_rad_per_s": rate, "current_A": current}
    return Table(time_s, columns, (slice(0, rows),), f"joint {seed}")


@pytest.mark.parametrize(("memory", "effect", "smallest_A"), [(0.0, "drag", 0.004), (0.97, "gravity", 0.02)])
def test_the_score_of_a_cause_never_falls_with_its_size(memory, effect, smallest_A):
    scores = []
    for strength in STRENGTHS:
        found = diagnose(Joint(), [run(7, memory, effect, smallest_A * strength)]).named
        scores.append(found[0].bic if found and found[0].effect.cause == effect else 0.0)
    assert scores == sorted(scores)
    assert scores[3] > 0.0  # an effect eight times the smallest is named, and so is every larger one


def test_a_sound_joint_has_no_cause_however_slow_its_noise():
    """Twelve sound runs: with false names in 2 % of them, more than 2 come in one of 600."""
    named = [diagnose(Joint(), [run(20 + each, memory, "drag", 0.0)]).result.detected
             for each, memory in enumerate((0.0, 0.5, 0.9, 0.97) * 3)]  # fmt: skip
    assert sum(named) <= 2


def test_a_recording_that_is_too_short_for_its_noise_is_called_so_with_the_length_it_would_need():
    """Noise with a memory of 0.98 is correlated over 99 samples of 10 ms: 20 stretches of it are 20 s."""
    found = diagnose(Joint(), [run(3, 0.98, "drag", 0.0, rows=800)])
    ((_, needed_s),) = found.result.evidence.too_short_s.items()
    assert not found.result.detected and 9.0 < needed_s < 40.0
    assert "too short for this noise" in words.sentence(found)
    assert diagnose(Joint(), [run(3, 0.5, "drag", 0.0)]).result.evidence.too_short_s is None
