"""Mistakes of a user: a class for each kind of thing that is wrong, and messages that are safe to print."""

import ast
import inspect
import pathlib

import pytest

import ranger_sim
from ranger_sim import datatable
from ranger_sim.can_bus.edge.external_bus import place_of
from ranger_sim.firmware_sim.lpc2194 import image
from ranger_sim.foundation import user_error
from ranger_sim.foundation.user_error import UserError, raised, unknown
from ranger_sim.harness.campaigns import plan
from ranger_sim.harness.faults.catalogue import Catalogue
from ranger_sim.harness.processes.control import ask
from ranger_sim.plant import body_files
from ranger_sim.sysid.reading import open_recording as read

ROOT = pathlib.Path(__file__).parents[2]
KINDS = {name: kind for name, kind in inspect.getmembers(user_error, inspect.isclass) if UserError in kind.__bases__}


def test_the_tree_has_ten_kinds_directly_below_user_error():
    assert sorted(KINDS) == [
        "BusError", "CampaignError", "DataError", "FaultError", "FirmwareError",
        "ModelError", "ProfileError", "RequestError", "ScenarioError", "TableError",
    ]  # fmt: skip
    assert all(kind.__bases__ == (UserError,) and kind.__doc__ for kind in KINDS.values())
    assert all(getattr(ranger_sim, name) is kind for name, kind in KINDS.items())


MISTAKES = {
    "TableError": lambda: datatable.load("nowhere"),
    "ProfileError": lambda: ranger_sim.load_profile("nowhere"),
    "ScenarioError": lambda: ranger_sim.Scenario(seed=-1),
    "ModelError": lambda: body_files.load("nowhere"),
    "DataError": lambda: read("nowhere.csv"),
    "FaultError": lambda: Catalogue().load_file("nowhere.py"),
    "CampaignError": lambda: plan.of_data({"no_such_key": 1}, "plan.toml"),
    "BusError": lambda: place_of("can1"),
    "FirmwareError": lambda: image.read("nowhere.elf"),
    "RequestError": lambda: ask("nowhere", {"do": "status"}),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_mistake_raises_the_class_of_what_is_wrong(name):
    with pytest.raises(KINDS[name]) as caught:
        MISTAKES[name]()
    assert "nowhere" in str(caught.value) or name in ("ScenarioError", "CampaignError", "BusError")


# Packages whose user mistakes are all of one kind.
OF_A_PACKAGE = {
    "datatable": "TableError",
    "can_bus": "BusError",
    "firmware_sim": "FirmwareError",
    "plant": "ModelError",
    "harness/faults": "FaultError",
    "harness/campaigns": "CampaignError",
    "sysid/readers": "DataError",
}


@pytest.mark.parametrize("package", OF_A_PACKAGE)
def test_a_package_with_a_kind_of_its_own_raises_no_bare_user_error(package):
    found = []
    for path in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "UserError":
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found == []


def test_a_message_is_printable_whatever_it_quotes():
    assert str(UserError("a\x1b[31m", "b\u202e")) == "a\\x1b[31m\nb\\u202e"


def test_an_unknown_name_is_reported_with_all_of_a_few_names_or_the_near_ones_of_many():
    assert unknown("board", "MHC", ["MCH", "MB"]) == "unknown board 'MHC' (available: MCH, MB)"
    assert unknown("pin", "a", []) == "unknown pin 'a' (available: none)"
    many = [f"name_{number}" for number in range(13)]
    assert unknown("name", "nmae_12", many) == "unknown name 'nmae_12'; did you mean 'name_12' or 'name_2'?"
    assert unknown("name", "x", many) == f"unknown name 'x' (available: {', '.join(many)})"
    hundred = [f"name_{number}" for number in range(100)]
    assert unknown("name", "x", hundred) == f"unknown name 'x' (available: {', '.join(hundred)})"
    assert unknown("name", "x", [*hundred, "name_100"]) == "unknown name 'x'"


def test_an_exception_has_the_innermost_place_in_a_file_or_of_all():
    def inner(text):
        ast.literal_eval(text)

    def outer(text):
        inner(text)

    with pytest.raises(ValueError, match="malformed node") as caught:
        outer("f()")
    line = inner.__code__.co_firstlineno + 1
    assert raised(caught.value, __file__).endswith(f" (test_user_error.py:{line})")
    assert "(ast.py:" in raised(caught.value, "nowhere.py")
