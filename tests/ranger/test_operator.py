"""What the robot's operator does, and when: holding, keys, the radio's pulses and their spikes, letting go."""

from types import SimpleNamespace

import pytest

from ranger_sim.foundation.events import PIN_EDGE, EventQueue
from ranger_sim.ranger import wiring
from ranger_sim.ranger.operator import FRAME_NS, PIN_ORDER, Operator

START = 5_000_000_000
POSE = {"stance": "inner", "lean_rad": -0.1, "hip_angle_rad": 0.2, "outer_ankle_rad": 1.5, "inner_ankle_rad": 0.5}
KEYS = (SimpleNamespace(key=4, time_s=0.25, hold_s=0.1), SimpleNamespace(key=0, time_s=0.5, hold_s=1.0))
RADIO = wiring.PINS["UI"]["radio_0"]


class Plant:
    """Notes how it is held and let go."""

    def __init__(self):
        self.held, self.released = [], []

    def hold(self, **pose):
        self.held.append(pose)

    def release(self, rate):
        self.released.append(rate)


def beside(stick=0.0, seed=0, keys=KEYS):
    script = SimpleNamespace(**POSE, keys=keys, release_time_s=2.0, release_rate_rad_per_s=0.7, radio=stick)
    plant, ui = Plant(), SimpleNamespace(inbox=EventQueue())
    return Operator(script, plant, ui, START, seed), plant, ui.inbox


def edges(inbox):
    """[(time, pin, level)] that wait, in order; nothing else may."""
    found = []
    while inbox.take():
        assert (inbox.kind, inbox.order, inbox.c, inbox.d) == (PIN_EDGE, PIN_ORDER, -1, 0)
        found.append((inbox.time, inbox.a, inbox.b))
    return found


def test_the_robot_is_held_in_the_pose_of_the_script_and_keys_go_down_and_up():
    _, plant, inbox = beside()
    assert plant.held == [POSE]
    ms = 1_000_000
    down = {number: wiring.PINS["UI"][f"key_{number}"] for number in (0, 4)}
    assert edges(inbox) == [
        (START + 250 * ms, down[4], 1),
        (START + 350 * ms, down[4], 0),
        (START + 500 * ms, down[0], 1),
        (START + 1500 * ms, down[0], 0),
    ]


def test_it_is_let_go_once_when_the_time_has_come():
    operator, plant, _ = beside()
    operator.act(START + 2_000_000_000)  # what is due before then
    assert (operator.released, plant.released) == (False, [])
    operator.act(START + 2_000_000_001)
    operator.act(START + 3_000_000_000)
    assert (operator.released, plant.released) == (True, [0.7])


@pytest.mark.parametrize("stick", [-1.0, -0.25, 0.0, 1.0])
def test_a_pulse_every_20_ms_is_as_wide_as_the_record_s_steering_machine_reads(stick):
    """robot.md C1.6: stick = 4e-5 x (width in ticks of 1/60 us) - 3.4."""
    operator, _, inbox = beside(stick, keys=())
    operator.act(START)
    assert edges(inbox) == []
    operator.act(START + 1)
    operator.act(START + 200_000_000)
    pulses = [(time, level) for time, pin, level in edges(inbox) if pin == RADIO]
    begins = [time for time, level in pulses if level == 1]
    assert [time for time in begins if (time - START) % FRAME_NS == 0] == [START + n * 20_000_000 for n in range(10)]
    for begin in begins:
        if (begin - START) % FRAME_NS == 0:
            end = next(time for time, level in pulses if level == 0 and time > begin)
            assert 4e-5 * (end - begin) * 60e-3 - 3.4 == pytest.approx(stick, abs=1e-5)


def test_one_pause_in_200_has_a_spike_in_its_second_half_that_ends_at_once():
    operator, _, inbox = beside(seed=3, keys=())
    frames = 40_000
    spikes = []
    for n in range(0, frames, 100):
        operator.act(START + (n + 100) * FRAME_NS)
        pulses = edges(inbox)
        at = [(time - START) % FRAME_NS for time, _, _ in pulses]
        spikes += [each for each, place in zip(pulses, at, strict=True) if place >= FRAME_NS // 2]
    up, down = spikes[::2], spikes[1::2]
    assert [each[0] for each in up] == [each[0] for each in down]
    assert {each[1:] for each in up} == {(RADIO, 1)} and {each[1:] for each in down} == {(RADIO, 0)}
    # every 4 s, so one pause of 200: a binomial's mean of 200 and five of its standard deviations of 14.1
    assert abs(len(up) - frames / 200) < 5 * 14.1
    places = sorted((time - START) % FRAME_NS / FRAME_NS for time, _, _ in up)
    assert 0.5 <= places[0] < 0.52 and 0.73 < places[-1] < 0.75  # anywhere in a quarter of the frame
    assert beside(seed=4)[0].spikes.uniform() != beside(seed=3)[0].spikes.uniform()
