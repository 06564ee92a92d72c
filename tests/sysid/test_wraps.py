"""A counter runs over by its own span between the ends of its range; what is switched does not, and stays as it is."""

import dataclasses
import math

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import repairs, sanity, wraps
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.machine import Quantity
from ranger_sim.sysid.machines import MACHINES, made
from ranger_sim.sysid.reading import open_recording as read
from tests.boards.original_images import DATA

COUNT = 2.0 * math.pi / 8192.0
needs_data = pytest.mark.skipif(
    not (DATA / "sound_bench_holdout.csv").exists(), reason=f"no measured data in {DATA.name}/"
)


def turning(span, step, count=4000):
    """A shaft that turns to and fro, further than the counter counts; quantised, and as the counter shows it."""
    n = np.arange(count)
    true = np.round((0.9 * span * np.sin(0.003 * n) + 0.1 * span + 0.4 * span * np.sin(0.0011 * n)) / step) * step
    return true, (true + 0.5 * span) % span - 0.5 * span


def mended(value, unit, resolution=0.0, inputs=()):
    channel = Channel("channel", unit, np.arange(len(value)) * 0.002, value, resolution)
    return repairs.mend(Dataset("data", {"channel": channel}), None, inputs)


@pytest.mark.parametrize(
    ("span", "step", "unit"),
    [
        (2.0 * math.pi, COUNT, "rad"),
        (65536 * 1e-3, 1e-3, "m"),
        (65536 * 0.01, 0.01, "A"),  # a current that outgrew sixteen bits on the bus
        (4096.0, 1.0, "counts"),
    ],
    ids=["a turn", "sixteen bits", "sixteen bits of a current", "twelve bits"],
)
def test_a_counter_that_runs_over_in_both_directions_counts_on(span, step, unit):
    true, shown = turning(span, step)
    found = mended(shown, unit)
    assert found["channel"].value - found["channel"].value[0] == pytest.approx(true - true[0], abs=0.6 * step)
    assert [each.kind for each in found.repairs] == ["wrap"]


def test_an_angle_without_steps_runs_over_by_a_turn():
    true = np.cumsum(0.02 + 0.01 * np.sin(0.01 * np.arange(3000)))
    found = mended((true + math.pi) % (2.0 * math.pi) - math.pi, "rad")
    assert found["channel"].value - found["channel"].value[0] == pytest.approx(true - true[0], abs=1e-9)


def test_a_noisy_angle_that_crosses_the_end_of_its_range_again_and_again_counts_on():
    true = 0.002 * np.arange(4000) + 0.004 * generator(1, "wraps").normal(size=4000)
    shown = (true + math.pi) % (2.0 * math.pi) - math.pi
    assert len(sanity.wraps_of(Channel("a", "rad", np.arange(4000.0), shown)).places) >= 3
    assert mended(shown, "rad")["channel"].value == pytest.approx(true, abs=1e-9)


@pytest.mark.parametrize("low", [-5.0, -5.12, -4.0])
@pytest.mark.parametrize("noise", [0.0, 0.003])
@pytest.mark.parametrize("seed", range(10))
def test_a_switched_voltage_is_not_a_counter(low, noise, seed):
    random = generator(seed, "switched")
    value = np.repeat(random.choice([low, 5.0], size=60), 40) + 0.002 * np.sin(0.05 * np.arange(2400))
    value = np.round((value + noise * random.normal(size=2400)) / 1e-5) * 1e-5
    assert sanity.wraps_of(Channel("voltage_V", "V", np.arange(2400) * 0.002, value, 1e-5)).places == ()


def test_a_jump_that_is_not_between_the_ends_of_the_range_is_not_a_counter():
    _, shown = turning(2.0 * math.pi, COUNT)
    shown[shown > 2.8] = 2.8  # the counter never shows its end
    assert wraps.of(shown, "rad", (COUNT,)).places == ()


def test_a_channel_that_also_jumps_otherwise_is_not_mended_in_parts():
    _, shown = turning(2.0 * math.pi, COUNT)
    places = wraps.of(shown, "rad", (COUNT,)).places
    assert len(places) >= 2
    place = np.flatnonzero((shown > 2.2) & (shown < 2.4))[0]
    shown[place + 1 :] = shown.min()  # most of the range, but not from its end
    assert wraps.of(shown, "rad", (COUNT,)).places == ()


def test_what_drives_the_machine_stays_as_it_is_until_it_is_asked_for():
    true, shown = turning(2.0 * math.pi, COUNT)
    shown[700] += 1024 * COUNT
    data = Dataset("data", {"channel": Channel("channel", "rad", np.arange(4000) * 0.002, shown)})
    kept = repairs.mend(data, None, ["channel"])
    assert np.array_equal(kept["channel"].value, shown) and kept.repairs == []
    (said,) = [each for each in kept.findings if each.kind == "not_repaired"]
    assert said.kind in sanity.KINDS and "--repair channel" in said.text and said.size >= 3.0
    assert {each.kind for each in repairs.mend(data).repairs} == {"wrap", "bit_flip"}


def test_inputs_of_a_machine_are_declared_or_known_by_their_unit_and_name():
    assert Quantity("u_V", "V", "").is_input and not Quantity("sense_V", "V", "", drives=False).is_input
    assert Quantity("target_angle_rad", "rad", "").is_input and Quantity("current_A", "A", "", drives=True).is_input
    assert not Quantity("angle_rad", "rad", "").is_input
    inputs = {name: {each.name for each in made(name)().quantities if each.is_input} for name in MACHINES}
    assert inputs["motor-bench"] == inputs["positioning"] == {"voltage_V"}
    assert inputs["leg-swing"] == {"voltage_V", "current_A"}
    assert {"target_angle_rad", "target_rate_rad_per_s", "command_current_A"} <= inputs["ankle"]
    assert "joint_angle_rad" not in inputs["ankle"]


@needs_data
@pytest.mark.parametrize("file", ["sound_bench_train.csv", "sound_bench_holdout.csv"])
def test_the_drive_of_a_sound_recording_is_not_changed(file):
    data = read(DATA / file)
    found = repairs.mend(data)
    assert not {"wrap", "bit_flip"} & {each.kind for each in (*found.repairs, *found.findings)}
    for name, channel in data.channels.items():
        assert np.array_equal(found[name].value, channel.value)


@pytest.mark.parametrize(("tick_s", "bits"), [(1e-6, 32), (1e-3, 16), (1e-5, 24)])
def test_a_clock_of_so_many_bits_counts_on(tick_s, bits):
    span = tick_s * 2**bits
    true = span - 10.0 + 0.004 * np.arange(5000)
    assert wraps.counted_on(true % span) == pytest.approx(true, abs=1e-6)


def test_a_recording_that_begins_again_is_not_an_overrun_clock():
    time_s = np.concatenate((0.004 * np.arange(10000), 0.004 * np.arange(10000)))  # 40 s, which no counter has
    assert wraps.of_clock(time_s) == [] and np.array_equal(wraps.counted_on(time_s), time_s)
    sine = Channel("a_V", "V", time_s, np.sin(0.01 * np.arange(20000)))
    kept = repairs.mend(Dataset("data", {"a_V": sine}))["a_V"]
    assert (kept.read, len(kept.value)) == (20000, 10000) and dataclasses.asdict(kept.losses[0])["count"] == 10000
