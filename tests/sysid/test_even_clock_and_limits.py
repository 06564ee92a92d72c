"""Rounded stamps and the even clock behind them; values at a limit: masked, refused, or assumed to be true."""

import json
import math

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import even_clock, repairs, sanity
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.reading import read
from ranger_sim.tools.cli import main


@pytest.fixture
def table(tmp_path):
    def write(time_s, *columns, names="t_s,u_V,arm_angle_rad"):
        lines = (",".join(map(str, row)) for row in zip(time_s, *columns, strict=True))
        path = tmp_path / "table.csv"
        path.write_text(names + "\n" + "\n".join(lines) + "\n")
        return path

    return write


def moving(t):
    return np.round(np.sin(3.0 * t), 5), np.round(np.cos(2.0 * t), 5)


T = 0.0024 * np.arange(1000)


def test_stamps_rounded_to_ms_are_those_of_an_even_clock_whose_residual_is_the_roundings(table):
    measurement = read(table(np.round(T, 3), *moving(T)))
    (proposal,) = [each for each in measurement.proposals if each.channel == "u_V"]
    assert proposal.kind == "even_clock" and proposal.option == "--assume clock=even" and proposal.unit == "s"
    # 2.4 ms are 2, 2, 3, 2, 3 ms: a fifth of the stamps is on the clock, the others are 0.2 and 0.4 ms away from it
    assert measurement.share_of(proposal) == pytest.approx(0.8)
    assert proposal.residual == pytest.approx(1e-3 * math.sqrt((0.0 + 0.16 + 0.04 + 0.04 + 0.16) / 5.0), rel=1e-3)
    assert [each.kind for each in measurement.matters] == ["quantised_stamps"] * 2
    assert measurement["u_V"].time_s == pytest.approx(np.round(T, 3))  # it is proposed, not made
    made = read(table(np.round(T, 3), *moving(T)), assume={"clock": "even"})
    assert made["u_V"].time_s == pytest.approx(T, abs=1e-5) and not made.matters and not made.proposals


def test_samples_stamped_in_blocks_are_spread_over_the_time_of_their_block(table):
    blocks = 0.1 * (np.arange(1000) // 40 + 1) + np.repeat(1e-4 * np.sin(np.arange(25)), 40)
    time_s = 0.0025 * np.arange(1000)
    measurement = read(table(np.round(blocks, 6), *moving(time_s)))
    (proposal,) = [each for each in measurement.proposals if each.channel == "u_V"]
    assert "written in blocks of 40 samples" in proposal.text
    mended = measurement.mended()["u_V"]
    assert np.diff(mended.time_s) == pytest.approx(np.full(999, 0.0025), rel=1e-3) and len(mended.value) == 1000


def test_a_clock_is_even_on_both_sides_of_a_gap():
    time_s = np.concatenate((np.arange(300), np.arange(900, 1300))) * 0.0024
    clock = even_clock.of(np.round(time_s, 3))
    assert clock.step_s == pytest.approx(0.0024, rel=1e-5)
    assert np.abs(clock.time_s - time_s).max() < 2e-4


def test_missing_rows_uneven_sampling_and_even_stamps_are_not_taken_for_rounding():
    even = 0.01 * np.arange(400)
    assert even_clock.of(even) is None
    assert even_clock.of(np.delete(even, 100)) is None
    assert even_clock.of(np.delete(even, np.arange(3, 400, 7))) is None
    wandering = np.round(even + 0.02 * np.sin(0.05 * np.arange(400)), 3)
    assert even_clock.of(wandering) is None


def test_rows_that_are_there_twice_are_not_spread(table):
    time_s, twice = 0.01 * (np.arange(400) // 2), np.arange(400) // 2 * 0.01
    measurement = read(table(np.round(time_s, 2), *moving(twice)))
    assert "even_clock" not in {each.kind for each in measurement.proposals}


def test_an_even_clock_that_does_not_fit_is_refused(table):
    time_s = np.cumsum(0.01 + 0.004 * np.sin(np.arange(400)))
    with pytest.raises(UserError, match="clock=even: no even clock fits the stamps"):
        read(table(np.round(time_s, 6), *moving(time_s)), assume={"clock": "even"})


def test_an_angle_that_wraps_is_proposed_with_residual_and_share(table, capsys):
    t = 0.01 * np.arange(2000)
    heading = 170.0 + 40.0 * np.sin(0.9 * t) + 30.0 * np.sin(0.31 * t)
    wrapped = np.round((heading + 180.0) % 360.0 - 180.0, 3)
    path = table(np.round(t, 2), np.round(np.sin(t), 4), wrapped, names="t_s,u_V,heading_deg")
    measurement = read(path)
    (proposal,) = measurement.proposals
    share = float(np.mean(np.abs(wrapped - heading) > 1.0))
    assert proposal.residual < 2e-4 and measurement.share_of(proposal) in (
        pytest.approx(share),
        pytest.approx(1.0 - share),
    )
    mended = np.degrees(measurement.mended()["heading_rad"].value)
    assert np.ptp(np.round(mended - heading, 2)) < 0.02
    assert main(["read", str(path), "--json", "-"]) == 1
    (printed,) = json.loads(capsys.readouterr().out)["proposals"]
    assert printed["residual"] == proposal.residual and printed["unit"] == "rad" and 0.0 < printed["share"] < 1.0
    assert main(["read", str(path)]) == 1
    assert "% of its samples" in (out := capsys.readouterr().out) and ", residual " in out


def test_an_input_that_wraps_stays_as_it_is_until_it_is_requested():
    t = 0.01 * np.arange(2000)
    turning = (2.0 * t + np.pi) % (2.0 * np.pi) - np.pi
    dataset = Dataset("run", {"target_rad": Channel("target_rad", "rad", t, turning)})
    kept = repairs.mend(dataset, inputs=["target_rad"])
    assert np.array_equal(kept["target_rad"].value, turning)
    assert [each.kind for each in kept.findings if each.kind != "wrap"] == ["not_repaired"]
    assert np.ptp(repairs.mend(dataset)["target_rad"].value) == pytest.approx(2.0 * t[-1], abs=1e-6)


def test_an_angle_in_coarse_counts_is_named_by_the_noise_of_its_derivative(table):
    t = 0.001 * np.arange(2000)
    coarse, fine = np.round(np.sin(2.0 * t) / 0.01) * 0.01, np.round(np.sin(2.0 * t), 6)
    path = table(np.round(t, 3), np.round(coarse, 2), fine, names="t_s,joint_rad,arm_rad")
    (finding,) = [each for each in read(path).findings if each.kind == "quantised"]
    assert finding.channel == "joint_rad" and finding.size == pytest.approx(0.01) and finding.severity == "note"
    assert "4.08 rad/s of noise in its derivative" in finding.text  # 0.01 / (sqrt(6) 0.001)


# --- limits ------------------------------------------------------------------------------------------------------


def clipped(limit=4.0):
    t = 0.01 * np.arange(2000)
    voltage = np.clip(6.0 * np.sin(1.3 * t) + 1.5 * np.sin(7.0 * t), -limit, limit)
    return Dataset("run", {name: Channel(name, unit, t, voltage) for name, unit in (("u_V", "V"), ("x_m", "m"))})


def test_nothing_is_interpolated_over_values_that_are_cut_off():
    t = 0.01 * np.arange(1000)
    value = np.minimum(np.abs(np.sin(2.0 * t)), 0.9992)
    dataset = Dataset("run", {"a": Channel("a", "A", t, np.cos(t)), "b": Channel("b", "A", t, value)})
    short = dataset["b"].without(value == 0.9992, "clipped")
    stretches = np.diff(np.flatnonzero(value == 0.9992))
    assert stretches.min() == 1 and np.diff(short.time_s).max() < 0.051
    table = Dataset("run", {"a": dataset["a"], "b": short}).table(["a", "b"])
    assert not np.isin(t[value == 0.9992], table.time_s).any() and len(table) == int((value < 0.9992).sum())
    assert len(table.runs) == len(np.flatnonzero(np.diff(short.time_s) > 0.011)) + 1


def test_an_input_that_is_cut_off_is_refused_with_both_ways_out():
    findings = sanity.inspect(clipped())
    sanity.stop_if_input_is_clipped("run", findings, ["other_V"])
    with pytest.raises(UserError, match=r"u_V: \d+ values are cut off .*--assume limits=u_V: .*--repair u_V"):
        sanity.stop_if_input_is_clipped("run", findings, ["u_V"])


def test_limits_that_are_assumed_to_be_true_are_a_note_and_nothing_is_masked(table):
    data = clipped()
    path = table(
        np.round(data["u_V"].time_s, 2), np.round(data["u_V"].value, 4), np.round(np.sin(data["u_V"].time_s), 4)
    )
    assert read(path).exit_code == 1 and len(read(path).mended()["u_V"].value) < 1200
    measurement = read(path, assume={"limits": "u_V"})
    assert measurement.exit_code == 0 and len(measurement.mended()["u_V"].value) == 2000
    sanity.stop_if_input_is_clipped("run", measurement.findings, ["u_V"])
    with pytest.raises(UserError, match="--assume limits=v_V: unknown channel 'v_V'"):
        read(path, assume={"limits": "v_V"})


def test_a_recipe_keeps_what_is_assumed_of_the_channels(table, tmp_path):
    data = clipped()
    stamps = np.round(0.0024 * np.arange(2000), 3)
    path = table(stamps, np.round(data["u_V"].value, 4), np.round(np.sin(data["u_V"].time_s), 4))
    recipe = tmp_path / "lab.toml"
    assumed = ["--assume", "clock=even", "--assume", "limits=u_V"]
    assert main(["read", str(path), *assumed, "--write-recipe", str(recipe)]) == 0
    again = read(path, recipe=recipe)
    assert again["u_V"].limits_are_true and np.diff(again["u_V"].time_s) == pytest.approx(np.full(1999, 0.0024))


def test_rows_of_a_table_with_a_value_that_is_cut_off_are_left_out_of_all_channels():
    data = clipped()
    found = repairs.without_clipped_rows(data, sanity.inspect(data))
    assert len(found["u_V"].value) == len(found["x_m"].value) == int((np.abs(data["u_V"].value) < 4.0).sum())
    assert found["x_m"].lost_share > 0.01
