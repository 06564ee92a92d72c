"""The schema of summary.json: complete, in one table with the documents, and fulfilled by the summaries of walks."""

import contextlib
import copy
import json

import pytest

from ranger_sim.ranger.records.summary_schema import FIGURES, json_schema
from ranger_sim.ranger.robot import Ranger
from ranger_sim.tools.cli import main
from ranger_sim.tools.run import summary_schema

KINDS = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "integer": int,
    "number": (int, float),
    "null": type(None),
}
KNOWN_WORDS = {
    "$schema", "title", "type", "properties", "required", "additionalProperties", "items", "minimum", "description",
    "unit",
}  # fmt: skip


def violations(value, schema, path="summary"):
    """What in `value` is not as the schema has it; of JSON Schema as much as ours uses, written after the standard."""
    assert set(schema) <= KNOWN_WORDS, f"{path}: this validator does not know {set(schema) - KNOWN_WORDS}"
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    fits = [kind for kind in kinds if isinstance(value, KINDS[kind])]
    if isinstance(value, bool):
        fits = [kind for kind in fits if kind == "boolean"]  # to Python they are numbers as well
    if not fits:
        return [f"{path} is {value!r}, not of type {' or '.join(kinds)}"]
    if "minimum" in schema and value is not None and value < schema["minimum"]:
        return [f"{path} is {value!r}, below {schema['minimum']}"]
    if isinstance(value, list):
        return [each for i, item in enumerate(value) for each in violations(item, schema["items"], f"{path}[{i}]")]
    if not isinstance(value, dict) or "properties" not in schema:
        return []
    found = [f"{path}.{key} is missing" for key in schema["required"] if key not in value]
    for key, inner in value.items():
        of_key = schema["properties"].get(key, schema["additionalProperties"])
        found += violations(inner, of_key, f"{path}.{key}") if of_key else [f"{path}.{key} is not in the schema"]
    return found


@pytest.fixture(scope="module")
def summary():
    """Of a robot that was never let go, with a fault, as `walk` writes it."""
    with contextlib.closing(Ranger()) as robot:
        robot.inject("MCH.joint_encoder", "stuck", at="9 s")
        robot.run_for(0.01)
        of_walk = {"interrupted": False, "command": "", "complete": True, "files": {"can1.log": "complete"}}
        return json.loads(json.dumps({**robot.summary(), **of_walk}))


def test_a_summary_is_as_the_schema_has_it(summary):
    assert violations(summary, json_schema()) == []


@pytest.mark.parametrize(
    ("spoil", "reported"),
    [
        (lambda s: s.pop("tcot"), "summary.tcot is missing"),
        (lambda s: s["can"]["can2"].pop("lost"), "summary.can.can2.lost is missing"),
        (lambda s: s.update(mean_step_length=0.35), "summary.mean_step_length is not in the schema"),
        (lambda s: s.update(steps=True), "summary.steps is True, not of type integer"),
        (lambda s: s.update(fell=0), "summary.fell is 0, not of type boolean"),
        (lambda s: s.update(distance_m=None), "summary.distance_m is None, not of type number"),
        (lambda s: s["slots"]["MB"].update(count=-1), "summary.slots.MB.count is -1, below 0"),
        (lambda s: s["failed_boards"].append(3), "summary.failed_boards[0] is 3, not of type string"),
        (lambda s: s["faults"][0].pop("acted"), "summary.faults[0].acted is missing"),
    ],
)
def test_a_summary_that_is_wrong_is_found_out(summary, spoil, reported):
    wrong = copy.deepcopy(summary)
    spoil(wrong)
    assert violations(wrong, json_schema()) == [reported]


def test_every_figure_has_a_meaning_and_every_number_a_unit():
    assert len({figure.place for figure in FIGURES}) == len(FIGURES)
    units = {"_m": "m", "_s": "s", "_h": "h", "_W": "W", "_Wh": "Wh", "_V": "V", "_N": "N", "_Ns": "N s", "_us": "us"}
    units |= {"_rad": "rad", "_ms": "ms", "_m_per_s": "m/s"}
    for figure in FIGURES:
        assert figure.meaning, figure.place
        if figure.kind == "number" and figure.place != "faults[].largest_difference":
            assert figure.unit, figure.place
        for key in figure.place.split("."):  # a unit in a name is the unit
            ending = max((each for each in units if key.endswith(each)), key=len, default=None)
            if ending and figure.kind == "number":
                assert figure.unit == units[ending], figure.place


def test_the_page_has_the_table_of_the_program():
    document = summary_schema.DOCUMENT.read_text(encoding="utf-8")
    assert summary_schema.with_table(document) == document, (
        "write it anew: python -m ranger_sim.tools.run.summary_schema"
    )


def test_the_command_prints_the_schema(capsys):
    assert main(["summary-schema"]) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported == json_schema()
    assert reported["properties"]["battery"]["properties"]["delivered_Wh"]["unit"] == "Wh"
    assert reported["properties"]["tcot"]["type"] == ["number", "null"]
    assert "additionalProperties" in reported["properties"]["errors"]
