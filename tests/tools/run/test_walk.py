"""`ranger-sim walk`: distances and charges as people type them, what is reported while it walks, and how it may end."""

import contextlib
import io
import json
import shlex
import types

import pytest
from rich.console import Console

from ranger_sim.foundation import random_arrays
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools import cli
from ranger_sim.tools.command_line import interrupts
from ranger_sim.tools.command_line.units import duration_text
from ranger_sim.tools.report import page
from ranger_sim.tools.run import walk

# 40 mWh: held for 1.5 s and some steps; at the 17 W of a walk 8 s
NEARLY_EMPTY_WH = 0.04


@pytest.fixture(scope="module")
def emptied():
    """The summary of a walk that was to be longer than the batteries last."""
    with contextlib.closing(Ranger(Scenario(battery_capacity_Wh=NEARLY_EMPTY_WH))) as robot:
        while not robot.run(StopRule(distance_m=1000.0), 1.0):
            pass
        return {**robot.summary(), "interrupted": False}


def test_an_empty_battery_ends_the_walk_and_is_named_as_the_cause(emptied):
    assert emptied["fall_cause"] == "battery empty" and emptied["battery"]["empty"]
    assert emptied["steps"] >= 2 and 0.5 < emptied["distance_m"] < 20.0
    assert walk.end_text(emptied) == "battery empty"
    assert emptied["battery"]["charge"] == 0.0 and emptied["battery_V"] == 0.0


def test_what_an_emptied_battery_gave_is_its_capacity(emptied):
    """Two books: charge times open voltage in the battery, and energy by consumer at its terminals."""
    battery, energy = emptied["battery"], emptied["energy_Wh"]
    # The capacity is counted as charge at the mean voltage; straight lines between the table's points give it exactly.
    # 0.2 %: the last step takes more than was left (17 W x 250 us = 1 uWh of 40 mWh) and the curve ends in a corner.
    assert battery["delivered_Wh"] + battery["lost_inside_Wh"] == pytest.approx(NEARLY_EMPTY_WH, rel=2e-3)
    parts = [energy[name] for name in ("hip", "outer_ankle", "inner_ankle", "steering", "electronics")]
    assert energy["total"] == pytest.approx(sum(parts)) and min(parts) >= 0.0
    # Since it was let go; while it was held 1.5 s the electronics drew 2.1 mWh and the motors of the start states some.
    # The consumers' sum is more than the terminals' by what motors gave back, less than 15 % of theirs here.
    held = 5.15 * 1.5 / 3600.0
    assert energy["total"] < battery["delivered_Wh"] - held + 0.15 * energy["total"]
    assert energy["total"] > 0.7 * battery["delivered_Wh"]


def test_powers_and_energies_agree(emptied):
    hours = emptied["walked_h"]
    assert emptied["energy_Wh"]["total"] == pytest.approx(emptied["total_power_W"] * hours, rel=1e-9)
    assert emptied["energy_Wh"]["electronics"] == pytest.approx(5.15 * hours, rel=1e-9)
    # it was let go after 1.5 s
    assert hours * 3600.0 == pytest.approx(emptied["time_s"] - 1.5, abs=1e-6)


def test_the_left_outer_ankle_may_be_off_as_in_the_long_walk():
    with contextlib.closing(Ranger(Scenario(electronics_off=("left-outer-ankle",)))) as robot:
        robot.run_for(0.01)
        assert robot.summary()["electronics_power_W"] == pytest.approx(4.7, abs=1e-12)
        assert robot.summary()["electronics_off"] == ["left-outer-ankle"]


def test_batteries_are_full_unless_the_scenario_says_otherwise():
    # seven cells of 4.2 V; without load
    assert Ranger(Scenario()).plant.battery_V == pytest.approx(29.4)
    assert Ranger(Scenario(battery_charge=0.7)).plant.battery_V == pytest.approx(26.74)


@pytest.mark.parametrize(
    ("field", "value", "limit"),
    [
        ("battery_charge", 0.0, "1.0"),
        ("battery_charge", 1.01, "1.0"),
        ("battery_capacity_Wh", 0.0, "0.001"),
        ("battery_capacity_Wh", float("inf"), "Wh"),
        ("electronics_off", ("inertial sensor",), "left-outer-ankle"),
    ],
)
def test_an_impossible_scenario_is_refused_with_its_limit(field, value, limit):
    with pytest.raises(UserError, match=field) as refused:
        Scenario(**{field: value})
    assert limit in str(refused.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--battery", "120%"], ["--battery", "120%", "at most 1"]),
        (["--battery", "0%"], ["--battery", "at least 1e-06"]),
        (["--battery", "full"], ["--battery", "full", "%"]),
        (["--battery-capacity", "493 W"], ["--battery-capacity", "Wh"]),
        (["--off", "hip"], ["--off", "left-outer-ankle"]),
    ],
)
def test_a_mistake_gets_one_line(capsys, arguments, words):
    try:
        code = cli.main(["walk", *arguments])
    except SystemExit as left:
        code = left.code
    reported = capsys.readouterr()
    assert code == 2 and reported.out == "" and len(reported.err.splitlines()) == 1
    assert all(word in reported.err for word in words), reported.err


def test_distance_in_kilometres_and_charge_in_per_cent_reach_the_robot(capsys):
    arguments = ["--distance", "0.002km", "--battery", "65 %", "--battery-capacity", "0.493kWh"]
    assert cli.main(["walk", *arguments, "--off", "left-outer-ankle", "--json", "-"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert 2.0 <= summary["distance_m"] < 2.5  # a step is 0.35 m
    assert summary["battery"]["charge_at_start"] == pytest.approx(0.65)
    assert summary["battery"]["capacity_Wh"] == pytest.approx(493.0)
    assert summary["electronics_power_W"] == pytest.approx(4.7)
    assert summary["interrupted"] is False
    assert "--distance 2.0m" in summary["command"]
    assert "--battery 0.65 --battery-capacity 493.0Wh --off left-outer-ankle" in summary["command"]


def test_the_report_has_the_command_that_compares_the_walk_with_its_twins(tmp_path):
    folder = tmp_path / "run"
    assert cli.main(["walk", "--steps", "1", "--log", "full", "--out", str(folder)]) == 0
    assert walk.comparison(str(folder)) in (folder / "report.html").read_text(encoding="utf-8")


def test_the_report_has_the_comparison_with_twins_that_was_asked_for(tmp_path):
    folder = tmp_path / "run"
    assert cli.main(["walk", "--steps", "14", "--log", "full", "--twins", "--out", str(folder)]) == 0
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "<h2>Compared with its twins</h2>" in text and "<p><b>Nothing found.</b></p>" in text
    assert text.count('<div class="away') == 8
    assert "10 steps at the table&#39;s rate against sound walks of record-2011" in text


def test_a_walk_that_cannot_be_compared_with_its_twins_says_so_in_its_report(tmp_path):
    folder = tmp_path / "run"
    assert cli.main(["walk", "--steps", "2", "--twins", "--out", str(folder)]) == 0
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "Compared with its twins" in text and "too few" in text and '<div class="away' not in text


@pytest.mark.parametrize("words", [[], ["--log", "none", "--out", "run"]])
def test_a_comparison_with_twins_that_no_report_would_have_is_refused(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["walk", "--steps", "1", "--twins", *words]) == 2
    assert "--twins: the report has the comparison, and needs --out DIR" in capsys.readouterr().err


def test_the_walk_before_ctrl_c_is_reported(capsys, monkeypatch):
    monkeypatch.setattr(walk, "SLICE_S", 2.0)

    @contextlib.contextmanager
    def already():
        yield [True]

    monkeypatch.setattr(interrupts, "noted", already)
    assert cli.main(["walk", "--distance", "65km"]) == 130
    reported = " ".join(capsys.readouterr().err.split())
    assert "in 2.0 s, interrupted, on its feet;" in reported
    assert "Wh since it was let go: hip" in reported and "batteries 100.0 % of 469 Wh" in reported


class Walked:
    """A robot at a place of a long walk, as `progress_text` asks it."""

    distance_m, steps, time_s = 16_250.0, 46_519, 27_600.0

    plant = types.SimpleNamespace(electrics=types.SimpleNamespace(battery=types.SimpleNamespace(charge=0.747)))

    def mean_speed_m_per_s(self):
        return self.distance_m / self.time_s

    def fraction_done(self, stop):
        return self.distance_m / stop.distance_m


def test_progress_shows_distance_time_left_and_charge():
    # a quarter of 65 km in half an hour of the wall clock: three times as long is left
    reported = walk.progress_text(Walked(), StopRule(distance_m=65_000.0), 1800.0)
    assert reported == "16.250 km, 46519 steps, 1:30:00 left; 7:40:00 at 0.59 m/s, 15.3 x real time, battery 75 %"
    assert "? left" in walk.progress_text(
        type("Standing", (Walked,), {"distance_m": 0.0})(), StopRule(distance_m=1.0), 1.0
    )


def test_where_no_screen_is_progress_comes_as_lines(monkeypatch):
    """One line a minute: 150 s of the wall clock give two."""
    clock = iter(range(0, 1000, 10))
    monkeypatch.setattr(walk.wallclock, "monotonic_s", lambda: float(next(clock)))

    class Robot(Walked):
        runs = 0
        deaths = ()

        def run(self, _stop, _slice_s):
            self.runs += 1
            return self.runs >= 15

    text = io.StringIO()
    walk.walk(Robot(), StopRule(distance_m=65_000.0), Console(file=text, width=80), [])
    lines = text.getvalue().splitlines()
    assert len(lines) == 2 and all(line.startswith("16.250 km, 46519 steps") for line in lines)


@pytest.mark.parametrize(
    ("seconds", "text"), [(59.94, "59.9 s"), (3600.0, "3600.0 s (1 h 00 min)"), (110_942.0, "110942.0 s (30 h 49 min)")]
)
def test_long_times_are_given_in_hours_too(seconds, text):
    assert duration_text(seconds) == text


def digest_and_command(capsys, *words):
    """Of a walk with these options."""
    assert cli.main(["walk", *words, "--json", "-"]) in (0, 1, 3)
    summary = json.loads(capsys.readouterr().out)
    return summary["trace_digest"], summary["command"]


@pytest.mark.parametrize("seed", [1, 2])
def test_the_command_that_a_run_prints_walks_the_same_again(capsys, seed):
    """Options at random; half of the walk the robot is held (1.5 s), then it steps on the rough floor."""
    drawn = random_arrays.generator(seed, "options of a walk")
    chosen = {
        "--time": f"{drawn.uniform(1.8, 2.2)}s",
        "--seed": str(drawn.integers(0, 2**40)),
        "--slope": f"{drawn.uniform(-0.6, 0.6)} deg",
        "--floor-roughness": f"{drawn.uniform(0.0, 2.0)}mm",
        "--battery": f"{drawn.uniform(50.0, 100.0)}%",
        "--battery-capacity": f"{drawn.uniform(0.3, 0.6)}kWh",
        "--controller": drawn.choice(["robust", "record-2011"]),
        "--profile": "hil-1mbit",
        "--fault": f"MCH.joint_encoder:stuck@{drawn.uniform(0.5, 1.5)} s",
    }
    kept = drawn.permutation(list(chosen))[:6].tolist()
    words = [word for name in {"--time", *kept} for word in (name, str(chosen[name]))]
    digest, command = digest_and_command(capsys, *words, "--off", "left-outer-ankle")
    again, same_command = digest_and_command(capsys, *shlex.split(command)[2:])
    assert again == digest and same_command == command
    # an option that was forgotten would give another digest, so the options have to matter
    assert digest_and_command(capsys, "--time", chosen["--time"])[0] != digest


def test_a_walk_that_fell_short_has_no_mean_step(capsys):
    assert cli.main(["walk", "--time", "0.1s", "--json", "-"]) == 0
    summary = json.loads(capsys.readouterr().out)
    for name in ("mean_step_length_m", "std_step_length_m", "mean_step_time_s", "double_stance_s", "speed_m_per_s"):
        assert summary[name] is None, name
    assert summary["complete"] is True and summary["files"] == {}


def test_a_walk_without_a_folder_says_where_results_would_go(capsys):
    assert cli.main(["walk", "--time", "0.1s", "--log", "full"]) == 0
    reported = capsys.readouterr().err.splitlines()
    assert reported[0] == "--log full is ignored: there is no folder for logs (--out DIR)"
    assert "step none, none" in reported[1]
    assert reported[-1] == "nothing was kept: --out runs/NAME keeps summary, logs and report there"


def test_errors_of_a_healthy_walk_are_counted_in_one_line():
    usual = {"MCH": {"MC_TCURR_OOB": 40}, "MB": {}}
    line = "errors as in every healthy walk: 1 kinds (report and summary have them)"
    assert walk.usual_lines(usual, 60.0) == [line]
    assert walk.usual_lines({**usual, "MCFI": {"ADCI_DNF": 3}}, 60.0) == [line]
    assert walk.usual_lines({"MB": {}}, 60.0) == []


def test_the_last_lines_have_the_motors_power_next_to_that_of_everything(emptied):
    out = io.StringIO()
    walk.print_summary(emptied, 0.8, Console(file=out, width=1000))
    total, motors = emptied["total_power_W"], emptied["motor_power_W"]
    assert motors < total
    assert f"{total:.1f} W (motors {motors:.1f} W), TCOT" in out.getvalue()


@pytest.mark.parametrize(("distance_m", "reported"), [(50.0, "500 mWh, 10.00 Wh/km"), (0.0, "500 mWh")])
def test_energy_is_reported_per_kilometre_where_the_robot_walked(distance_m, reported):
    assert page.energy_used({"energy_Wh": {"total": 0.5}, "distance_m": distance_m}) == reported
