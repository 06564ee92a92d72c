"""What the summary says of contact, against what an observer of every step counts by himself."""

import math

import pytest

from ranger_sim.plant.mechanics import walk_record
from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, SINGLE, Body
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.ranger.records.summary import oddities
from ranger_sim.tools.report.page import contact
from tests.plant.walking.small_controllers import STEP_S, PaperGait, Walker, mid_stance_start


class Observer:
    """Walks the body and keeps, of every step, mode, standing legs' forces and the feet on the floor."""

    def __init__(self, contact, monkeypatch, steps=10, mu=0.9):
        self.impulses, self.touches = [], 0
        original = walk_record.WalkRecord.touch

        def touch(record, time_ns, leg, strike, ahead, x, foot, impulses, *rest):
            self.touches += 1
            if strike:
                self.impulses.append(impulses[1])
            original(record, time_ns, leg, strike, ahead, x, foot, impulses, *rest)

        monkeypatch.setattr(walk_record.WalkRecord, "touch", touch)
        self.body = body = Body(BodyParameters(contact=contact, floor_friction=mu))
        mid_stance_start(body)
        walker = Walker(body, PaperGait())
        self.rows = []
        while body.record.steps < steps and body.mode != FALLEN:
            walker.run(steps, walker.seconds + 0.5 * STEP_S)
            standing = [body.stance] if body.mode == SINGLE else []
            if body.mode == DOUBLE:
                standing = [body.outer, body.inner]
            self.rows.append([(leg.Fx, leg.Fy, leg.slide) for leg in standing])
        self.forces = [force for row in self.rows for force in row]


class Seen:
    """As much of a plant as `oddities` looks at."""

    def __init__(self, body):
        self.body, self.record, self.parameters = body, body.record, body.parameters


def test_pulls_of_the_sticking_contact_are_counted_as_an_observer_counts_them(monkeypatch):
    seen = Observer("sticking", monkeypatch)
    figures = oddities(Seen(seen.body))
    pulls = [impulse for impulse in seen.impulses if impulse < 0.0]
    assert figures["contact"] == "sticking"
    assert figures["tensile_strikes"] == len(pulls) >= 8
    assert figures["tensile_impulse_min_Ns"] == min(pulls) < -0.2
    assert figures["normal_force_min_N"] == min(Fy for _, Fy, _ in seen.forces)
    assert figures["friction_ratio_max"] == pytest.approx(max(abs(Fx) / Fy for Fx, Fy, _ in seen.forces if Fy > 5.0))
    assert figures["touches"] == seen.touches
    # a foot leaves between two touches of its own; one stands at the start, both at the end
    assert figures["lift_offs"] == seen.touches - (seen.body.mode == DOUBLE)


def test_asking_for_more_than_friction_is_timed_as_an_observer_times_it(monkeypatch):
    seen = Observer("sticking", monkeypatch, mu=0.25)
    beyond = sum(any(Fy > 5.0 and abs(Fx) > 0.25 * Fy for Fx, Fy, _ in row) for row in seen.rows)
    assert oddities(Seen(seen.body))["slip_s"] == pytest.approx(beyond * STEP_S) and beyond > 10


def test_slides_of_the_default_contact_are_counted_and_timed(monkeypatch):
    seen = Observer("coulomb", monkeypatch, mu=0.4)
    figures = oddities(Seen(seen.body))
    sliding = [any(slide for _, _, slide in row) for row in seen.rows]
    begins = sum(now and not before for before, now in zip([False, *sliding], sliding, strict=False))
    assert figures["slip_s"] == pytest.approx(sum(sliding) * STEP_S)
    # slides that begin and end inside one step are seen by the body alone
    assert figures["slides"] >= begins >= 1
    assert figures["tensile_strikes"] == 0 and figures["tensile_impulse_min_Ns"] == 0.0
    assert figures["normal_force_min_N"] >= -1e-9
    assert figures["friction_ratio_max"] == pytest.approx(0.4)


def test_what_was_not_measured_is_null():
    figures = oddities(RangerPlant())
    names = ("tensile_strikes", "tensile_impulse_min_Ns", "friction_ratio_max", "normal_force_min_N", "min_clearance_m")
    assert [figures[name] for name in names] == [None] * 5
    values = {tile["name"]: tile["value"] for tile in contact(figures)}
    assert values["strikes that pull"] == values["lowest push of the floor"] == "none"
    assert not any(isinstance(value, float) and math.isinf(value) for value in figures.values())


def test_the_report_has_the_same_pulls_as_the_summary():
    figures = oddities(RangerPlant()) | {"tensile_strikes": 3, "tensile_impulse_min_Ns": -0.456, "slides": 2}
    values = {tile["name"]: tile["value"] for tile in contact(figures | {"slip_s": 0.013, "normal_force_min_N": -7.25})}
    assert values["strikes that pull"] == "3 (to -0.46 N s)"
    assert values["lowest push of the floor"] == "-7.2 N"
    assert values["slides"] == "2 in 13 ms"


def test_a_strike_that_would_pull_lets_the_trailing_foot_go_by_the_unilateral_rule(monkeypatch):
    seen = Observer("unilateral", monkeypatch, steps=6)
    figures = oddities(Seen(seen.body))
    # every strike of this gait pulls by the sticking rule (the first test): here none does, and none is on both feet
    assert seen.impulses == [0.0] * len(seen.impulses) and len(seen.impulses) >= 2
    assert figures["tensile_strikes"] == 0 and figures["tensile_impulse_min_Ns"] == 0.0
    assert seen.body.mode != DOUBLE and all(len(row) <= 1 for row in seen.rows)
