"""The tuner: its search by a known valley, its cost by known walks, its file by loading it."""

import pytest
from rich.console import Console

from ranger_sim.boards.main_brain import controllers, programs
from studies.tune import command as tune

BASE = controllers.load("record-2011").values

GOOD = {
    "fell": False,
    "steps": 100,
    "mean_step_length_m": 0.35,
    "mean_step_time_s": 0.60,
    "motor_power_W": 11.3,
    "tcot": 0.28,
    "std_step_length_m": 0.0,
    "heel_strike_delay_ms": {"mean": 14.0},
    "can": {"can1": {"lost": 0}},
    "slots": {"MB": {"overruns": 0}},
}


def valley(changes):
    """Lowest at 2.5 rad/s and with no outer stiffness; every other change costs nothing and gains nothing."""
    rate = changes.get("P_H_PM_H_TRATE", BASE["P_H_PM_H_TRATE"])
    stiffness = changes.get("C_H_OUTER_STIFFNESS", BASE["C_H_OUTER_STIFFNESS"])
    return (rate - 2.5) ** 2 + 0.1 * stiffness**2, 0


def test_the_search_finds_the_bottom_of_a_valley():
    steps = {"P_H_PM_H_TRATE": 0.4, "C_H_OUTER_STIFFNESS": 1.0, "P_F_PP_F_TANG": 0.05}
    changes, cost, falls = tune.search(valley, BASE, {}, steps, rounds=8, worth=0.001)
    assert changes["P_H_PM_H_TRATE"] == pytest.approx(2.5, abs=0.05)
    assert changes["C_H_OUTER_STIFFNESS"] == 0.0
    assert cost < 0.003
    assert falls == 0


def test_a_change_that_gains_nothing_is_not_kept():
    begin = {"P_F_PP_F_TANG": 0.3, "P_H_PM_H_TRATE": 2.5, "C_H_OUTER_STIFFNESS": 0.0}
    changes, _, _ = tune.search(valley, BASE, begin, {"P_F_PP_F_TANG": 0.05}, rounds=1, worth=0.001)
    assert changes == {"P_H_PM_H_TRATE": 2.5, "C_H_OUTER_STIFFNESS": 0.0}


def test_the_push_triggers_of_both_foot_pairs_move_together():
    changes = tune.with_value({}, BASE, "P_FO_PP_THEIGHT", 0.02)
    assert changes == {"P_FO_PP_THEIGHT": 0.02, "P_FI_PP_THEIGHT": 0.02}
    assert tune.with_value(changes, BASE, "P_FO_PP_THEIGHT", BASE["P_FO_PP_THEIGHT"]) == {}


def test_a_pair_that_gains_nothing_is_taken_back_as_a_pair():
    tried = []

    def judge(changes):
        tried.append(set(changes))
        return 0.0, 0

    begin = {"P_FO_PP_THEIGHT": 0.02, "P_FI_PP_THEIGHT": 0.02}
    changes, _, _ = tune.search(judge, BASE, begin, {}, rounds=1, worth=0.001)
    assert changes == {}
    assert all(len(each) in (0, 2) for each in tried)


def test_values_stay_within_the_ranges_of_the_data_table():
    seen = []

    def judge(changes):
        seen.append(changes.get("P_F_FU_H_ANG", BASE["P_F_FU_H_ANG"]))
        return -seen[-1], 0  # the higher the better

    tune.search(judge, BASE, {}, {"P_F_FU_H_ANG": 0.4}, rounds=4, worth=0.001)
    limit = programs.parameter_rows()["P_F_FU_H_ANG"].maximum
    assert max(seen) == limit


def test_a_walk_like_the_robots_costs_nothing_and_each_tolerance_costs_one():
    assert tune.cost_of(GOOD, 100) == 0.0
    for name, (aim, tolerance) in tune.AIMS.items():
        assert tune.cost_of({**GOOD, name: aim + tolerance}, 100) == pytest.approx(1.0)
    assert tune.cost_of({**GOOD, "heel_strike_delay_ms": {"mean": 20.0}}, 100) == pytest.approx(1.0)
    assert tune.cost_of({**GOOD, "can": {"can1": {"lost": 2}}}, 100) == 2 * tune.LOST_COST


def test_any_fall_costs_more_than_a_walk_at_all_limits_and_an_early_one_most():
    at_limits = {name: aim + tolerance for name, (aim, tolerance) in tune.AIMS.items()}
    early = tune.cost_of({**GOOD, "fell": True, "steps": 5}, 100)
    late = tune.cost_of({**GOOD, "fell": True, "steps": 95}, 100)
    assert early > late > tune.cost_of({**GOOD, **at_limits}, 100)


def test_for_energy_a_walk_costs_its_cost_of_transport_and_never_as_much_as_a_fall():
    assert tune.cost_of(GOOD, 100, "energy") == pytest.approx(28.0)
    latest_fall = tune.cost_of({**GOOD, "fell": True, "steps": 99}, 100, "energy")
    assert tune.cost_of({**GOOD, "tcot": 5.0}, 100, "energy") < latest_fall


class Valley:
    """`valley` as a judge; remembers what it was asked."""

    def __init__(self):
        self.asked = []

    def __call__(self, changes):
        self.asked.append(changes)
        return valley(changes)

    def all(self, candidates):
        return [self(changes) for changes in candidates]


def test_the_evolution_finds_the_bottom_of_the_valley_and_never_loses_its_best():
    steps = {"P_H_PM_H_TRATE": 0.4, "C_H_OUTER_STIFFNESS": 1.0}
    costs = [cost for _, cost, _ in tune.evolve(Valley(), BASE, {}, steps, 30, 8, 1)]
    assert costs == sorted(costs, reverse=True) and len(costs) == 31
    assert costs[0] == pytest.approx(0.65) and costs[-1] < 1e-3  # begins at 2 rad/s and 2 A/rad


def test_the_evolution_keeps_to_the_tables_ranges_and_moves_twins_together():
    judge = Valley()
    list(tune.evolve(judge, BASE, {}, {"P_FO_PP_THEIGHT": 1.0, "P_FI_PP_THEIGHT": 1.0}, 2, 8, 1))
    limit = programs.parameter_rows()["P_FO_PP_THEIGHT"].maximum
    tried = [changes for changes in judge.asked if changes]
    assert {changes["P_FO_PP_THEIGHT"] for changes in tried} >= {0.0, limit}  # both ends: 1 m is far beyond 0 and 0.1
    assert all(changes["P_FO_PP_THEIGHT"] == changes["P_FI_PP_THEIGHT"] for changes in tried)
    assert all(0.0 <= changes["P_FO_PP_THEIGHT"] <= limit for changes in tried)


def test_the_same_seed_gives_the_same_evolution_and_another_one_another():
    steps = {"P_H_PM_H_TRATE": 0.4, "C_H_OUTER_STIFFNESS": 1.0}
    asked = []
    for seed in (1, 1, 2):
        judge = Valley()
        list(tune.evolve(judge, BASE, {}, steps, 2, 6, seed))
        asked.append(judge.asked)
    assert asked[0] == asked[1] != asked[2]


def test_default_steps_are_of_parameters_that_the_program_reads():
    for name, steps in tune.DEFAULT_STEPS.items():
        assert set(steps) <= programs.program(name).parameters()
    assert set(tune.DEFAULT_STEPS) == set(programs.PROGRAMS)


def test_candidates_walk_the_same_in_their_own_processes(tmp_path):
    task = tune.Task("robust", 6, (1, 2), (0.0,), aim="energy")
    candidates = [{}, {"P_F_PP_F_TANG": 0.22}, {}]
    found = []
    for jobs in (1, 2):
        with tune.workers(jobs) as each:
            found.append(tune.Judge(task, tmp_path, Console(quiet=True), each).all(candidates))
    assert found[0] == found[1] and found[0][0] == found[0][2]
    assert not list(tmp_path.iterdir())


def test_the_written_file_is_a_parameter_set(tmp_path):
    path = tmp_path / "found.toml"
    path.write_text(tune.as_toml("record-2011", "found", {"P_F_FU_H_ANG": 0.13}, {"P_F_FU_H_ANG": "clearance"}))
    found = controllers.load(str(path))
    assert found.changes == {"P_F_FU_H_ANG": 0.13}
    assert found.reasons == {"P_F_FU_H_ANG": "clearance"}
    assert found.operator == controllers.load("record-2011").operator


def test_the_command_walks_the_whole_robot_and_writes_what_it_found(tmp_path):
    path = tmp_path / "found.toml"
    options = ["--start", "robust", "--steps", "6", "--seeds", "1", "--floor-roughness", "0", "--rounds", "0"]
    assert tune.main([*options, "--out", str(path)]) == 0
    assert controllers.load(str(path)).values == controllers.load("robust").values


def test_the_evolution_as_a_command_writes_its_best(tmp_path):
    path = tmp_path / "found.toml"
    options = ["--base", "reflex", "--method", "evolution", "--aim", "energy", "--steps", "6", "--seeds", "1"]
    options += ["--floor-roughness", "0", "--generations", "1", "--population", "4", "--spread", "0.1", "--jobs", "2"]
    assert tune.main([*options, "--out", str(path)]) == 0
    found = controllers.load(str(path))
    assert found.program == "reflex" and set(found.changes) <= set(tune.REFLEX_STEPS)


@pytest.mark.parametrize(
    "options",
    [
        ["--out", "found.txt"],
        ["--out", "no/such/folder/found.toml"],
        ["--start", "nobody", "--out", "found.toml"],
        ["--vary", "P_NO_SUCH=1", "--out", "found.toml"],
        ["--vary", "R_W_REF=0.1", "--out", "found.toml"],
        ["--start", "reflex", "--out", "found.toml"],
        ["--body", "snowman", "--out", "found.toml"],
        ["--aim", "fame", "--out", "found.toml"],
        ["--vary", "P_F_FU_H_ANG=0", "--out", "found.toml"],
        ["--floor-roughness", "far", "--out", "found.toml"],
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(options, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        code = tune.main([*options])
    except SystemExit as left:
        code = left.code
    assert code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
