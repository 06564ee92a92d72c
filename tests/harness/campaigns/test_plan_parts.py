"""Every part of a campaign's file on both sides of what it allows, and what it comes to, whole."""

import math
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import plan
from ranger_sim.harness.campaigns.cases import Settings
from ranger_sim.harness.campaigns.group import Watch
from ranger_sim.harness.campaigns.outcomes import Band
from ranger_sim.harness.campaigns.plan import Plan, Range, Sample, Search, Tolerance
from ranger_sim.harness.campaigns.statistics import Stopping
from ranger_sim.harness.campaigns.subjects import OwnMachine
from ranger_sim.ranger.walks import REFERENCE, WALK, WALKS

PATH = "here.toml"


def refused(reported, made, *arguments):
    with pytest.raises(UserError) as mistake:
        made(*arguments)
    assert reported in str(mistake.value) and "\n" not in str(mistake.value), str(mistake.value)


# ---- ranges


def test_a_range_with_a_step_counts_its_last_value_where_rounding_put_it_beyond():
    assert Range(0.0, 0.3, step=0.1).size == 4  # 0.3 / 0.1 is 2.9999999999999996
    assert Range(0, 10, step=3).size == 4 and Range(0, 10, step=3).values == [0, 3, 6, 9]
    assert Range(0, 9, step=10).size == 1
    assert Range(1.0, 2.0, step=1 / 3).values == [1.0, 1.33333, 1.66667, 2.0]
    assert type(Range(1, 3, step=1).values[1]) is int and type(Range(1.0, 3.0, step=1.0).values[1]) is float


def test_a_range_gives_six_digits_between_its_ends():
    assert [Range(-2.0, 4.0).at(share) for share in (0.0, 0.5, 1.0)] == [-2.0, 1.0, 4.0]
    assert Range(0.0, 1.0).at(1 / 3) == 0.333333
    assert Range(1.0, 1000.0, log=True).at(1 / 3) == 10.0 and Range(1.0, 1000.0, log=True).at(2 / 3) == 100.0
    assert [Range(0, 20, step=10).at(share) for share in (0.0, 0.33, 0.34, 0.66, 0.67, 1.0)] == [0, 0, 10, 10, 20, 20]


def test_a_range_is_printed_with_its_step_or_as_going_by_factors():
    assert Range(0.5, 2.0).text() == "0.5 to 2"
    assert Range(0.5, 2.0, log=True).text() == "0.5 to 2, by factors"
    assert Range(1, 5, step=2).text() == "1 to 5 by 2"


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"low": 1, "high": 2}, Range(1.0, 2.0)),
        ({"low": -1, "high": 2.5, "log": False}, Range(-1.0, 2.5)),
        ({"low": 0.1, "high": 2, "log": True}, Range(0.1, 2.0, True)),
        ({"low": 1, "high": 3, "step": 2}, Range(1, 3, False, 2)),
        ({"low": 0, "high": 999_999, "step": 1}, Range(0, 999_999, False, 1)),
        ({"low": "1 mm", "high": "3 mm", "step": "1 mm"}, Range(0.001, 0.003, False, 0.001)),
    ],
)
def test_a_range_of_a_file_is_this(values, expected):
    found = plan.range_of(WALKS, "floor_roughness", values, PATH)
    assert found == expected and found.log is expected.log


@pytest.mark.parametrize(
    ("values", "reported"),
    [
        ({"low": 1, "high": 1}, "[vary] force = 1 to 1: low below high"),
        ({"low": 1, "high": "x"}, "low below high"),
        ({"low": True, "high": 2}, "low below high"),
        ({"low": 0.0, "high": 2, "log": True}, "low below high, above 0"),
        ({"low": 1, "high": 3, "step": 0}, "step = 0: above 0"),
        ({"low": 1, "high": 3, "step": 2.5}, "step = 2.5: above 0 and at most"),
        ({"low": 1, "high": 3, "step": -1}, "step = -1"),
        ({"low": 1, "high": 3, "step": "1"}, "step = '1'"),
        ({"low": 1, "high": 3, "step": 1, "log": True}, "without log"),
        ({"low": 0, "high": 1_000_000, "step": 1}, "step = 1: above 0"),
        ({"low": 1, "high": 3, "steps": 1}, "unknown key 'steps'"),
    ],
)
def test_a_range_that_is_none_is_refused(values, reported):
    refused(reported, plan.range_of, WALKS, "force", values, PATH)


# ---- lists


def test_a_single_value_is_a_list_of_one_and_its_kind_is_what_the_axis_takes():
    assert plan.values_of(WALKS, "seed", 3, PATH) == [3] and plan.values_of(WALKS, "start", "1 s", PATH) == ["1 s"]
    assert plan.values_of(WALKS, "x", [1, 2.5, "a"], PATH) == [1, 2.5, "a"]
    assert plan.values_of(WALKS, "cost.MCH.x", [1, 2.5], PATH) == [1, 2.5]
    assert plan.values_of(WALKS, "fault", "a:b", PATH) == ["a:b"]
    assert plan.values_of(WALKS, "x", {"low": 1, "high": 2}, PATH) == Range(1.0, 2.0)
    for name in ("controller.P", "body.p", "cost.p"):
        refused("a list of numbers, or { low, high },", plan.values_of, WALKS, name, ["1"], PATH)
        assert plan.values_of(WALKS, name, {"low": 1, "high": 2}, PATH) == Range(1.0, 2.0)
    refused("a list of texts is expected", plan.values_of, WALKS, "fault", [1], PATH)
    refused("a list of values, or { low, high }, is expected", plan.values_of, WALKS, "x", [True], PATH)
    refused("a list of values", plan.values_of, WALKS, "x", [], PATH)


def test_tables_in_vary_have_dotted_names_and_ranges_stay_whole():
    data = {"a": 1, "b": {"c": 2, "d": {"e": [3]}}, "f": {"low": 1, "high": 2}, "g": {"low": 1}}
    expected = {"a": 1, "b.c": 2, "b.d.e": [3], "f": {"low": 1, "high": 2}, "g.low": 1}
    assert plan.flattened(data) == expected


def test_an_axis_is_a_setting_or_a_name_in_a_faults_text():
    assert all(WALKS.is_setting(name) for name in (*WALK, "controller.X", "body.x", "cost.MCH.x"))
    assert not any(WALKS.is_setting(name) for name in ("machine.x", "force", "fault"))
    own = OwnMachine.__new__(OwnMachine)
    assert all(own.is_setting(name) for name in ("seed", "machine.x", "cost.A.x"))
    assert not any(own.is_setting(name) for name in ("slope", "body.x", "force"))
    assert plan.names_in("a:b,x={x},y={y:g}@{start}..{x}", PATH) == {"x", "y", "start"}
    assert plan.names_in("a:b{{x}}", PATH) == set()
    refused("here.toml: fault 'a}': ", plan.names_in, "a}", PATH)


def test_the_ends_of_an_axis_are_its_first_and_last_value():
    assert plan.ends([5, 1, 7]) == [5, 7] and plan.ends(["a"]) == ["a", "a"]
    assert plan.ends(Range(1.0, 4.0)) == [1.0, 4.0] and plan.ends(Range(1, 8, step=3)) == [1, 7]


def test_combinations_go_through_the_last_axis_first():
    axes = {"a": [1, 2], "b": Range(0, 2, step=1)}
    assert list(plan.combinations(axes)) == [{"a": a, "b": b} for a in (1, 2) for b in (0, 1, 2)]


def test_a_value_of_a_fault_has_six_digits_and_everything_else_is_unchanged():
    assert [plan.shown(each) for each in (0.1234567, 2.0, 3, "1 s")] == ["0.123457", "2", "3", "1 s"]


def test_a_value_of_a_walk_is_taken_in_its_unit():
    values = {
        ("slope", "180 deg"): math.pi,
        ("slope", "2 rad"): 2.0,
        ("floor_roughness", "2 cm"): 0.02,
        ("battery", "25 %"): 0.25,
        ("battery_capacity", "400 Wh"): 400.0,
        ("slope", 0.5): 0.5,
        ("controller", "robust"): "robust",
        ("seed", 4): 4,
    }
    for (name, value), expected in values.items():
        assert plan.walk_value(WALKS, name, value, PATH) == pytest.approx(expected)
    refused("slope = '3 m': a number with one of the units rad, deg", plan.walk_value, WALKS, "slope", "3 m", PATH)


# ---- faults


CATALOGUE = Made(
    places={
        name: Made(name=name, kind=kind)
        for name, kind in {"A.wire": "wire", "A.motor": "motor", "B.wire": "wire"}.items()
    },
    modes_of=lambda place: {"stuck": 1, "cut": 2} if place.kind == "wire" else {"hot": 3},
)


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        ({}, ["A.wire:cut", "A.wire:stuck", "A.motor:hot", "B.wire:cut", "B.wire:stuck"]),
        ({"places": "A.*"}, ["A.wire:cut", "A.wire:stuck", "A.motor:hot"]),
        ({"kinds": ["wire"], "modes": "c*"}, ["A.wire:cut", "B.wire:cut"]),
        ({"places": ["A.*"], "kinds": "wire", "without": ["*:cut"]}, ["A.wire:stuck"]),
        ({"without": "?.wire:*"}, ["A.motor:hot"]),
        ({"kinds": "motor", "period": "1 s"}, ["A.motor:hot@1 s"]),
        ({"kinds": "motor", "values": {"x": 1, "y": "{y}"}}, ["A.motor:hot,x=1,y={y}"]),
        ({"kinds": "motor", "values": {"x": 2.5}, "period": "{at}"}, ["A.motor:hot,x=2.5@{at}"]),
    ],
)
def test_a_table_of_faults_comes_to_these(group, expected):
    assert list(plan.faults_of(group, PATH, CATALOGUE)) == expected


@pytest.mark.parametrize(
    ("group", "reported"),
    [
        ("A.wire", "[[faults]]: a table is expected"),
        ({"place": "A.wire"}, "unknown key 'place'"),
        ({"places": 3}, "places = 3: a list of texts"),
        ({"modes": ["a", 1]}, "modes = ['a', 1]: a list of texts"),
        ({"kinds": "wire", "modes": "hot"}, "no place and mode fit"),
        ({"values": 3}, "values = 3: a table is expected"),
    ],
)
def test_a_table_of_faults_that_comes_to_nothing_is_refused(group, reported):
    refused(reported, lambda: list(plan.faults_of(group, PATH, CATALOGUE)))


# ---- how it is watched


def test_how_runs_are_watched_is_taken_whole():
    assert plan.watch_of({}, PATH, WALKS) == Watch(7.0, 5.0, 30.0, 300.0, Band(0.15, 0.15, 0.30))
    data = {
        "watch": {"after": "2 s", "from": "0 s", "patience": "0 s", "limit": "1 ms"},
        "band": {"step_length": 0.1, "step_time": "20 %", "motor_power": 9.99},
    }
    assert plan.watch_of(data, PATH, WALKS) == Watch(2.0, 0.0, 0.0, 0.001, Band(0.1, 0.2, 9.99))
    for name in ("after", "limit"):
        refused(f"[watch] {name} = '0 s': it must be above 0", plan.watch_of, {"watch": {name: "0 s"}}, PATH, WALKS)
    refused("unknown key 'until'", plan.watch_of, {"watch": {"until": "1 s"}}, PATH, WALKS)
    refused("unknown key 'power'", plan.watch_of, {"band": {"power": 0.1}}, PATH, WALKS)
    for wrong in (0.0, 10.0, -0.1, "1 s", True, [0.1]):
        refused(
            f"[band] step_time = {wrong!r}: a share such as", plan.watch_of, {"band": {"step_time": wrong}}, PATH, WALKS
        )


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({"detection": {"within": "50 ms"}}, [Tolerance("detection", 50.0, 0.95, 0.95)]),
        (
            {"reaction": {"within": "1 s", "share": 0.5, "confidence": 0.9}, "detection": {"within": "1500 us"}},
            [Tolerance("reaction", 1000.0, 0.5, 0.9), Tolerance("detection", 1.5, 0.95, 0.95)],
        ),
    ],
)
def test_tolerances_are_taken_whole(data, expected):
    assert list(plan.tolerances_of({"tolerance": data}, PATH)) == expected


@pytest.mark.parametrize(
    ("data", "reported"),
    [
        ({"detected": {"within": "1 s"}}, "allowed are detection, reaction"),
        ({"detection": "1 s"}, "a table with `within`"),
        ({"detection": {"share": 0.5}}, "a table with `within`"),
        ({"detection": {"within": "1 s", "shares": 0.5}}, "unknown key 'shares'"),
        *(({"detection": {"within": "1 s", "share": wrong}}, f"share {wrong!r}") for wrong in (0.0, 1.0, True, "1")),
        *(({"detection": {"within": "1 s", "confidence": wrong}}, f"confidence {wrong!r}") for wrong in (0, 1, -0.5)),
    ],
)
def test_a_tolerance_that_is_none_is_refused(data, reported):
    refused(reported, lambda: list(plan.tolerances_of({"tolerance": data}, PATH)))


# ---- samples and searches


def test_a_sample_is_taken_whole():
    assert plan.sample_of({}, PATH) is None
    assert plan.sample_of({"sample": {"runs": 1}}, PATH) == Sample(1, 1, "clopper-pearson", 0.95, None)
    whole = {"runs": 1_000_000, "seed": -(2**63), "interval": "wilson", "confidence": 0.5}
    assert plan.sample_of({"sample": whole}, PATH) == Sample(1_000_000, -(2**63), "wilson", 0.5, None)
    stop = {"outcome": "masked", "limit": 0.25}
    assert plan.sample_of({"sample": {"runs": 60, "confidence": 0.9, "stop": stop}}, PATH) == Sample(
        60, 1, "clopper-pearson", 0.9, Stopping("masked", 0.25, 60, 5, "obrien-fleming", 0.9)
    )
    stop = {"outcome": "fall", "limit": 0.25, "looks": 50, "rule": "pocock"}
    found = plan.sample_of({"sample": {"runs": 60, "seed": 2**63, "stop": stop}}, PATH)
    assert found == Sample(60, 2**63, "clopper-pearson", 0.95, Stopping("fall", 0.25, 60, 50, "pocock", 0.95))


STOP = {"outcome": "fall", "limit": 0.25}


@pytest.mark.parametrize(
    ("data", "reported"),
    [
        ({}, "runs = None: a whole number from 1 to 1000000"),
        ({"runs": 0}, "runs = 0"),
        ({"runs": 1_000_001}, "runs = 1000001"),
        ({"runs": True}, "runs = True"),
        ({"runs": 5, "size": 5}, "unknown key 'size'"),
        ({"runs": 5, "seed": 2**63 + 1}, "seed = "),
        ({"runs": 5, "seed": -(2**63) - 1}, "seed = "),
        ({"runs": 5, "interval": "wald"}, "interval = 'wald'"),
        ({"runs": 5, "interval": 3}, "interval = 3"),
        ({"runs": 5, "confidence": 0.49}, "confidence = 0.49: from 0.5"),
        ({"runs": 5, "confidence": 1.0}, "confidence = 1.0"),
        ({"runs": 5, "confidence": 1}, "confidence = 1:"),
        ({"runs": 5, "stop": 3}, "stop = 3: a table"),
        ({"runs": 5, "stop": {**STOP, "look": 2}}, "unknown key 'look'"),
        ({"runs": 5, "stop": {"limit": 0.25}}, "outcome = None"),
        ({"runs": 5, "stop": {**STOP, "limit": True}}, "limit = True"),
        ({"runs": 5, "stop": {**STOP, "rule": 3}}, "rule = 3"),
        ({"runs": 5, "stop": {**STOP, "rule": "wald"}}, "[sample] stop: stopping rule 'wald'"),
        ({"runs": 5, "stop": {**STOP, "limit": 1.0}}, "limit is 1.0, allowed is above 0"),
        ({"runs": 5, "stop": {**STOP, "limit": 0}}, "limit is 0, allowed is above 0"),
        ({"runs": 60, "stop": {**STOP, "looks": 0}}, "looks = 0: a whole number from 1 to 50"),
        ({"runs": 60, "stop": {**STOP, "looks": 51}}, "looks = 51"),
        ({"runs": 5, "stop": {**STOP, "looks": 6}}, "6 looks at 5 runs"),
    ],
)
def test_a_sample_that_is_none_is_refused(data, reported):
    refused(reported, plan.sample_of, {"sample": data}, PATH)


def test_a_search_is_taken_whole():
    assert plan.search_of({}, PATH) is None
    assert plan.search_of({"search": {}}, PATH) == Search(12, 4, 6, 1, None, "fall")
    data = {"first": 1, "rounds": 0, "each": 1, "seed": 7, "least": "force", "outcome": "damage"}
    assert plan.search_of({"search": data}, PATH) == Search(1, 0, 1, 7, "force", "damage")
    most = {"first": 100_000, "rounds": 1000, "each": 100_000, "seed": 2**63}
    assert plan.search_of({"search": most}, PATH) == Search(100_000, 1000, 100_000, 2**63, None, "fall")
    for name, wrong in (
        *(("first", each) for each in (0, 100_001)),
        *(("rounds", each) for each in (-1, 1001)),
        *(("each", each) for each in (0, 100_001, 2.0)),
        ("seed", -(2**63) - 1),
        ("seed", 2**63 + 1),
    ):
        refused(f"[search]: {name} = {wrong}: a whole number", plan.search_of, {"search": {name: wrong}}, PATH)
    refused("outcome = 'falls'", plan.search_of, {"search": {"least": "x", "outcome": "falls"}}, PATH)
    refused("least = 3: the name of a range", plan.search_of, {"search": {"least": 3}}, PATH)
    refused("it needs `least`", plan.search_of, {"search": {"outcome": "fall"}}, PATH)
    refused("unknown key 'last'", plan.search_of, {"search": {"last": 3}}, PATH)


def test_a_run_comes_to_the_outcome_that_is_looked_for_and_a_fall_after_damage_is_one():
    fall, damage = Search(), Search(outcome="damage")
    runs = [
        None,
        {"outcome": "fall", "fall_ms": 3.0},
        {"outcome": "damage", "fall_ms": 3.0},
        {"outcome": "damage"},
        {"outcome": "masked", "fall_ms": None},
    ]
    assert [fall.hits(each) for each in runs] == [False, True, True, False, False]
    assert [damage.hits(each) for each in runs] == [False, False, True, True, False]
    least = Search(least="force")
    assert least.badness(0.25, runs[1]) == (1.0, -0.25) and least.badness(0.25, runs[4]) == (0.0, 1.0)
    assert fall.badness(0.25, {"outcome": "fall"}) == (0.0, 4.0) and least.badness(0.25, None) == (0.0, -1.0)


# ---- the whole plan


def test_a_small_file_is_this_plan():
    data = {
        "title": "T",
        "description": "D",
        "walk": {"slope": "0.01 rad"},
        "healthy": {"seeds": [3, 4]},
        "vary": {"force": [1, 2], "seed": 5},
        "faults": [{"places": "world.robot", "modes": "push", "values": {"force": "{force}"}, "period": "1 s"}],
        "tolerance": {"reaction": {"within": "20 ms"}},
    }
    found = plan.of_data(data, "folder/name.toml", REFERENCE)
    assert found == Plan(
        path="folder/name.toml",
        title="T",
        description="D",
        walk={"slope_rad": 0.01},
        watch=Watch(),
        healthy_seeds=(3, 4),
        axes={"force": [1, 2], "seed": [5], "fault": ["world.robot:push,force={force}@1 s"]},
        tolerances=(Tolerance("reaction", 20.0),),
        machine=REFERENCE,
    )
    assert (found.name, found.design) == ("name", "census")
    assert found.population() == "2 of force; seed 5; fault world.robot:push,force={force}@1 s"
    key = {"after_s": 7.0, "from_s": 5.0, "patience_s": 30.0, "healthy_seeds": [3, 4]}
    key["band"] = {"step_length": 0.15, "step_time": 0.15, "motor_power": 0.3}
    assert found.watch_key() == key
    first, second = found.cases()
    assert (first.fault, second.fault) == ("world.robot:push,force=1@1 s", "world.robot:push,force=2@1 s")
    assert first.settings == second.settings == Settings({"slope_rad": 0.01, "seed": 5}, machine=REFERENCE)
    assert first.reference is None and first.axes["force"] == 1
    plain = plan.of_data({}, "folder/name.toml", REFERENCE)
    assert (plain.title, plain.description, plain.healthy_seeds) == ("name", "", (1, 2, 3, 4, 5, 6))
    assert plain.population() == "one walk"
    [case] = plain.cases()
    assert (case.settings, case.reference, case.fault) == (
        Settings({"seed": 1}, machine=REFERENCE),
        Settings({"seed": 1}, machine=REFERENCE),
        None,
    )


def test_a_sample_and_a_search_represent_their_ranges():
    ranges = {"force": {"low": 1.0, "high": 2.0}, "start": ["1 s"], "fault": ["world.robot:push,force={force}@{start}"]}
    sample = plan.of_data({"vary": ranges, "sample": {"runs": 3}}, PATH, REFERENCE)
    search = plan.of_data({"vary": ranges, "search": {"least": "force"}}, PATH, REFERENCE)
    assert (sample.design, search.design) == ("sample", "search")
    reported = "force from 1 to 2; start 1 s; fault world.robot:push,force={force}@{start}"
    assert sample.population() == search.population() == reported
    assert len(sample.cases()) == 3


@pytest.mark.parametrize(
    ("data", "reported"),
    [
        ({"sample": {"runs": 1}, "search": {}}, "one of them, or neither"),
        ({"vary": {"seed": list(range(1001)), "battery": [0.5] * 1000}}, "1001000 runs, allowed are 1 to 1000000"),
        ({"healthy": {"seeds": [1, 1]}}, "two or more whole numbers"),
        ({"healthy": {"seeds": [1, True]}}, "two or more whole numbers"),
        ({"healthy": {"seeds": 2}}, "two or more whole numbers"),
        ({"healthy": {"seed": [1, 2]}}, "unknown key 'seed'"),
        ({"walk": {"steps": 3}}, "[walk]: unknown key 'steps'"),
        ({"walk": 3}, "walk = 3: a table is expected"),
        ({"title": 3}, "title = 3: text is expected"),
        ({"faults": {"places": "*"}}, "tables [[faults]] are expected"),
        ({"vary": {"fault": ["a:b"]}, "faults": [{"places": "UI.imu"}]}, "[vary] fault and [[faults]]: one of them"),
        ({"fault_module": ""}, "relative to the plan"),
        ({"walk": {}, "machine": {"make": "x.py:y"}}, "[walk] and [machine]: one of them"),
        ({"machine": {}}, "make = None: FILE.py:NAME"),
        ({"machine": {"make": 3}}, "make = 3: FILE.py:NAME"),
        ({"machine": {"make": "none.py:new"}}, "there is no file"),
    ],
)
def test_a_file_that_is_not_a_plan_is_refused(data, reported):
    refused(reported, plan.of_data, data, PATH, REFERENCE)
