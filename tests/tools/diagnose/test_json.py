"""What `--json` writes has the documented keys and kinds, whatever was found; `causes --json` names every cause."""

import json

import pytest

from ranger_sim.sysid import causes
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.cli import main
from tests.sysid.test_diagnose import Cart, cart_run

NUMBER = (int, float)
INTERVAL = "interval"
# {key: kind}; a list with one entry: many of it; a tuple of kinds: any of them
VALUE = {"value": NUMBER, "ci95": INTERVAL}
SCHEMA = {
    "detected": bool,
    "misfit": [
        {"channel": str, "regime": str, "rms": NUMBER, "noise": NUMBER, "repeatable_fraction": NUMBER},
    ],
    "subsystem": (str, type(None)),
    "causes": [
        {"name": str, "balance": str, "parameters": {...: VALUE}, "tied_with": [str], "evidence": {
            "chi2": NUMBER, "p": NUMBER, "bic": NUMBER, "ties": [str], "behind": {...: NUMBER},
            "predicted": (type(None), {"status": str, "ties": [{
                "with": str, "reason": (str, type(None)), "cosine": (float, type(None)), "data": str,
                "behind": (float, type(None))}]}),
        }},
    ],
    "abstained": bool,
    "gain": (type(None), {"fraction_of_achievable": NUMBER, "ci95": INTERVAL, "holdout": str}),
    "next_experiment": [str],
    "model_file": (str, type(None)),
    "data_findings": [
        {"channel": str, "kind": str, "start_s": NUMBER, "end_s": NUMBER, "size": NUMBER, "text": str, "severity": str},
    ],
}  # fmt: skip


def check(value, kind, place="answer"):
    if kind is INTERVAL:
        assert len(value) == 2 and value[0] <= value[1], place
    elif isinstance(kind, dict):
        assert isinstance(value, dict), place
        for key, inner in kind.items():
            for name in value if key is ... else [key]:
                assert name in value, f"{place} has no {name}"
                check(value[name], inner, f"{place}.{name}")
    elif isinstance(kind, list):
        assert isinstance(value, list), place
        for number, each in enumerate(value):
            check(each, kind[0], f"{place}[{number}]")
    elif isinstance(kind, tuple) and any(isinstance(each, dict) for each in kind):
        if value is not None:
            check(value, next(each for each in kind if isinstance(each, dict)), place)
    else:
        assert isinstance(value, kind), f"{place} is {value!r}"
        assert kind is bool or not isinstance(value, bool), place


@pytest.mark.parametrize(
    ("fault", "held", "causes_named", "abstained"),
    [
        ({}, None, 0, False),
        ({"drag": 0.02}, {"drag": 0.02}, 1, False),
        ({"slope": 0.02}, None, 1, False),
        ({"magnet": 0.15}, {"magnet": 0.15}, 0, True),
        ({"drag": 0.02}, {}, 0, True),  # what does not hold out is refused
    ],
)
def test_every_outcome_has_the_documented_keys(fault, held, causes_named, abstained):
    holdout = [] if held is None else [cart_run(2, **held)]
    told = json.loads(json.dumps(diagnose(Cart(), [cart_run(1, **fault)], holdout).answer, allow_nan=False))
    check(told, SCHEMA)
    assert (len(told["causes"]), told["abstained"]) == (causes_named, abstained)
    assert told["detected"] is bool(fault)
    assert (told["gain"] is None) is (held is None or causes_named == 0)  # without a cause there is nothing to gain
    assert (told["subsystem"] is None) is (not fault)
    assert all(each["name"] in {cause.identifier for cause in causes.CAUSES.values()} for each in told["causes"])


def test_the_check_refuses_what_is_not_so():
    """A schema that lets everything pass would prove nothing."""
    told = diagnose(Cart(), [cart_run(1, drag=0.02)]).answer
    for key, wrong in (("detected", 1), ("misfit", {}), ("subsystem", 3), ("causes", [{}]), ("gain", {"ci95": [2, 1]})):
        with pytest.raises(AssertionError):
            check({**told, key: wrong}, SCHEMA)
    with pytest.raises(AssertionError):
        check({key: value for key, value in told.items() if key != "abstained"}, SCHEMA)


def test_causes_as_json_show_identifier_number_and_meaning_of_each(capsys):
    assert main(["causes", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [(each["identifier"], each["number"], each["meaning"]) for each in told] == [
        (cause.identifier, cause.number, cause.meaning) for cause in causes.CAUSES.values()
    ]
    assert {each["number"] for each in told} == set(range(1, 43))
    assert all(each["look_at"].endswith(".") for each in told)
