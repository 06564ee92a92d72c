"""`python -m studies.figures`: the robot's figures of a walk, and the command around the diagnosis."""

import json
import math

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from studies.figures import command, walks, work
from studies.figures.question import Outcome, Point

FILE = """
title = "a walk"
[run]
body = "appendix"
steps = 20
seeds = 2
settle_steps = 5
[[figure]]
name = "step_length_m"
value = 0.39
sd = 0.005
source = "test"
[[figure]]
name = "step_time_s"
value = 0.60
sd = 0.01
source = "test"
[[figure]]
name = "steps"
value = 1000
endurance = true
at_least = true
source = "test"
[[candidate]]
name = "ankle_offset_m"
unit = "m"
low = 0.06
high = 0.19
known_sd = 0.002
step = 0.02
cause = "geometry"
source = "test"
[candidate.moves]
"body.outer_ankle_offset_m" = 1
"body.inner_ankle_offset_m" = 1
[[candidate]]
name = "hip_spring_Nm_per_rad"
unit = "N m/rad"
low = 3
high = 12
known_sd = 0.1
step = 1
cause = "spring_value"
source = "test"
[candidate.moves]
"body.hip_spring_Nm_per_rad" = 1
[[measurement]]
name = "ankle_height_m"
sd = 0.001
how = "ruler"
"""


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """A file of figures, and walks that are a formula: 2 m of length per m of height, 0.02 s less per N m/rad."""
    path = tmp_path / "asked.toml"
    path.write_text(FILE, encoding="utf-8")

    def walk(order):
        body = order.settings.body
        higher = body.get("outer_ankle_offset_m", 0.11) - 0.11
        stiffer = body.get("hip_spring_Nm_per_rad", 7.6) - 7.6
        scatter = 0.001 * (order.settings.walk["seed"] % 5 - 2)
        figures = {
            "step_length_m": 0.33 + 2.0 * higher + scatter,
            "step_time_s": 0.60 - 0.02 * stiffer,
            "ankle_height_m": 0.09 - higher,
        }
        return {"figures": figures, "survived": 15.0, "failed": False}

    monkeypatch.setattr(walks, "walk", walk)
    return path


def answer(capsys, *words):
    code = command.main([*map(str, words), "--jobs", "1", "--json", "-"])
    return code, json.loads(capsys.readouterr().out)


def test_the_wrong_number_is_named_and_the_corrected_body_has_it(asked, tmp_path, capsys):
    code, reported = answer(capsys, asked, "--out", tmp_path / "out")
    assert code == 1
    (cause,) = reported["causes"]
    assert (cause["name"], cause["at"]) == ("geometry", "ankle_offset_m")
    assert cause["parameters"]["ankle_offset_m"]["value"] == pytest.approx(0.14, abs=0.004)
    body = body_files.load(reported["model_file"])
    assert body.values["outer_ankle_offset_m"] == body.values["inner_ankle_offset_m"] == pytest.approx(0.14, abs=0.004)
    assert body.base == "appendix"
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text()) == reported


def test_walks_that_are_kept_are_not_walked_again(asked, tmp_path, capsys, monkeypatch):
    first = answer(capsys, asked, "--out", tmp_path / "out")

    def refused(order):
        raise AssertionError("walked again")

    monkeypatch.setattr(walks, "walk", refused)
    assert answer(capsys, asked, "--out", tmp_path / "out") == first


def test_a_hidden_number_is_looked_for_in_place_of_the_measured_figures(asked, capsys):
    _, reported = answer(capsys, asked, "--hide", "hip_spring_Nm_per_rad=-30%", "--hide", "body.leg_length_m=+0.01")
    spring, leg = reported["blind"]
    assert spring["candidate"] == "hip_spring_Nm_per_rad" and spring["truth"] == pytest.approx(0.7 * 7.6)
    (cause,) = spring["answer"]["causes"]
    low, high = cause["parameters"]["hip_spring_Nm_per_rad"]["ci95"]
    assert low < 0.7 * 7.6 < high
    assert leg["candidate"] is None and not leg["answer"]["detected"]  # these walks do not feel it


def test_a_further_figure_is_weighed_with_the_others(asked, capsys):
    _, reported = answer(capsys, asked, "--also", "ankle_height_m=0.06+-0.0005")
    low, high = reported["causes"][0]["parameters"]["ankle_offset_m"]["ci95"]
    assert low < 0.14 < high and high - low < 0.004
    assert reported["evidence"]["figures"] == 4


def test_the_user_reads_what_is_wrong_and_what_to_measure(asked, capsys):
    assert command.main([str(asked), "--jobs", "1"]) == 1
    reported = capsys.readouterr().out
    assert reported.startswith("Wrong is ankle_offset_m 0.1") and "was 0.11" in reported
    assert "next: ankle_height_m to 0.001 (ruler)" in reported


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("nowhere",), "nowhere: there is record-walk"),
        (("nowhere.toml",), "No such file"),
        (("{file}", "--also", "step_length_m"), "NAME=VALUE"),
        (("{file}", "--also", "weight_N=1+-1"), "figure weight_N"),
        (("{file}", "--hide", "leg"), "KEY=CHANGE"),
        (("{file}", "--hide", "leg=+1"), "body.NAME or controller.NAME"),
        (("{file}", "--hide", "body.leg=+1"), "the body has no such number"),
        (("{file}", "--body", "atlas"), "atlas"),
    ],
)
def test_a_mistake_on_the_command_line_is_reported_in_one_line(asked, capsys, words, complaint):
    assert command.main([*(word.format(file=asked) for word in words), "--jobs", "1"]) == 2
    reported = capsys.readouterr().err
    assert complaint in reported and reported.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("steps = 20", "steps = 5", "steps 5"),
        ("steps = 20", 'steps = "20"', "int is expected"),
        ("steps = 20", "legs = 4", "legs: unknown key"),
        ("high = 0.19", "high = 9.0", "outer_ankle_offset_m would be 9"),
        ('"body.hip_spring_Nm_per_rad" = 1', '"body.hips" = 1', "the body has no such number"),
    ],
)
def test_a_file_that_does_not_fit_the_robot_is_reported_in_one_line(asked, capsys, old, new, complaint):
    assert old in FILE
    asked.write_text(FILE.replace(old, new, 1), encoding="utf-8")
    assert command.main([str(asked), "--jobs", "1"]) == 2
    reported = capsys.readouterr().err
    assert complaint in reported and "asked.toml" in reported and reported.count("\n") == 1


def test_the_question_of_the_record_walk_fits_the_robot():
    options = command.parser().parse_args(["record-walk"])
    setup, question = work.asked(options)
    assert (setup.controller, setup.body) == ("record-2011", "appendix")
    assert {each.name for each in question.gait} >= {"step_length_m", "step_time_s", "net_motor_power_W"}
    assert question.endurance.value == 186076 and question.endurance.at_least
    values = {each.name: each.value for each in question.candidates}
    assert values["ankle_offset_m"] == 0.11 and values["mass_offset_kg_m"] == 0.0


def test_benches_show_what_the_appendix_computes():
    """Body ranger: 0.96 + 0.2 - 0.146 m; atan(0.04 / 0.72) = 3.18 degrees; 0.72 x 9.81 N m; eq. 30."""
    shown = walks.of_bench(body_files.load("ranger").parameters)
    assert shown["sole_to_hip_m"] == pytest.approx(1.014)
    assert shown["ankle_height_m"] == pytest.approx(0.054)
    assert math.degrees(shown["hanging_angle_rad"]) == pytest.approx(3.1798, abs=1e-4)
    assert shown["holding_torque_Nm"] == pytest.approx(7.0632)
    assert shown["pendulum_period_s"] == pytest.approx(1.75197, abs=1e-5)
    assert shown["hip_spring_Nm_per_rad"] == 7.6


def test_what_never_got_going_is_neither_figure_nor_failure():
    setup = walks.Setup(body="appendix", steps=20, settle_steps=10)
    # a centre of mass 60 mm ahead tips it over
    point = setup.settings({"body.outer_mass_offset_kg_m": 0.3, "body.inner_mass_offset_kg_m": 0.3}, 1)
    reported = Outcome(**walks.walk(walks.Order(point, 20, 10)))
    assert reported.survived == 0.0 and not reported.failed
    assert "step_length_m" not in reported.figures and "sole_to_hip_m" in reported.figures


def test_walks_are_the_same_in_one_process_and_in_two():
    """The emulated robot: 20 steps with two springs."""
    options = command.parser().parse_args(["record-walk", "--steps", "20"])
    setup, question = work.asked(options)
    points = [Point((), 1), Point((("hip_spring_Nm_per_rad", 9.0),), 1)]
    alone, together = (list(walks.Walks(setup, question.candidates, jobs)(points)) for jobs in (1, 2))
    assert alone == together
    soft, stiff = alone
    assert set(soft.figures) == set(walks.FIGURES) and soft.survived == 10.0 and not soft.failed
    assert 0.25 < soft.figures["step_length_m"] < 0.45 and 0.5 < soft.figures["step_time_s"] < 0.8
    assert soft.figures["net_motor_power_W"] < soft.figures["motor_power_W"]
    assert stiff.figures["hip_spring_Nm_per_rad"] == 9.0
    assert stiff.figures["step_time_s"] < soft.figures["step_time_s"]  # a stiffer spring swings the leg faster


def test_a_store_of_walks_that_was_cut_short_is_begun_anew(tmp_path):
    (tmp_path / walks.STORE).write_text('{"abc": {', encoding="utf-8")
    assert walks.Walks(walks.Setup(), (), 1, tmp_path).known == {}


def test_an_impossible_folder_is_reported(asked, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(UserError, match="cannot write"):
        work.run(command.parser().parse_args([str(asked), "--out", str(tmp_path / "file")]))
