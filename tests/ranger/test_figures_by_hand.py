"""Every figure of a walk's summary, computed from a robot made by hand."""

from types import SimpleNamespace as Made

import pytest

from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.ranger.records import summary

S = 1_000_000_000


def motor(name, drawn_J, before_J):
    return Made(name=name, drawn_J=drawn_J, drawn_before_J=before_J)


def counters(errors=()):
    totals = [0] * (max(error_table.NAMES) + 1)
    for code, count in errors:
        totals[code] = count
    slots = Made(count=1000, overruns=2, max_cycles=27_000, slot_ns=500_000, finished_ns=60 * S)
    return Made(errors=totals, slots=slots, hz=60_000_000, can=[])


def robot(walked_s=40.0, cpu_s=8.0, steps=20, length_sum=7.0, time_sum_s=10.0):
    record = Made(
        begin_ns=20 * S,
        steps=steps,
        length_sum=length_sum,
        time_sum_s=time_sum_s,
        touches=0,
        lift_offs=0,
        bounces=0,
        recontacts=0,
        scuffs=0,
        flights=0,
        slides=0,
        jams=0,
        lead_lifts=0,
        tensile_strikes=0,
        tensile_impulse_min_Ns=0.0,
        min_clearance_m=0.0,
        mean_step_length_m=lambda: 0.35,
        step_length_deviation_m=lambda: 0.01,
        mean_step_time_s=lambda: 0.5,
        step_time_deviation_s=lambda: 0.02,
        mean_double_stance_s=lambda: 0.03,
    )
    battery = Made(parameters=Made(charge=0.9), charge=0.8, delivered_J=1.0, lost_J=1.0, cut_off=False)
    plant = Made(
        record=record,
        time_ns=round((20 + walked_s) * S),
        motors=[motor("hip", 500.0, 100.0), motor("outer", 90.0, 10.0)],
        electronics_power_W=5.0,
        parameters=Made(total_mass_kg=10.0, gravity_m_per_s2=9.8, contact="rigid"),
        steps=steps,
        fell=0,
        fall_cause="",
        distance_m=7.5,
        battery_V=25.0,
        electrics=Made(battery=battery),
        body=Made(compliant=False, seen=Made(friction_ratio_max=0.0, slip_s=0.0, normal_force_min=1.0, pull_s=0.0)),
    )
    scenario = Made(
        battery_capacity_Wh=493.0,
        controller="c",
        body="b",
        model_file=None,
        seed=3,
        slope_rad=0.1,
        floor_roughness_m=0.0,
        electronics_off=("MCSI",),
    )
    made = Made(
        deaths=[],
        images={},
        plant=plant,
        scenario=scenario,
        time_s=60.0,
        walked_s=walked_s,
        cpu_s=cpu_s,
        start_ns=0,
        profile=None,
        buses=[],
        faults=[Made(summary=lambda: {"fault": "x"})],
        firmware={},
        realtime_factor=lambda: 7.0,
        trace_digest=lambda: "abc",
        counters=lambda: {"MCH": counters([(error_table.AE_SPIKE, 3)]), "MB": counters()},
        loop=Made(time=60 * S, board=lambda name: None, strikes=Made(statistics=lambda: {"mean": 14.0})),
    )
    return made


def test_powers_are_what_was_drawn_since_the_robot_was_let_go_over_that_time():
    assert summary.motor_powers(robot()) == {"hip": 400.0 / 40.0, "outer": 80.0 / 40.0}
    assert summary.motor_powers(robot(walked_s=0.0)) == {"hip": None, "outer": None}
    assert summary.motor_powers(robot(walked_s=0.5))["hip"] == pytest.approx(800.0)


def test_energies_are_in_watt_hours_and_add_up():
    found = summary.energy(robot())
    assert found == pytest.approx(
        {"hip": 1 / 9, "outer": 1 / 45, "electronics": 1 / 18, "total": 1 / 9 + 1 / 45 + 1 / 18}
    )


def test_slots_are_in_microseconds_and_errors_have_their_names():
    assert summary.slots(counters()) == {"count": 1000, "overruns": 2, "max_execution_us": 450.0, "budget_us": 500.0}
    assert summary.errors(counters([(error_table.AE_SPIKE, 3), (error_table.MC_PWM_LIMIT, 1)])) == {
        "AE_SPIKE": 3,
        "MC_PWM_LIMIT": 1,
    }


def test_the_whole_summary_is_of_these_figures():
    reported = summary.of(robot())
    expected = {
        "steps": 20,
        "fell": False,
        "fall_cause": None,
        "failed_boards": [],
        "distance_m": 7.5,
        "time_s": 60.0,
        "walked_h": 40.0 / 3600.0,
        "mean_step_length_m": 0.35,
        "std_step_length_m": 0.01,
        "mean_step_time_s": 0.5,
        "std_step_time_s": 0.02,
        "double_stance_s": 0.03,
        "speed_m_per_s": 0.7,
        "motor_power_W": 12.0,
        "electronics_power_W": 5.0,
        "total_power_W": 17.0,
        "tcot": 17.0 / (98.0 * 0.7),
        "battery_V": 25.0,
        "heel_strike_delay_ms": {"mean": 14.0},
        "realtime_factor": 7.0,
        "cpu_factor": 7.5,
        "profile": None,
        "seed": 3,
        "electronics_off": ["MCSI"],
        "faults": [{"fault": "x"}],
        "trace_digest": "abc",
        "can": {},
        "firmware": {},
        "controller": "c",
        "body": "b",
        "slope_rad": 0.1,
    }
    for name, value in expected.items():
        assert reported[name] == (pytest.approx(value) if type(value) is float else value), name
    assert reported["errors"] == {"MCH": {"AE_SPIKE": 3}, "MB": {}} and reported["slots"]["MB"]["overruns"] == 2


def test_what_needs_time_or_steps_is_none_without_them():
    reported = summary.of(robot(walked_s=0.0, cpu_s=0.0, time_sum_s=0.0))
    nothing = ("speed_m_per_s", "motor_power_W", "total_power_W", "tcot", "cpu_factor")
    assert [reported[name] for name in nothing] == [None] * 5
    standing = summary.of(robot(length_sum=0.0))
    assert (standing["speed_m_per_s"], standing["tcot"], standing["total_power_W"]) == (0.0, None, 17.0)
    fallen = robot()
    fallen.plant.fell, fallen.plant.fall_cause, fallen.loop.time = 1, "forward", 61 * S
    reported = summary.of(fallen)
    assert (reported["fell"], reported["fall_cause"], reported["failed_boards"]) == (True, "forward", ["MCH", "MB"])


def test_a_program_in_c_is_reported_with_its_end_and_the_lines_that_ran():
    sides = {"lines": 10, "covered": 7, "branches": 4, "taken": 1}
    made = Made(
        manifest=Made(name="p"),
        folder="f",
        coverage=True,
        findings=list,
        ran=lambda: [
            Made(figures=lambda folder: {"file": "a", **sides}),
            Made(figures=lambda folder: {"file": "b", **sides}),
        ],
    )
    written = []
    board = Made(out_of_process=False, write_counts=lambda: written.append(1))
    programs = Made(lacks=lambda name: ("a",) if board.out_of_process else None)
    loop = Made(board=lambda name: board)
    whole = Made(firmware={"MCH": made, "MCFO": made}, deaths=[], loop=loop, programs_in_c=programs)
    reported = summary.firmware(whole, "MCH")
    assert reported["confined"] == "no"
    assert (reported["name"], reported["folder"], reported["own_process"], reported["lost_s"], reported["why"]) == (
        "p",
        "f",
        False,
        None,
        None,
    )
    assert {name: reported["coverage"][name] for name in (*sides, "whole")} == {
        "lines": 20,
        "covered": 14,
        "branches": 8,
        "taken": 2,
        "whole": True,
    }
    assert [each["file"] for each in reported["coverage"]["files"]] == ["a", "b"] and written == [1]
    board.out_of_process = True
    for why, whole_count in (("", False), ("it divided by 0", True)):
        whole.deaths = [{"board": "MCFO", "time_s": 1.0, "why": "x"}, {"board": "MCH", "time_s": 2.0, "why": why}]
        reported = summary.firmware(whole, "MCH")
        assert (reported["own_process"], reported["lost_s"], reported["why"]) == (True, 2.0, why or None)
        assert reported["confined"] == "partly (a)"
        assert reported["coverage"]["whole"] is whole_count
    assert written == [1]
    made.coverage = False
    assert summary.ran(made, True)["lines"] is None and summary.ran(made, True)["whole"] is None
    made.findings = lambda: ["found"]
    assert summary.found_in(whole, "MCH") == ["found"] and summary.found_in(whole, "MCFO") == []
