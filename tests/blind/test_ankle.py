"""The ankle's generator: its motion against the linear system's closed form, its effects, its two kinds of log."""

import json

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant import body_files
from tests.blind import generate
from tests.blind.generator.ankle import ANKLE, NUDGE, Ankle, Run
from tests.blind.generator.case import Case
from tests.blind.generator.hanging_foot import BOARD, CURRENT_LAG_S, DT_S, ROW_S, TARGET, Drive, Lane, run

SHORT = ANKLE.lasting(1.2)


def test_without_friction_the_foot_follows_the_frequency_response_of_the_linear_system():
    """Two inertias, a cable, a spring, a law on the motor's angle; delays of target, board and current as factors.

    The held target is half an interval older, and so is what the board has seen; 1 % of 0.3 rad: what is left is of
    second order in 0.5 ms times 2 pi 3 Hz, and the board's own rate is not delayed by a count.
    """
    base = ANKLE.NOMINAL | ANKLE.FIXED | {"C0": 0.0, "C1": 0.0, "mu": 0.0}
    drive = Drive(1.3, 0.3, 3.0, 0.4, 12.0, 1.6)
    rows = 250  # three periods
    out = run([Lane(base, drive, {})], rows, 500, counted=False)
    time_s = np.arange(1, rows + 1) * ROW_S
    w = 2.0 * np.pi * drive.hertz
    late = np.exp(-1j * w * (TARGET + 0.5 * TARGET) * DT_S)
    board = np.exp(-1j * w * 0.5 * BOARD * DT_S) / (1.0 + 1j * w * CURRENT_LAG_S)
    law = drive.stiffness_A_per_rad + 1j * w * drive.damping_As_per_rad
    stiff = base["k_s"] + 1j * w * base["d"]
    system = np.array(
        [
            [-base["J_m"] * w * w + stiff + base["GK"] * law * board, -stiff],
            [-stiff, -base["J_f"] * w * w + stiff + base["k_r"]],
        ]
    )
    pushed = base["GK"] * law * late * board * drive.amplitude_rad * np.exp(1j * drive.phase_rad)
    _, joint = np.linalg.solve(system, [pushed, 0.0])
    swing = out["q"][:, 0] - np.mean(out["q"][:, 0])
    assert swing == pytest.approx((joint * np.exp(1j * w * time_s)).imag, abs=0.003)


def test_the_foot_stands_inside_its_friction():
    """Asked for an angle that is less than its friction away, the motor does not move: 0.02 rad x 12 A/rad x 0.612."""
    base = ANKLE.NOMINAL | ANKLE.FIXED | {"C0": 0.5}
    lanes = [Lane(base, Drive(1.3, 0.02, 1.0, 0.0, 12.0, 1.6), {})]
    out = run(lanes, 100, 250)
    assert np.ptp(out["p"]) == 0.0


def test_the_logged_target_is_the_one_in_force():
    """The law on the logged columns gives the logged current. Targets late by a row of 4 ms would miss it by 0.2 A rms,
    K times the target's rate; 0.05 A: noise of 0.03 A, the motor's rate by its counts, 0.5 ms."""
    case = clean("foot")
    case.instruments["noise"] = dict.fromkeys(ANKLE.NOISE, 0.0) | {"I": 0.03}
    (seen,) = SHORT.simulate([(case, case.runs[0], case.base, [])], counted=True)
    found = SHORT.log(generator(1, "log"), case, case.runs[0], seen)
    p = found["motor_angle_rad"]
    u = np.gradient(p, ROW_S)
    law = 12.0 * (found["target_angle_rad"] - p) + 1.6 * (found["target_rate_rad_per_s"] - u)
    rows = np.flatnonzero(np.isfinite(found["current_A"]))[1:-1]
    assert np.std(law[rows] - found["current_A"][rows]) < 0.05


def clean(kind, name=None):
    """A case at the nominal base with an effect at its start."""
    case = Case(0, "single", base=ANKLE.NOMINAL | ANKLE.FIXED)
    drive = Drive(1.3, 0.9, 1.2, 0.3, 12.0, 1.6)
    case.runs = [Run(each, kind, drive, 1.2) for each in "ab"]
    case.instruments = {"noise": ANKLE.NOISE, "memory": 0.9}
    if name:
        effect = ANKLE.EFFECTS[name]
        case.effects = [(name, 4.0)]
        case.shapes = [effect.draw(generator(1, name), case.runs[0])]
        case.amplitudes = [effect.start]
    return case


def test_every_effect_leaves_a_trace_that_no_base_parameter_takes_up():
    """2 % of what it does or more; what is only a shift of a parameter leaves half of that at most (below)."""
    cases = [clean("foot", name) for name in ANKLE.EFFECTS]
    tangent = SHORT.tangents(cases[:1])[0]
    vectors = SHORT.vectors([(case, case.runs[0], case.base, SHORT.acting(case)) for case in cases])
    for case, vector in zip(cases, vectors, strict=True):
        whole = np.linalg.norm(vector - tangent[0])
        left = np.linalg.norm(SHORT.outside(vector, tangent))
        assert left > max(0.02 * whole, 1.0), case.effects[0][0]


def test_a_shift_of_a_base_parameter_leaves_nothing():
    """Half the nudge that the tangent is made of, and 1 % of what that does at most: it is straight to first order.

    0.1: of one deviation of the noise, in all values together, where a parameter hardly matters.
    """
    case = clean("foot")
    tangent = SHORT.tangents([case])[0]
    half = {name: case.base | {name: case.base[name] * (1.0 + 0.5 * NUDGE)} for name in ANKLE.NOMINAL}
    vectors = SHORT.vectors([(case, case.runs[0], base, []) for base in half.values()])
    for name, vector in zip(half, vectors, strict=True):
        left = np.linalg.norm(SHORT.outside(vector, tangent))
        assert left <= 0.01 * np.linalg.norm(vector - tangent[0]) + 0.1, name


def test_logs_are_as_the_robot_s_and_carry_no_label(tmp_path, monkeypatch, capsys):
    """Both kinds; the same seed gives the same files."""
    monkeypatch.setattr(Ankle, "SAMPLES", 300)
    asked = ["--experiment", "ankle", "--count", "4", "--kinds", "null", "--seed", "2"]
    for folder in ("one", "two"):
        generate.main([*asked, "--out", str(tmp_path / folder)])
    cases = json.loads((tmp_path / "one/data/cases.json").read_text())
    kinds = set()
    for case in cases:
        truth = json.loads((tmp_path / "one/truth" / f"{case['id']}.json").read_text())
        kinds.add(truth["log"])
        for name in case["files"] + case["holdout"]:
            text = (tmp_path / "one/data" / name).read_text()
            assert text == (tmp_path / "two/data" / name).read_text()
            head, *rows = text.splitlines()
            assert len(rows) == 300
            if truth["log"] == "sine":
                assert head == (
                    "t_s,joint_angle_rad,target_angle_rad,target_rate_rad_per_s,command_current_A,"
                    "command_stiffness_A_per_rad,command_dampness_A_s_per_rad"
                )
                assert all(cell for row in rows for cell in row.split(","))
            else:
                currents = [row.split(",")[-1] for row in rows]
                assert sum(map(bool, currents)) == 24  # every thirteenth
    assert kinds == {"sine", "foot"}


def test_the_base_parameters_are_those_of_the_body_that_was_identified_by_the_robot_s_logs():
    """The generator imports no plant; this test may. Its nominal ankle is that of plant/bodies/ranger.toml."""
    body, motor = body_files.load("ranger").parameters, body_files.load("ranger").electrics.inner_ankle
    known = {
        "J_f": body.foot_inertia_kg_m2,
        "k_r": body.ankle_return_Nm_per_rad,
        "q_0": body.ankle_return_rest_rad,
        "k_s": body.ankle_spring_Nm_per_rad,
        "C0": motor.constant_friction_Nm,
        "C1": motor.viscous_friction_Nms,
        "mu": motor.load_friction,
        "GK": motor.gear * motor.torque_constant_Nm_per_A,
    }
    assert {name: ANKLE.NOMINAL[name] for name in known} == pytest.approx(known)
    assert ANKLE.FIXED["J_m"] == pytest.approx(motor.reflected_inertia_kg_m2)
