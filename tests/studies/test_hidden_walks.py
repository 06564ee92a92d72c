"""Hidden walks of the emulator put to the comparison with twins: a sample; `python -m studies.hidden_walks` has all."""

import dataclasses

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.api import diagnosis
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.results import TwinsEvidence
from ranger_sim.sysid.twins import evidence
from ranger_sim.tools.diagnose import page, twin_words
from ranger_sim.tools.twins.emulation import emulate
from studies.hidden_walks import score
from studies.hidden_walks.draw import Hidden, as_row, deviations, recorded, scenario_of, tolerance_of
from studies.hidden_walks.kinds import KINDS

BY_NAME = {kind.name: kind for kind in KINDS}


def hidden(name, size, **more):
    return Hidden(BY_NAME[name], size, 71, 0.0, 0.8, **{"loose": False, **more})


def test_at_least_thirty_kinds_are_hidden():
    assert len(KINDS) >= 30 and len({kind.name for kind in KINDS}) == len(KINDS)


def test_a_scenario_has_the_hidden_change_and_no_other(tmp_path):
    scenario = scenario_of(hidden("slope", 0.005), tmp_path)
    assert scenario.slope_rad == 0.005 and scenario.body == "ranger" and scenario.model_file is None
    scenario_of(hidden("mass", 0.3), tmp_path)
    assert "total_mass_kg = 10.21" in (tmp_path / "b.toml").read_text()


def test_a_relative_change_multiplies(tmp_path):
    scenario_of(hidden("stance gain", 0.25), tmp_path)
    assert "C_F_ST_F_ANG = 5.0" in (tmp_path / "c.toml").read_text()


def test_the_rates_count_what_was_detected_and_named():
    one = score.case_of(hidden("mass", 0.3), 2.0, "level", "full", TwinsEvidence("record-2011"))
    found = dataclasses.replace(one, detected=True, named="inertia at body", right=True, holds=True)
    (rates,) = score.table([one, found], {("full", "level"): (0, 50)})
    assert (rates["walks"], rates["detected"], rates["right"], rates["holds"]) == (2, 1, 1, 1)


def test_all_turns_have_every_kind_at_every_multiple_and_one_turn_has_it_once(monkeypatch):
    asked = []
    sizes = {f"{kind.right}: {kind.parameter}": 0.001 for kind in KINDS}
    monkeypatch.setattr(score, "visible", lambda row, floor, seed: sizes)
    monkeypatch.setattr(score, "judged", lambda hidden, multiple, floor, rows: asked.append((hidden, multiple)) or [])
    score.all_cases(5, ["level", "1 mm"], ["full"], turns=[0])
    assert len(asked) == 2 * len(KINDS)
    score.all_cases(5, ["level", "1 mm"], ["full"], turns=[1, 2])
    cells = {(hidden.kind.name, hidden.floor_m, multiple) for hidden, multiple in asked}
    assert len(cells) == len(asked) == 6 * len(KINDS)


def test_sizes_that_would_have_been_detected_are_a_line_for_each_kind_of_cause():
    sizes = {"geometry at outer_feet: foot_height_m": 0.00088, "geometry at inner_feet: foot_height_m": 0.0015,
             "floor at floor: slope_rad": 0.0021}  # fmt: skip
    lines = twin_words.visible({"smallest_visible": sizes, "cannot_be_seen": ["inertia at body: mass_kg"]})
    assert lines == [
        "twins: would have been detected from these sizes on:",
        "twins:   floor (slope_rad): floor 0.0021",
        "twins:   geometry (foot_height_m): inner_feet 0.0015, outer_feet 0.00088",
        "twins: not shown by these channels: inertia at body: mass_kg",
    ]


@pytest.mark.parametrize(
    ("name", "size", "at"),
    [
        ("hip spring", -1.14, "step 1"),
        ("outer ankle's friction", 0.1, "step 1"),
        ("slope", 0.005, "step 1"),
        ("outer cable slips", 0.05, "step 24"),
    ],
)
def test_a_hidden_cause_is_named_first(name, size, at):
    case = hidden(name, size, at=at)
    found, _ = evidence.of([recorded(case)])
    assert found.detected and found.named is not None
    assert f"{found.named.name} at {found.named.at}" == case.kind.right
    low, high = found.named.parameters[case.kind.parameter].ci95
    assert low <= size <= high


@pytest.mark.parametrize(("name", "size", "row"), [("slope", 0.005, "link"), ("outer ankle's friction", 0.1, "2015")])
def test_a_cause_that_moves_a_leg_is_not_taken_for_a_rough_floor_or_its_absence(name, size, row):
    case = hidden(name, size)
    found, _ = evidence.of([as_row(recorded(case), row)], emulator=emulate)
    assert found.detected and found.named is not None and found.since_step == 0
    assert f"{found.named.name} at {found.named.at}" == case.kind.right
    low, high = found.named.parameters[case.kind.parameter].ci95
    assert low <= size <= high


def test_a_zero_four_times_beyond_the_sizes_of_twins_has_an_interval_that_holds():
    case = hidden("inner ankle's zero", 0.07)
    found, _ = evidence.of([recorded(case)], emulator=emulate)
    assert f"{found.named.name} at {found.named.at}" == case.kind.right and found.emulations > 0
    low, high = found.named.parameters["offset_rad"].ci95
    assert low <= 0.07 <= high < 0.09


def test_the_size_asked_for_includes_what_the_body_has_within_its_tolerance():
    loose = hidden("hip spring", -1.14, loose=True)
    (other,) = {tolerance_of(loose)} - {0.0}
    assert deviations(loose)["hip_spring_Nm_per_rad"] == other and tolerance_of(hidden("hip spring", -1.14)) == 0.0


def three_channels(hidden_walk):
    """The recording by hip angle, leg angle and state, under the names of the log of 2015."""
    found = as_row(recorded(hidden_walk), "2015").channels
    names = {"MCH_ANGLE": "hip_angle_rad", "E_LO_ANGLE": "outer_leg_abs_angle_gyro_rad", "FSM_LEG": "walk_fsm_state"}
    stamps = found["MCH_ANGLE"].time_s
    channels = {}
    for variable, name in names.items():
        each = found[variable]
        if variable == "FSM_LEG":
            rows = np.maximum(np.searchsorted(each.time_s, stamps, side="right") - 1, 0)
            channels[name] = Channel(name, "", stamps, each.value[rows])
        else:
            channels[name] = Channel(name, "rad", stamps, np.interp(stamps, each.time_s, each.value))
    return Dataset("three channels", channels)


def test_twins_alone_judge_a_walk_that_gives_no_equation():
    found = diagnosis(three_channels(hidden("hip spring", -1.8)), "walk")
    (cause,) = found.result.causes
    assert (cause.name, cause.at) == ("spring_value", "hip_spring") and found.result.misfit == ()
    low, high = cause.parameters["stiffness_Nm_per_rad"].ci95
    assert low <= -1.8 <= high
    lines = twin_words.lines(found.answer)
    assert lines[0] == "twins: no equation can be made of these recordings: the twins alone judge them"
    assert "Compared with its twins" in page.render(found) and "Misfit by equation" not in page.render(found)


def test_a_walk_that_neither_equations_nor_twins_can_judge_is_refused_with_both_reasons():
    short = three_channels(hidden("hip spring", -1.8, steps=8))
    with pytest.raises(
        UserError, match=r"no equation of a walk .*; and its twins cannot judge it: . steps that can be"
    ):
        diagnosis(short, "walk", emulator=emulate)


def test_a_walk_that_falls_at_once_is_refused_with_the_time_of_its_fall():
    fallen = recorded(hidden("slope", -0.05))
    with pytest.raises(UserError, match=r"steps are too few: the robot falls after [0-9.]+ s"):
        diagnosis(fallen, "walk", emulator=emulate)


def test_a_sound_walk_is_silent_at_every_rate():
    dataset = recorded(Hidden(None, 0.0, 72, 0.0, 0.7, loose=False))
    for row in score.ROWS:
        found, _ = evidence.of([as_row(dataset, row)])
        assert found.note == "" and not found.detected
