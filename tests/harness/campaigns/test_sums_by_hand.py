"""What a campaign's results add up to, on a few runs by hand: every sum, share, median, order and table."""

import math
from types import SimpleNamespace as Made

import numpy as np
import pytest

from ranger_sim.harness.campaigns import outcomes, subjects, summary
from ranger_sim.harness.campaigns.cases import Case, Settings
from ranger_sim.harness.campaigns.group import Watch
from ranger_sim.harness.campaigns.outcomes import Band
from ranger_sim.harness.campaigns.plan import Plan, Range, Sample, Search, Tolerance
from ranger_sim.harness.campaigns.statistics import Share, Stopping, census, clopper_pearson, wilson
from ranger_sim.harness.faults.proof import Detection, Difference, Gait, Proof
from ranger_sim.ranger.walks import REFERENCE

STUCK, PUSH = "MCH.motor:stuck@1 s", "world.robot:push@1 s"


def plan(**more):
    whole = {"path": "a b.toml", "title": "T", "description": "D", "walk": {}, "watch": Watch(), "healthy_seeds": (1,)}
    return Plan(**{**whole, "axes": {}, "machine": REFERENCE, **more})


def error(board, code, ms):
    return {"board": board, "code": code, "rate": False, "ms": ms}


def run(key, outcome, typed=STUCK, axes=(), settings=None, **result):
    return Case(settings or Settings({"seed": 1}), typed, None, dict(axes)), {"key": key, "outcome": outcome, **result}


# ---- shares


def campaign(plan, foreseen=2, stopped_at=None):
    return Made(plan=plan, foreseen=foreseen, stopped_at=stopped_at)


def test_a_campaign_is_finished_when_all_runs_are_there_or_it_stopped():
    rows = [run("a", "fall"), run("b", "fall")]
    assert summary.is_finished(campaign(plan()), rows) and not summary.is_finished(campaign(plan(), 3), rows)
    assert summary.is_finished(campaign(plan(), 3, 1), rows) and not summary.is_finished(campaign(plan(), 0), [])


def test_a_share_has_the_interval_of_its_sample_and_of_the_look_at_which_it_stopped():
    rows = [run("a", "fall"), run("b", "fall")]
    sample = Sample(2, interval="wilson", confidence=0.9)
    assert summary.sharing(campaign(plan()), rows)(1, 2) == census(1, 2)
    assert summary.sharing(campaign(plan(sample=sample), 3), rows)(1, 2) == census(1, 2)
    share = summary.sharing(campaign(plan(sample=sample)), rows)
    assert share(1, 2) == wilson(1, 2, 0.9) and share(0, 0) == Share(0, 0)
    share = summary.sharing(campaign(plan(sample=Sample(2))), rows)
    assert share(1, 2) == clopper_pearson(1, 2, 0.95)
    stopping = Stopping("fall", 0.5, 60, 3)
    stopped = plan(sample=Sample(60, stopping=stopping))
    share = summary.sharing(campaign(stopped, 60, 2), rows)
    assert share(5, 40) == stopping.interval(5, 40, 2) and share(0, 0) == Share(0, 0)
    assert summary.sharing(campaign(stopped, 2), rows)(5, 40) == clopper_pearson(5, 40)
    assert summary.as_dict(Share(1, 4, 0.1, 0.5)) == {"count": 1, "of": 4, "share": 0.25, "low": 0.1, "high": 0.5}
    assert summary.as_dict(Share(0, 0))["share"] is None


def test_the_design_determines_how_shares_are_read():
    sample = Sample(2, confidence=0.9)
    looks = Sample(60, stopping=Stopping("fall", 0.5, 60, 3, "pocock"))
    for made, finished, expected in (
        (plan(), False, "Shares are of the runs that are there"),
        (plan(search=Search()), True, "The runs were chosen to find the worst case"),
        (plan(), True, "A census"),
        (plan(sample=sample), True, "A random sample of the population, with replacement: clopper-pearson intervals"),
        (plan(sample=looks), True, "A random sample with up to 3 looks: repeated intervals of 95 %"),
    ):
        assert summary.interval_text(made, finished).startswith(expected)
    assert summary.interval_text(plan(sample=sample), True).endswith("of 90 %.")


# ---- times


@pytest.mark.parametrize(
    ("times", "sample", "expected"),
    [
        ([10, 20, 30, 40], None, {"within": 3, "of": 4, "median_ms": 30.0, "verdict": "met", "by": "census"}),
        ([10, 20, 30.1, 40], None, {"within": 2, "of": 4, "median_ms": 30.1, "verdict": "not met", "by": "census"}),
        ([10, math.inf], None, {"within": 1, "of": 2, "median_ms": None, "verdict": "not met", "by": "census"}),
        ([], None, {"within": 0, "of": 0, "median_ms": None, "verdict": "not met", "by": "census"}),
        # of four values the largest bounds 75 % with 1 - 0.75^4 = 68 %
        (
            [10, 20, 30, 40],
            0.6,
            {"within": 3, "of": 4, "median_ms": 30.0, "verdict": "open: this", "by": "60 %", "upper_ms": 40.0},
        ),
        ([10, 20, 30], 0.6, {"within": 3, "of": 3, "median_ms": 20.0, "verdict": "open: 4 runs", "by": "60 %"}),
        (
            [10, 20, 30, 30],
            0.6,
            {"within": 4, "of": 4, "median_ms": 30.0, "verdict": "met", "by": "60 %", "upper_ms": 30.0},
        ),
        (
            [10, 40, 50, math.inf],
            0.6,
            {"within": 1, "of": 4, "median_ms": 50.0, "verdict": "not met", "by": "60 %", "upper_ms": None},
        ),
    ],
)
def test_a_tolerance_is_held_against_the_times(times, sample, expected):
    rows = [
        run(str(n), "masked", detected=[error("A", "X", each)] if each < math.inf else [])
        for n, each in enumerate(times)
    ]
    wanted = Tolerance("detection", 30.0, 0.75, sample or 0.95)
    reported = summary.tolerance(plan(sample=Sample(9) if sample else None), wanted, rows)
    verdict = reported.pop("verdict")
    assert verdict.startswith(expected.pop("verdict"))
    assert reported == {"what": "detection", "limit_ms": 30.0, "share": 0.75, **expected}


def test_a_time_is_that_of_the_first_error_or_of_the_reaction_or_never():
    result = {"detected": [error("A", "X", 5), error("B", "Y", 4)], "reaction": {"ms": 7}}
    assert summary.first_ms(result, "detection") == 5.0 and summary.first_ms(result, "reaction") == 7.0
    for nothing in ({}, {"detected": [], "reaction": None}):
        assert summary.first_ms(nothing, "detection") == summary.first_ms(nothing, "reaction") == math.inf


# ---- tables


def test_an_axis_is_a_table_when_it_has_two_to_twenty_values():
    def rows(count):
        return [run(str(n), "fall", axes={"x": n}) for n in range(count)]

    assert [summary.varies(rows(count), "x") for count in (1, 2, 20, 21)] == [False, True, True, False]
    mixed = [run("a", "fall", axes={"x": 1}), run("b", "fall", axes={"x": 1}), run("c", "masked", axes={"x": 2})]
    assert summary.by_axis(mixed, "x") == {"1": {"fall": 2}, "2": {"masked": 1}}


def test_outcomes_are_listed_by_place_and_mode():
    rows = [run("a", "fall"), run("b", "masked"), run("c", "fall", PUSH), run("d", "fall", None)]
    assert summary.heat(rows) == {
        "places": ["MCH.motor", "world.robot"],
        "modes": ["push", "stuck"],
        "cells": {"MCH.motor": {"stuck": ["fall", "masked"]}, "world.robot": {"push": ["fall"]}},
    }


SLOTS = {"A": {"margin": 0.5, "overruns": 2}, "B": {"margin": 0.25, "overruns": 1}}


def test_a_sweep_has_its_runs_in_a_table_with_the_slot_that_left_least():
    rows = [
        run("a", "masked", None, {"x": 1}, gait={"steps": 3}, slots=SLOTS),
        run("b", "fall", None, {"x": 2}, why="it fell"),
        run("c", "fall"),
    ]
    empty = {"board": "", "margin": None, "overruns": None}
    assert summary.settings_table(plan(), rows) == [
        {
            "axes": {"x": 1},
            "outcome": "masked",
            "why": "",
            "gait": {"steps": 3},
            "slot": {"board": "B", "margin": 0.25, "overruns": 3},
        },
        {"axes": {"x": 2}, "outcome": "fall", "why": "it fell", "gait": {}, "slot": empty},
    ]
    assert summary.settings_table(plan(sample=Sample(3)), rows) == []
    assert len(summary.settings_table(plan(), rows[:1] * 200)) == 200
    assert summary.settings_table(plan(), rows[:1] * 201) == []


def test_first_detecting_errors_are_counted_with_those_of_the_faults_own_board():
    rows = [
        run("a", "masked", detected=[error("MCH", "X", 5), error("MB", "Y", 6)]),
        run("b", "masked", PUSH, detected=[error("MCH", "X", 50)]),
        run("c", "masked", None, detected=[error("MCH", "X", 9)]),
        run("d", "masked", detected=[error("MB", "Y", 3)]),
        run("e", "masked", detected=[]),
    ]
    assert summary.codes(rows) == [
        {"board": "MCH", "code": "X", "first": 3, "own_board": 1, "median_ms": 9},
        {"board": "MB", "code": "Y", "first": 1, "own_board": 0, "median_ms": 3},
    ]


def test_the_worst_cases_are_those_from_a_degraded_gait_on_and_each_is_listed_once():
    rows = [
        run("a", "detected and safe"),
        run("b", "degraded", deviation=2.0),
        run("c", "fall", fall_ms=900.0),
        run("d", "fall", fall_ms=90.0),
        run("c", "fall", fall_ms=900.0),
        run("e", "undetected wrong", deviation=1.0),
    ]
    assert [result["key"] for _, result in summary.worst(rows)] == ["d", "c", "e", "b"]
    assert len(summary.worst([run(str(n), "fall") for n in range(21)])) == 20
    assert summary.worst_of(["masked", "fall", "degraded"]) == "fall"
    assert summary.worst_of(["masked", "detected and safe"]) == "detected and safe"


def test_a_search_reports_for_each_listed_value_the_least_that_led_to_the_outcome_and_the_soonest_fall():
    made = plan(axes={"force": Range(0.0, 9.0), "at": ["x", "y"]}, search=Search(least="force", outcome="damage"))
    rows = [
        run("a", "damage", axes={"force": 5.0, "at": "x"}),
        run("b", "damage", axes={"force": 4.0, "at": "x"}, fall_ms=70.0),
        run("c", "fall", axes={"force": 3.0, "at": "x"}, fall_ms=60.0),
        run("a", "damage", axes={"force": 5.0, "at": "x"}),
        run("d", "masked", axes={"force": 1.0, "at": "y"}),
    ]
    first, second = summary.extremes(made, rows)
    assert (first["cell"], first["runs"], first["hits"], first["outcome"]) == ("at x", 3, 2, "damage")
    assert (first["least"]["key"], first["soonest"]["key"]) == ("b", "c")
    assert second == {"cell": "at y", "runs": 1, "outcome": "damage", "hits": 0, "least": None, "soonest": None}
    assert summary.extremes(plan(), rows) == []
    assert [each["least"] for each in summary.extremes(plan(axes=made.axes, search=Search()), rows)] == [None, None]


# ---- a run


def test_a_replay_is_the_walk_itself_or_the_campaigns_where_more_was_set():
    made = plan(watch=Watch(after_s=3.0, from_s=5.0))
    case = Settings({"seed": 4, "slope_rad": 0.1, "battery_charge": 0.5, "controller": "robust"})
    row = run("k", "fall", PUSH, settings=case, fault={"activated_s": 1.5})
    assert summary.replay(made, row) == (
        f"ranger-sim walk --fault '{PUSH}' --controller robust --seed 4 --slope 0.1 --battery 0.5 --time 4.500s"
    )
    assert summary.replay(plan(), run("k", "fall", PUSH)).endswith("--seed 1 --time 12.000s")
    assert "--fault-module m.py --seed" in summary.replay(plan(fault_module="m.py"), run("k", "fall", PUSH))
    again = "ranger-sim campaign 'a b.toml' --replay k"
    for settings in (
        Settings({}, controller={"P": 1.0}),
        Settings({}, body={"p": 1.0}),
        Settings({}, costs={"A.b": 1.0}),
    ):
        assert summary.replay(made, run("k", "fall", PUSH, settings=settings)) == again
    assert summary.replay(made, run("k", "fall", None)) == again
    assert summary.replay(plan(machine=f"{__file__}:y"), run("k", "fall", PUSH)) == again


def test_everything_of_a_small_campaign_adds_up():
    made = plan(
        axes={"fault": [STUCK], "x": [1, 2]},
        tolerances=(Tolerance("detection", 50.0, 0.5),),
        search=None,
        machine="m:x",
    )
    made = Made(
        **{name: getattr(made, name) for name in (*made.__dataclass_fields__, "design")},
        population=made.population,
        subject=Made(
            criteria={"fall": "", "masked": "", "no effect": "", "invalid": ""}, walk_options=lambda settings: None
        ),
    )
    felt = {"first_firmware": {"name": "V", "where": "can1", "ms": 2.0}, "reaction": None}
    rows = [
        run("a", "fall", axes={"x": 1}, fall_ms=80.0, detected=[error("MCH", "X", 5.0)], spent={"cpu_s": 1.25}, **felt),
        run("b", "masked", axes={"x": 2}, detected=[], spent={"cpu_s": 2.0}, why="w"),
        run("c", "no effect", axes={"x": 2}, spent={"cpu_s": None}),
        run("d", "invalid", axes={"x": 2}),
        run("e", "fall", axes={"x": 2}, fall_ms=70.0, detected=[]),
    ]
    found = {id(case): result for case, result in rows}
    cases = [case for case, _ in rows]
    whole = Made(
        plan=made,
        version="v",
        foreseen=5,
        stopped_at=None,
        cases=cases,
        result=lambda case: found.get(id(case)),
        healthy_results=lambda: [{"healthy": 1, "seeds": [1]}],
    )
    reported = summary.of(whole)
    assert {name: reported[name] for name in ("title", "file", "design", "runs", "foreseen", "finished", "cpu_s")} == {
        "title": "T", "file": "a b.toml", "design": "census", "runs": 5, "foreseen": 5, "finished": True, "cpu_s": 3.2,
    }  # fmt: skip
    assert {name: each["count"] for name, each in reported["outcomes"].items()} == {
        "fall": 2,
        "masked": 1,
        "no effect": 1,
        "invalid": 1,
    }
    assert {each["of"] for each in reported["outcomes"].values()} == {5}
    assert [(each["count"], each["of"]) for each in reported["coverage"].values()] == [(1, 3), (2, 4), (1, 2)]
    assert [(each["within"], each["of"], each["verdict"]) for each in reported["tolerances"]] == [(1, 3, "not met")]
    assert reported["healthy"] == [{"seeds": [1]}]
    assert reported["axes"] == {"x": {"1": {"fall": 1}, "2": {"masked": 1, "no effect": 1, "invalid": 1, "fall": 1}}}
    assert reported["axis_names"] == ["x"]
    assert [each["key"] for each in reported["worst"]] == ["e", "a"] and [
        each["key"] for each in reported["unsure"]
    ] == ["d"]
    assert reported["worst"][1]["detected"] == error("MCH", "X", 5.0) and reported["worst"][0]["detected"] is None
    first, second = reported["rows"][:2]
    assert (first["first_firmware"], first["first_firmware_ms"], first["detected_by"]) == (
        "V on can1",
        2.0,
        "X from MCH",
    )
    assert (second["first_firmware"], second["first_firmware_ms"], second["detected_by"]) == ("", None, "")
    whole.foreseen = 6
    assert summary.of(whole)["tolerances"] == [] and not summary.of(whole)["finished"]


# ---- outcomes


GOLDEN = Gait(9, 0.4, 0.5, 10.0)
BAND = Band(0.25, 0.125, 0.5)


@pytest.mark.parametrize(
    ("gait", "golden", "outside", "deviation"),
    [
        (GOLDEN, GOLDEN, "", 0.0),
        (Gait(9, 0.5, 0.5, 10.0), GOLDEN, "", 1.0),
        (Gait(9, 0.512, 0.5, 10.0), GOLDEN, "step length +28 %", 1.12),
        (Gait(9, 0.288, 0.5, 10.0), GOLDEN, "step length -28 %", 1.12),
        (Gait(9, 0.4, 0.5625, 10.0), GOLDEN, "", 1.0),
        (Gait(9, 0.4, 0.4, 10.0), GOLDEN, "step time -20 %", 1.6),
        (Gait(9, 0.4, 0.5, 15.0), GOLDEN, "", 1.0),
        (Gait(9, 0.4, 0.5, 16.0), GOLDEN, "motor power +60 %", 1.2),
        (Gait(9, 0.4, 0.5, 1.0), GOLDEN, "", 0.0),
        (Gait(1, None, 0.5, 10.0), GOLDEN, "1 steps made", 2.0),
        (Gait(1, 0.4, None, 10.0), GOLDEN, "1 steps made", 2.0),
        (Gait(1, None, None, 10.0), Gait(1, None, None, 10.0), "", 2.0),
        (GOLDEN, Gait(1, None, 0.5, 10.0), "", 0.0),
        (GOLDEN, Gait(1, 0.4, None, 10.0), "", 0.0),
        (Gait(9, 0.4, 0.5, 9.0), Gait(9, 0.4, 0.5, 0.0), "", 0.0),
    ],
)
def test_a_gait_is_inside_its_band_or_the_quantities_outside_are_reported(gait, golden, outside, deviation):
    assert outcomes.beyond(gait, golden, BAND) == outside
    assert outcomes.deviation(gait, golden, BAND) == pytest.approx(deviation)


def test_severity_is_the_rank_and_how_soon_it_fell_or_how_far_it_went():
    def of(outcome, **more):
        return outcomes.severity({"outcome": outcome, **more})

    ranks = {"damage": 5, "fall": 4, "undetected wrong": 3, "degraded": 2, "detected and safe": 1, "masked": 1}
    ranks |= {"no effect": 0, "invalid": -1, "timed out": -1, "crashed": -1}
    assert {name: of(name) for name in ranks} == ranks
    assert of("fall", fall_ms=1000.0) == 4.5 and of("fall", fall_ms=3000.0) == 4.25 and of("fall", fall_ms=-5.0) == 5.0
    assert of("masked", deviation=2.5) == 1.25 and of("masked", deviation=99.0) == 1.99
    assert of("masked", deviation=-1.0) == of("masked", deviation=None) == 1.0


def test_an_own_machines_run_is_judged_by_the_bands_of_its_body():
    made = subjects.OwnMachine.__new__(subjects.OwnMachine)
    made.__dict__["shown"] = Made(plant=Made(sample_names={"angle": "rad", "rate": "rad/s"}))
    time = [0.0, 0.5, 1.0, 1.5]

    def record(angle, rate=(0, 0, 0, 0), fell_ns=-1):
        columns = {"angle": np.array(angle, dtype=float), "rate": np.array(rate, dtype=float)}
        return Made(samples=np.array([[each] for each in time]), sample=columns.get, fell_ns=fell_ns, fall_cause="stop")

    band = {"angle": 2.0, "rate": 4.0}
    golden = record([0, 0, 0, 0])

    def judged(angle, rate=(0, 0, 0, 0), golden=golden, sweep=False, **more):
        whole = {"acted": True, "first_firmware": Difference("can1", "x", 1, 0, 0), "detections": (), "fell_ns": None}
        proof = Proof(
            **{**whole, **more}, activated_ns=0, first=None, reaction=None, unusual=None, fall_cause="end of travel"
        )
        found = made.judge(proof, golden, record(angle, rate), 500_000_000, band, sweep)
        return found["outcome"], found["why"], found["deviation"]

    reported = (Detection("A", "E", 1, False),)
    assert judged([9, 2, 0, 0]) == ("masked", "", 1.0)  # what was before does not count; just at its band
    assert judged([0, 0, 3, 0]) == ("undetected wrong", "angle off by 3 rad", 1.5)
    assert judged([0, 0, -3, 0], detections=reported) == ("degraded", "angle off by 3 rad; E from A", 1.5)
    assert judged([0, 0, 3, 0], rate=[0, 0, 0, 7]) == ("undetected wrong", "rate off by 7 rad/s", 1.75)
    assert judged([0, 0, 0, 0], detections=reported) == ("detected and safe", "E from A", 0.0)
    assert judged([0, 0, 3, 0], first_firmware=None)[0] == "no effect"
    assert judged([0, 0, 3, 0], acted=False)[:2] == ("invalid", "the fault never acted")
    assert judged([0, 0, 3, 0], fell_ns=0)[:2] == ("fall", "end of travel")
    fallen = record([0, 0, 0, 0], fell_ns=0)
    assert judged([0, 0, 0, 0], golden=fallen, fell_ns=5)[:2] == ("invalid", "the golden run ended as well (stop)")
    assert judged([0, 0, 0, 0], golden=fallen, sweep=True)[0] == "invalid"
    assert judged([0, 0, 0, 0], golden=fallen, fell_ns=5, sweep=True)[0] == "fall"
    assert subjects.farthest(golden.sample("angle"), golden.sample("angle"), golden, golden, 2_000_000_000) == 0.0
