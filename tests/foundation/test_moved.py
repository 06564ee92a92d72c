"""Names of modules that have moved work for one version, and warn."""

import importlib

import pytest

MOVED = (
    ("ranger", "Ranger", "robot"),
    ("scenario", "Scenario", "scenario"),
    ("conditions", "condition", "conditions"),
    ("firmware.native_boards", "build", "firmware.native_boards"),
    ("testing.robots", "new_robot", "testing.robots"),
    ("testing.bench", "BoardAlone", "testing.bench"),
    ("testing.replay", "read_log", "testing.replay"),
    ("timeline", "Timeline", "timeline"),
)


@pytest.mark.parametrize(("old", "name", "new"), MOVED)
def test_an_old_name_is_the_object_of_the_new_one_and_warns(old, name, new):
    before = importlib.import_module(f"ranger_sim.harness.{old}")
    with pytest.warns(
        DeprecationWarning,
        match=rf"^ranger_sim\.harness\.{old}\.{name} has moved to ranger_sim\.ranger\.{new}\.{name}$",
    ):
        found = getattr(before, name)
    assert found is getattr(importlib.import_module(f"ranger_sim.ranger.{new}"), name)


def test_a_name_that_neither_module_has_is_refused():
    for module in ("ranger_sim.harness.ranger", "ranger_sim.harness.timeline"):
        with pytest.raises(AttributeError, match="has no attribute 'Walker'"):
            _ = importlib.import_module(module).Walker
