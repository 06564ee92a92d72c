"""summary.json against figures found a second time: from the run's own files, or with a known answer.

Each figure is in one of two lists. `figures.py` recomputes what the files have; `OTHER_ORACLES` names, for each
of the others, why the files do not have it, and the test that holds it to something else.
"""

import contextlib
import csv
import fnmatch
import json
import pathlib
import tomllib

import pytest

from ranger_sim.ranger.records.summary_schema import json_schema
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools.recordings import variables_file
from ranger_sim.tools.run.walk import write_frames
from tests.oracle import figures
from tests.oracle.run_folder import Log, Variables, frame_bits
from tests.oracle.test_summary_schema import violations

ROOT = pathlib.Path(__file__).resolve().parents[2]
MASTER = ROOT / "datatable" / "master"
LEG_M = 0.96  # appendix table 2
NOMINAL_V = 7 * 3.72  # seven cells, at the mean of plant/electrics/battery.py's curve: the charge of a full pack
BUSES = ("can1", "can2", "can3", "can4")

# What the files of a run cannot tell: (why not, figures, who tells it: a test of this folder or another of the suite).
NONE_IN_A_WALK = "a healthy walk has none, and files tell nothing of what did not happen"
OF_THE_MODEL = "counts and extremes that may lie between two samples, 2 ms apart"
SCENARIO = "tests/oracle/test_every_counter.py"
KNOWN = "tests/oracle/test_known_answers.py"
ODD = "tests/plant/walking/test_odd_figures.py"
OTHER_ORACLES = (
    (NONE_IN_A_WALK, "fell fall_cause", f"{SCENARIO}::test_a_fall_is_reported_with_its_cause"),
    (NONE_IN_A_WALK, "failed_boards", f"{SCENARIO}::test_each_board_that_hangs_is_named_and_no_other"),
    (NONE_IN_A_WALK, "battery.empty", f"{KNOWN}::test_empty_batteries_are_reported"),
    (
        NONE_IN_A_WALK,
        "heel_strike_delay_ms.unmatched heel_strike_delay_ms.missed",
        f"{KNOWN}::test_delays_of_strikes_have_a_known_mean_and_deviation",
    ),
    (NONE_IN_A_WALK, "can.*.lost", f"{SCENARIO}::test_frames_that_a_board_never_got_are_lost_once_each"),
    (NONE_IN_A_WALK, "can.*.queue_full", f"{SCENARIO}::test_frames_that_no_queue_took_are_counted"),
    (NONE_IN_A_WALK, "can.*.single_shot_skipped", f"{SCENARIO}::test_time_stamps_that_could_not_go_out_are_counted"),
    (NONE_IN_A_WALK, "slots.*.overruns", f"{SCENARIO}::test_each_board_that_takes_too_long_overruns_its_slots"),
    (NONE_IN_A_WALK, "faults", f"{SCENARIO}::test_every_fault_is_reported_with_its_times"),
    (
        "told over the serial link, not on a bus",
        "errors.MB.* errors.CSR.*",
        f"{SCENARIO}::test_errors_of_every_board_are_reported",
    ),
    (
        "main brain and router publish none",
        "slots.MB.max_execution_us slots.CSR.max_execution_us",
        f"{KNOWN}::test_the_longest_slot_is_reported_in_the_boards_own_cycles",
    ),
    (
        OF_THE_MODEL,
        "oddities.touches oddities.lift_offs oddities.tensile_strikes oddities.tensile_impulse_min_Ns "
        "oddities.friction_ratio_max oddities.normal_force_min_N",
        f"{ODD}::test_pulls_of_the_sticking_contact_are_counted_as_an_observer_counts_them",
    ),
    (
        OF_THE_MODEL,
        "oddities.slides oddities.slip_s",
        f"{ODD}::test_slides_of_the_default_contact_are_counted_and_timed",
    ),
    (
        OF_THE_MODEL,
        "oddities.bounces oddities.recontacts oddities.scuffs oddities.flights oddities.lead_lifts "
        "oddities.min_clearance_m",
        f"{KNOWN}::test_touches_and_departures_of_feet_count_for_what_they_are",
    ),
    (
        OF_THE_MODEL,
        "oddities.jams oddities.pull_s",
        f"{KNOWN}::test_every_count_of_the_record_is_reported_under_its_own_name",
    ),
    (
        "of the clocks of this machine",
        "realtime_factor cpu_factor",
        f"{KNOWN}::test_paces_are_virtual_time_over_that_of_the_clocks",
    ),
    (
        "of nanoseconds, which candump's format cuts",
        "trace_digest",
        f"{KNOWN}::test_the_digest_is_that_of_the_bytes_that_were_kept",
    ),
    (
        "what was asked for, and the program that ran",
        "compiled controller body profile model_file seed slope_rad floor_roughness_m electronics_off "
        "battery.capacity_Wh battery.charge_at_start oddities.contact",
        f"{KNOWN}::test_options_are_reported_as_they_were_given",
    ),
)


def leaves(value, path=""):
    """(dotted path, value) of everything in a summary that is not a dictionary; empty dictionaries have none."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, f"{path}.{name}" if path else name)
    else:
        yield path, value


class Run:
    """A walk of 7.3 s with its files, the summary as it is printed, and the figures found from the files."""

    def __init__(self, folder, body, ankle_offset_m, **options):
        with contextlib.closing(Ranger(Scenario(body=body, **options), log="full")) as robot:
            robot.run(StopRule(time_s=7.3), 7.3)
            assert not robot.ended
            write_frames(robot, folder)
            variables_file.write(robot, folder / "variables.mf4")
            self.summary = json.loads(json.dumps(robot.summary()))
        self.told = dict(leaves(self.summary))
        self.logs = {name: Log(folder / f"{name}.log") for name in BUSES}
        self.walk = figures.Walk(Variables(folder / "variables.mf4"), ankle_offset_m, LEG_M)
        self.boards = tomllib.loads((MASTER / "boards.toml").read_text(encoding="utf-8"))["boards"]
        self.recomputed = self._recompute()
        with (MASTER / "errors.csv").open(encoding="utf-8", newline="") as file:
            self.error_names = {int(row["id"]): row["name"] for row in csv.DictReader(file)}

    def _recompute(self):
        body = self.walk.body
        time_s = max(log.time_s[-1] for log in self.logs.values())  # there is a frame in every millisecond
        found = figures.of_the_walk(self.walk, figures.electronics_power(body))
        found |= figures.of_the_battery(body, 469.0, NOMINAL_V) | figures.of_strike_delays(self.walk)
        for name, log in self.logs.items():
            found |= figures.of_a_bus(name, log, time_s)
        for name in self.summary["slots"]:
            log = self.logs[figures.CAN_OF.get(name, "can1")]
            found |= figures.of_slots(name, log, time_s, self.boards[name]["slot_us"] * 1e-6)
        return found


@pytest.fixture(scope="module", params=["ranger", "appendix"])
def run(request, tmp_path_factory):
    """The default robot, whose trailing foot leaves in the strike; and the appendix's, which stands on both."""
    if request.param == "ranger":
        return Run(tmp_path_factory.mktemp("ranger"), "ranger", 0.146)  # ankle to centre: plant/bodies/ranger.toml
    return Run(tmp_path_factory.mktemp("appendix"), "appendix", 0.11, controller="robust")  # appendix table 2


def test_every_figure_in_the_files_is_the_summarys(run):
    wrong = [
        f"{path}: summary {run.told.get(path)}, files {value} +/- {tolerance}"
        for path, (value, tolerance) in run.recomputed.items()
        if run.told.get(path) is None or abs(run.told[path] - value) > tolerance
    ]
    assert not wrong, "\n".join(wrong)


def test_errors_are_those_that_the_boards_send_on_the_buses(run):
    for board, bus in figures.CAN_OF.items():
        reported = figures.of_errors(board, run.logs[bus], run.error_names)
        counted = {path: count for path, count in run.told.items() if path.startswith(f"errors.{board}.")}
        assert set(reported) == set(counted)
        for path, (count, waiting) in reported.items():  # what was noted since the last frame waits to be told
            assert count <= counted[path] <= count + waiting, path


def test_no_figure_is_without_an_oracle(run):
    for path in run.told:
        of_files = path in run.recomputed or path.startswith(tuple(f"errors.{board}." for board in figures.CAN_OF))
        others = [pattern for _, patterns, _ in OTHER_ORACLES for pattern in patterns.split()]
        others = [pattern for pattern in others if fnmatch.fnmatchcase(path, pattern)]
        assert of_files or others, f"{path} is neither recomputed nor in OTHER_ORACLES"
        assert not (of_files and others), f"{path} is recomputed: it need not stand in OTHER_ORACLES"


def test_the_summary_is_as_its_schema_has_it(run):
    of_walk = {"interrupted": False, "command": "", "complete": True, "files": {}}  # what `walk` adds
    assert violations({**run.summary, **of_walk}, json_schema()) == []


@pytest.mark.parametrize("place", [place for _, _, place in OTHER_ORACLES])
def test_the_other_oracles_are_tests_that_exist(place):
    file, _, test = place.partition("::")
    assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8")


def test_bits_of_a_frame_are_those_of_the_oracle_of_the_bus(run):
    from tests.can_bus.bit_oracle import Frame, stuffed

    log = run.logs["can4"]
    for number in range(0, len(log.length), len(log.length) // 40):
        data = log.data[number : number + 1, : log.length[number]]
        frame = Frame(int(log.identifier[number]), bytes(data[0].tolist()))
        expected = len(stuffed(frame)[0]) + 10 + 3  # delimiters, acknowledge, end of frame; intermission
        assert frame_bits(log.identifier[number : number + 1], data)[0] == expected
