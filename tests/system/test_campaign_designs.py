"""Search, sample and sweep on the whole robot, each with an answer that is known or argued."""

import dataclasses
import json
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.harness.branching import branch
from ranger_sim.harness.campaigns import engine, group, plan, pools, summary
from ranger_sim.harness.campaigns.cases import Settings
from ranger_sim.ranger.walks import REFERENCE

ROOT = pathlib.Path(__file__).resolve().parents[2]
PUSHES = {
    "title": "pushes",
    "watch": {"after": "1.5 s"},
    "healthy": {"seeds": [1, 2]},
    "vary": {
        "fault": ["world.robot:push,force={force},length_ms=100@{at} s"],
        "force": {"low": 40, "high": 120, "step": 20},
        "at": {"low": 3.4, "high": 3.7, "step": 0.3},
    },
}


def test_a_start_and_a_time_whose_sum_rounds_up_do_not_keep_a_golden_run_waiting():
    """As seconds, 0.1 s after such a start is a last digit beyond the time that the clock reaches.

    Such a start is noticed at 0.25 s, the end of the first slice, which is before 0.1 s have passed.
    """
    starts = [250_000 * number for number in range(700, 1000)]
    start_ns = next(each for each in starts if each * 1e-9 + 0.1 > (each + 100_000_000) * 1e-9)

    def end():
        golden = group.Golden(Settings(machine=REFERENCE), {f"{start_ns} ns"}, group.Watch(after_s=0.1))
        return {"after_ns": golden.record.end_ns - golden.starts[f"{start_ns} ns"]}

    assert branch(end, 60.0, 600.0)["after_ns"] == 100_000_000


class LeftError(Exception):
    """As if the campaign had been killed."""


class ShortLivedPool(pools.LocalPool):
    """Gives `left` results, then the campaign is over."""

    left = 3

    def run(self, requests):
        for result in super().run(requests):
            yield result
            self.left -= 1
            if not self.left:
                self.close()
                raise LeftError


def done(data, folder, pool=None):
    """A campaign, run to its end in `folder`."""
    folder.mkdir(exist_ok=True)
    campaign = engine.Campaign(plan.of_data(data, "test.toml", REFERENCE), folder)
    try:
        campaign.run(pool or pools.LocalPool(2), lambda done, what: None)
    finally:
        campaign.close()
    return campaign


def outcomes(campaign):
    """{key: (outcome, trace)} of the runs decided on."""
    results = {campaign.key(case): campaign.result(case) for case in campaign.cases}
    return {key: (result["outcome"], result.get("digest")) for key, result in results.items()}


def least_force(campaign):
    return min(case.axes["force"] for case in campaign.cases if campaign.result(case)["fall_ms"] is not None)


def test_a_search_finds_the_least_push_that_a_scan_of_all_pushes_finds_and_goes_on_where_it_was_left(tmp_path):
    scan = done(PUSHES, tmp_path / "scan")
    assert len(scan.cases) == 10 and len(outcomes(scan)) == 10
    # Two of five forces at a time: 4 runs of a spread and twice 3 below the least so far come to the smallest of five.
    wanted = {**PUSHES, "search": {"first": 4, "rounds": 2, "each": 3, "least": "force"}}
    with pytest.raises(LeftError):
        done(wanted, tmp_path / "search", ShortLivedPool(1))
    search = done(wanted, tmp_path / "search")
    assert len(search.cases) == 10  # some of them the same
    assert outcomes(search).items() <= outcomes(scan).items()
    assert least_force(search) == least_force(scan)
    (reported,) = summary.of(search)["extremes"]
    assert reported["least"]["axes"]["force"] == least_force(scan)


def test_a_sample_stops_at_the_look_at_which_the_rule_says_so(tmp_path):
    """A walk in which nothing is varied but the seed is its own golden run: every run is "no effect".

    O'Brien and Fleming's bounds for three looks are 3.471, 2.454 and 2.004 (Jennison and Turnbull, table 2.3), and of n
    hits in n runs Wilson's lower bound is n / (n + z^2): 0.25 after 4 runs, 0.57 after 8. The limit is 0.5: look 2.
    """
    data = {
        "watch": {"from": "0.3 s", "after": "0.3 s"},
        "healthy": {"seeds": [1, 2]},
        "vary": {"seed": {"low": 1, "high": 100, "step": 1}},
        "sample": {"runs": 12, "stop": {"outcome": "no effect", "limit": 0.5, "looks": 3}},
    }
    sample = done(data, tmp_path)
    assert [sample.result(case)["outcome"] for case in sample.cases] == ["no effect"] * 8
    assert sample.stopped_at == 2
    reported = summary.of(sample)
    assert reported["finished"] and reported["foreseen"] == 12
    assert reported["outcomes"]["no effect"]["low"] == pytest.approx(8.0 / (8.0 + 2.454**2), abs=1e-3)
    again = engine.Campaign(sample.plan, tmp_path)
    try:
        again.take_known()
        assert (again.stopped_at, outcomes(again)) == (2, outcomes(sample))
    finally:
        again.close()


def test_a_sweeps_slot_margin_falls_by_the_cost_that_was_added(tmp_path):
    """The task is in every row, so the longest slot grows by what is added to it.

    Both factors are above the task's limit, so the error about that costs both the same. What else may differ is how
    many interrupts fall into the slot that is longest: 3 % of a slot is 900 cycles, nine of the encoders' edges.
    """
    task, few, many = "mc_compliant_control", 4.0, 8.0
    data = {
        "watch": {"from": "0.5 s", "after": "0.5 s"},
        "healthy": {"seeds": [1, 2]},
        "vary": {"body.hip_gear": [60.0, 66.0], f"cost.MCH.{task}": [few, many]},
    }
    sweep = done(data, tmp_path)
    assert len(sweep.cases) == 4
    scheduler = Settings(machine=REFERENCE).robot().boards["MCH"].scheduler
    added = (many - few) * scheduler.find(task).cost / scheduler.slot_cycles
    margins = {
        (case.settings.body["hip_gear"], case.settings.costs[f"MCH.{task}"]): sweep.result(case)["slots"]["MCH"]
        for case in sweep.cases
    }
    for gear in (60.0, 66.0):
        fall = margins[gear, few]["margin"] - margins[gear, many]["margin"]
        assert fall == pytest.approx(added, abs=0.03)
    assert all(each["overruns"] == 0 and 0.0 < each["margin"] < 1.0 for each in margins.values())
    reported = summary.of(sweep)["settings"]
    assert [row["slot"]["board"] for row in reported if row["axes"][f"cost.MCH.{task}"] == many] == ["MCH", "MCH"]


OWN_MODE = """
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter


@mode
class Burnt(Fault):
    mode = "burnt"
    kinds = ("battery voltage",)
    meaning = "puts the pin at a voltage"
    unit = "V at the pin"
    parameters = (Parameter("diode", "V", 5.0, 0.0, 6.0, "where the pin is held", "test"),)

    def after(self, start_ns, end_ns):
        ends, place = self.robot.plant.electrics.analog_end, self.place.details["voltage"]
        self.note(end_ns, self.values["diode"] - ends[place])
        ends[place] = self.values["diode"]
        print("nobody's result")


print("loaded")
"""
OWN_PLAN = """
fault_module = "own.py"
[watch]
after = "0.2 s"
[healthy]
seeds = [1, 2]
[[faults]]
places = "MCH.battery_voltage"
modes = "burnt"
period = "step 1"
"""


def command(path, folder):
    return subprocess.run(
        [sys.executable, "-m", "ranger_sim", "campaign", str(path), "--out", str(folder), "--pool", "local"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_plan_may_name_a_file_with_a_users_own_modes(tmp_path):
    """In separate processes: the catalogue of this one stays as it is."""
    path, folder = tmp_path / "own.toml", tmp_path / "out"
    path.write_text(OWN_PLAN)
    missing = command(path, folder)
    (line,) = missing.stderr.splitlines()
    assert missing.returncode == 2 and f"fault module {tmp_path / 'own.py'}: there is no such file" in line
    (tmp_path / "own.py").write_text(OWN_MODE)
    reported = command(path, folder)
    assert reported.returncode == 0, reported.stderr
    (row,) = json.loads((folder / "summary.json").read_text())["rows"]
    assert (row["mode"], row["acted"]) == ("burnt", True)
    assert f"--fault-module {tmp_path / 'own.py'}" in row["replay"]


def test_a_result_is_known_by_the_content_of_the_file_with_the_users_modes(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(OWN_MODE)
    own = dataclasses.replace(plan.of_data(PUSHES, "test.toml", REFERENCE), axes={}, fault_module=str(path))
    before = own.watch_key()
    path.write_text(OWN_MODE.replace("5.0", "4.5"))
    assert own.watch_key() != before != dataclasses.replace(own, fault_module=None).watch_key()
