"""A group of runs with one golden run: walked once for its record, and again to branch the runs off it.

    python -m ranger_sim.harness.campaigns.group     # requests as lines of JSON in, one result a line out

The process has one thread, so it may fork; threads of the command give it one group after another, Dask's workers one
group. A fault's run branches off `BRANCH_EARLY_NS` before the fault begins in the golden run, so that the walk
before it is computed once; a sweep of settings differs from power-up on and branches there. Where the system
cannot fork, on Windows, each run walks from power-up, with the same result.
"""

import dataclasses
import functools
import gc
import hashlib
import json
import os
import pathlib
import sys
from collections.abc import Callable, Iterable
from typing import Any

import numpy.ma  # noqa: F401  (numpy's `unique` loads it late: every branch would, for as long as a small machine runs)

from ranger_sim.foundation import systems, wallclock
from ranger_sim.foundation.user_error import CampaignError, UserError, raised
from ranger_sim.harness.branching import BranchError, branch, die_with
from ranger_sim.harness.campaigns.cases import Case, Settings, version
from ranger_sim.harness.campaigns.outcomes import Band
from ranger_sim.harness.faults import text as typed_text
from ranger_sim.harness.faults.evidence import Evidence, Record
from ranger_sim.harness.faults.proof import Difference, Healthy, Proof, Reaction, false_alarms, prove
from ranger_sim.harness.machine import GRID_NS, Machine
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.stop_rule import StopRule

# Before the fault begins, so that state with a short history (a delay line, the last edge) is filled: chosen by us, a
# tenth of a step.
BRANCH_EARLY_NS = 60_000_000
SLICE_NS = 250_000_000
WALL_PER_CPU = 20.0  # a run with less of the processor than that hangs

BAND = tuple(field.name for field in dataclasses.fields(Band))  # of Ranger's walks

Result = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Watch:
    """How runs are monitored: `after_s` from the fault's start on; golden runs look for starts until `patience_s`.

    from_s: from where the gait of a run without a fault is judged. limit_s: of computing, per run. band: of a user's
    machine, {quantity: how far it may be from the golden run's}.
    """

    after_s: float = 7.0
    from_s: float = 5.0
    patience_s: float = 30.0
    limit_s: float = 300.0
    band: Band | dict[str, float] = dataclasses.field(default_factory=Band)

    def as_dict(self) -> dict[str, Any]:
        """As plain types for JSON."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, found: dict[str, Any]) -> "Watch":
        """The same from the result of `as_dict`."""
        band = found["band"]
        return cls(**{**found, "band": Band(**band) if set(band) == set(BAND) else band})


class Probe(StepWatch):
    """Finds when a start condition first holds in a run without the fault, `met_ns`; -1: not yet."""

    def __init__(self, robot: Machine, text: str) -> None:
        StepWatch.__init__(self)
        self.robot = robot
        self.wanted = robot.condition(text)
        self.wanted.begin(robot)
        self.met_ns = -1

    def before_step(self, now_ns: int) -> None:
        if self.wanted.met():
            self.met_ns = now_ns
            self.robot.loop.watchers.remove(self)


def digest_of(path: str) -> str:
    """Digest of a file's content. UserError when it cannot be read."""
    try:
        return hashlib.blake2b(pathlib.Path(path).read_bytes(), digest_size=16).hexdigest()
    except OSError as error:
        raise CampaignError(f"{path}: {error.strerror}") from None


def start_of(fault: str) -> str:
    """When a typed fault begins, as a condition; at once by default."""
    return typed_text.parse(fault).start or "0 s"


def walk_until(robot: Machine, end_ns: int) -> None:
    """Pass time until `end_ns`, or until the robot falls."""
    while robot.loop.time < end_ns and not robot.ended:
        robot.run(StopRule(time_s=(end_ns - robot.start_ns) * 1e-9), (end_ns - robot.loop.time) * 1e-9)


class Golden:
    """The golden run of a group: its record, the time of each start, and its gait from there on.

    CampaignError where the machine raises an exception: no other run can be compared with it.
    """

    def __init__(self, settings: Settings, starts: set[str], watch: Watch) -> None:
        self.subject = settings.subject
        try:
            self._walk(settings, starts, watch)
        except UserError:
            raise
        except Exception as error:
            raise CampaignError(f"campaign: a run without a fault raised {raised(error)}") from error

    def _walk(self, settings: Settings, starts: set[str], watch: Watch) -> None:
        robot = settings.robot()
        evidence = Evidence(robot)
        probes = {text: Probe(robot, text) for text in sorted(starts)}
        robot.loop.watchers.extend(probes.values())
        self.starts: dict[str, int] = {}
        # Whole nanoseconds: sums of seconds may be a last digit beyond what the clock can represent.
        after_ns, patience_ns = round(watch.after_s * 1e9), robot.start_ns + round(watch.patience_s * 1e9)
        end_ns = robot.start_ns + round(watch.from_s * 1e9) + after_ns if not probes else 0
        while not robot.ended:
            met = [probe.met_ns for probe in probes.values()]
            if all(each >= 0 for each in met):
                end_ns = max([end_ns, *(each + after_ns for each in met)])
            elif robot.loop.time >= patience_ns:
                end_ns = max(end_ns, patience_ns + after_ns)
            if end_ns and robot.loop.time >= end_ns:
                break
            target_ns = robot.loop.time + SLICE_NS
            walk_until(robot, min(target_ns, end_ns) if end_ns else target_ns)
        self.starts = {text: probe.met_ns for text, probe in probes.items()}
        self.record: Record = evidence.record()
        self.digest = robot.trace_digest()
        self.known: dict[int, Healthy] = {}

    def healthy(self, others: Healthy | None, until_ns: int) -> Healthy:
        """What is normal for a run that ends at `until_ns`: what other walks raise, and this one until that time.

        Not more of this one, so that a result does not depend on the other runs of its group.
        """
        if until_ns not in self.known:
            own = Healthy.of([self.record.until(until_ns)])
            self.known[until_ns] = own if others is None else own.merged(others)
        return self.known[until_ns]


class Kept:
    """What a process keeps from one request for the next: its version, and the latest golden run with a robot."""

    def __init__(self) -> None:
        self.versions: dict[str, str] = {}
        self.modules: set[tuple[str, str]] = set()
        self.latest: tuple[str, set[str]] = ("", set())
        self._golden: Golden | None = None
        self.robot: Machine | None = None
        self.evidence: Evidence | None = None

    def version(self, machine: str) -> str:
        """Version of what this process has imported: not that of files that were changed since."""
        if machine not in self.versions:
            self.versions[machine] = version(machine)
        return self.versions[machine]

    def take_module(self, catalogue: Any, name: str, digest: str) -> None:
        """Load the faults of a module, once. UserError where the file differs from the requested one."""
        if (name, digest) in self.modules:
            return
        catalogue.load_file(name)
        if digest_of(name) != digest:
            raise CampaignError(f"campaign: fault module {name}: it differs from the requested file")
        self.modules.add((name, digest))

    def golden(self, settings: Settings, starts: set[str], watch: Watch) -> Golden:
        """The golden run of these settings; walked when it is not the latest one, or lacks a start."""
        text = json.dumps([settings.as_dict(), watch.as_dict()], sort_keys=True)
        known, starts_known = self.latest
        if self._golden is None or text != known or not starts <= starts_known:
            self.robot = self.evidence = None
            self._golden = Golden(settings, starts, watch)
            self.latest = (text, starts)
        self._golden.known.clear()
        return self._golden

    def robot_at(self, settings: Settings, latest_ns: int) -> tuple[Machine, Evidence]:
        """A robot of the golden run's settings, with its record, that has walked no further than `latest_ns`."""
        if self.robot is None or self.evidence is None or self.robot.loop.time > latest_ns or not systems.can_fork():
            self.robot = settings.robot()
            self.evidence = Evidence(self.robot)
        return self.robot, self.evidence


def run_group(request: dict[str, Any], emit: Callable[[Result], None], kept: Kept | None = None) -> None:
    """Run the cases of a request and `emit` the result of each as soon as it is available.

    request: version, settings of the golden run, watch, healthy (`Healthy.as_dict`), fault_module
    (name and digest, or None), starts: of all faults with this golden run, cases: [{key, fault, settings}].
    UserError when this installation has other sources than the requester's.
    """
    settings = Settings(**request["settings"])
    kept = Kept() if kept is None else kept
    here = kept.version(settings.machine)
    if request["version"] != here:
        raise CampaignError(f"campaign: this worker runs {here}, asked for is {request['version']}")
    if request.get("fault_module"):
        kept.take_module(settings.subject.catalogue, *request["fault_module"])
    watch = Watch.from_dict(request["watch"])
    healthy = Healthy.from_dict(request["healthy"]) if request.get("healthy") else None
    cases = request["cases"]
    golden = kept.golden(settings, set(request["starts"]), watch)
    gc.freeze()  # a branch that visits every object would copy the memory of all
    try:
        run_cases(cases, settings, golden, healthy, watch, emit, kept)
    finally:
        gc.unfreeze()


def run_cases(
    cases: list[dict[str, Any]],
    settings: Settings,
    golden: Golden,
    healthy: Healthy | None,
    watch: Watch,
    emit: Callable[[Result], None],
    kept: Kept,
) -> None:
    """Run cases with one golden run, in the order in which their faults begin."""
    golden.subject.catalogue.load()  # here, once: every branch would import the modes and make the machine shown
    for case in cases:
        if not case["fault"]:
            emit(finished(case, functools.partial(sweep_run, case, golden, healthy, watch), watch))
    along = sorted((case for case in cases if case["fault"]), key=lambda case: golden.starts[start_of(case["fault"])])
    for case in along:
        start_ns = golden.starts[start_of(case["fault"])]
        if start_ns < 0:
            why = f"the golden run did not reach {start_of(case['fault'])}"
            if golden.record.fell_ns >= 0:
                why += f": it fell ({golden.record.fall_cause})"
            emit({"key": case["key"], "outcome": "invalid", "why": why})
            continue
        begin_ns = golden.record.begin_ns
        branch_ns = max(begin_ns, begin_ns + (start_ns - BRANCH_EARLY_NS - begin_ns) // GRID_NS * GRID_NS)
        robot, evidence = kept.robot_at(settings, branch_ns)
        if branch_ns > robot.loop.time:
            robot.run(StopRule(time_s=(branch_ns - robot.start_ns) * 1e-9), 3600.0)
        work = functools.partial(fault_run, case["fault"], robot, evidence, golden, healthy, watch)
        emit(finished(case, work, watch))


def finished(case: dict[str, Any], work: Callable[[], Result], watch: Watch) -> Result:
    """The result of a case, run in a branch; also when the branch returned none."""
    begun = wallclock.monotonic_s()
    try:
        result = branch(work, watch.limit_s, WALL_PER_CPU * watch.limit_s)
    except BranchError as error:
        result = {"outcome": error.outcome, "why": str(error), "limit_s": watch.limit_s}
    spent = {"wall_s": round(wallclock.monotonic_s() - begun, 3), "cpu_s": result.pop("cpu_s", None)}
    return {"key": case["key"], **result, "spent": spent}


def fault_run(
    text: str, robot: Machine, evidence: Evidence, golden: Golden, healthy: Healthy | None, watch: Watch
) -> Result:
    """In the branch: inject, walk on, and compare the record with the golden one."""
    begun_s = wallclock.process_cpu_s()
    try:
        fault = robot.arm(robot.catalogue.typed(text))
    except UserError as refused:
        return {"outcome": "invalid", "why": f"refused: {refused}"}
    start_ns = golden.starts[start_of(text)]
    walk_until(robot, start_ns + round(watch.after_s * 1e9))
    record = evidence.record()
    began_ns = fault.activated_ns if fault.activated_ns >= 0 else start_ns
    normal = golden.healthy(healthy, start_ns + round(watch.after_s * 1e9))
    proof = prove(golden.record, record, began_ns, fault.acted, normal)
    until = golden.record.until(start_ns + round(watch.after_s * 1e9))
    return {
        **judged(golden.subject, proof, until, record, began_ns, watch),
        "fault": {name: rounded(value) for name, value in fault.summary().items()},
        "digest": robot.trace_digest(),
        "cpu_s": round(wallclock.process_cpu_s() - begun_s, 3),
    }


def alone(case: Case, watch: Watch, healthy: dict[str, Any] | None) -> Result:
    """Run a case in this process, from power-up, without a branch: the same result as in a group."""
    normal = Healthy.from_dict(healthy) if healthy else None
    starts = {start_of(case.fault)} if case.fault else set()
    golden = Golden(case.golden(), starts, watch)
    if case.fault is None:
        return sweep_run({"settings": case.settings.as_dict()}, golden, normal, watch)
    robot = case.settings.robot()
    return fault_run(case.fault, robot, Evidence(robot), golden, normal, watch)


def sweep_run(case: dict[str, Any], golden: Golden, healthy: Healthy | None, watch: Watch) -> Result:
    """In the branch: another robot from power-up, compared with the golden one of the plan's own settings."""
    begun_s = wallclock.process_cpu_s()
    try:
        robot = Settings(**case["settings"]).robot()
    except UserError as refused:
        return {"outcome": "invalid", "why": f"refused: {refused}"}
    evidence = Evidence(robot)
    end_ns = robot.start_ns + round(watch.from_s * 1e9) + round(watch.after_s * 1e9)
    walk_until(robot, end_ns)
    record = evidence.record()
    since_ns = robot.start_ns + round(watch.from_s * 1e9)
    normal = golden.healthy(healthy, end_ns)
    proof = prove(golden.record, record, robot.start_ns, True, normal)
    return {
        **judged(golden.subject, proof, golden.record.until(end_ns), record, since_ns, watch, is_sweep=True),
        "slots": slots_of(robot),
        "digest": robot.trace_digest(),
        "cpu_s": round(wallclock.process_cpu_s() - begun_s, 3),
    }


def slots_of(robot: Machine) -> Result:
    """{board: {margin, overruns}} since power-up; margin: the share of its slot that the longest one left."""
    figures = {}
    for board, counted in robot.counters().items():
        slots = counted.slots
        slot_cycles = slots.slot_ns * counted.hz * 1e-9
        figures[board] = {"margin": rounded(1.0 - slots.max_cycles / slot_cycles), "overruns": slots.overruns}
    return figures


def judged(
    subject: Any, proof: Proof, golden: Record, record: Record, since_ns: int, watch: Watch, is_sweep: bool = False
) -> Result:
    """Outcome, reason and the proof's content, as plain types for JSON; times in ms from the fault's start.

    golden: its record until the time at which this run was to end.
    """
    verdict = subject.judge(proof, golden, record, since_ns, watch.band, is_sweep)

    def difference(found: Difference | None) -> Result | None:
        if found is None:
            return None
        return {"where": found.where, "name": found.name, "ms": rounded(proof.after_ms(found))}

    def change(found: Reaction | None) -> Result | None:
        if found is None:
            return None
        words = {"machine": found.machine, "state": found.state, "instead_of": found.instead_of}
        return {**words, "ms": rounded(proof.after_ms(found))}

    return {
        "outcome": verdict["outcome"],
        "why": verdict["why"],
        "first": difference(proof.first),
        "first_firmware": difference(proof.first_firmware),
        "detected": [
            {"board": each.board, "code": each.code, "rate": each.rate, "ms": rounded(proof.after_ms(each))}
            for each in proof.detections
        ],
        "reaction": change(proof.reaction),
        "unusual": change(proof.unusual),
        "fall_ms": rounded(proof.fall_ms),
        "gait": {name: rounded(value) for name, value in verdict["gait"].items()},
        "golden_gait": {name: rounded(value) for name, value in verdict["golden_gait"].items()},
        "deviation": rounded(verdict["deviation"]),
    }


def rounded(value: Any) -> Any:
    """Six digits of a number, for files that people read; other values unchanged."""
    return float(f"{value:.6g}") if isinstance(value, float) else value


def healthy_walks(settings: Settings, seeds: list[int], watch: Watch) -> Result:
    """What walks of these seeds without a fault raise, and how many false alarms the rule for detection then gives."""
    records = []
    falls = []
    starts_s = settings.subject.starts_s
    for seed in seeds:
        of_seed = dataclasses.replace(settings, walk={**settings.walk, "seed": seed})
        golden = Golden(of_seed, set(), dataclasses.replace(watch, from_s=max(watch.from_s, starts_s[-1])))
        if golden.record.fell_ns >= 0:
            falls.append(seed)
        else:
            records.append(golden.record)
    starts = [round(each * 1e9) for each in starts_s]
    count, total, which = false_alarms(records, starts) if len(records) > 1 else (0, 0, [])
    gaits = settings.subject.gaits(records, starts[-1])
    return {
        "healthy": Healthy.of(records).as_dict(),
        "seeds": [seed for seed in seeds if seed not in falls],
        "fell": falls,
        "false_alarms": [count, total],
        "false_alarm_codes": sorted({f"{each.code} from {each.board}" for each in which}),
        "gaits": [{name: rounded(value) for name, value in each.items()} for each in gaits],
    }


def request_of(
    cases: list[Case],
    keys: list[str],
    golden: Settings,
    watch: Watch,
    healthy: dict[str, Any] | None,
    version: str,
    fault_module: str | None = None,
    starts: Iterable[str] = (),
) -> dict[str, Any]:
    """The request to a worker. starts: of further faults with the same golden run, which it then walks once."""
    return {
        "version": version,
        "settings": golden.as_dict(),
        "watch": watch.as_dict(),
        "healthy": healthy,
        "fault_module": None if fault_module is None else [fault_module, digest_of(fault_module)],
        "starts": sorted({*starts, *(start_of(case.fault) for case in cases if case.fault)}),
        "cases": [
            {"key": key, "fault": case.fault, "settings": case.settings.as_dict()}
            for case, key in zip(cases, keys, strict=True)
        ],
    }


def answer(request: dict[str, Any], emit: Callable[[Result], None], kept: Kept) -> None:
    """Carry out a request: runs of a group, or healthy walks."""
    if "seeds" in request:
        watch = Watch.from_dict(request["watch"])
        found = healthy_walks(Settings(**request["settings"]), request["seeds"], watch)
        emit({"key": request["key"], **found})
    else:
        run_group(request, emit, kept)


def main() -> int:
    """Requests on standard input, results on standard output, after those of a request {"ended": true}.

    It ends after the last request, after one that it refuses, and with its parent process.
    """
    die_with(os.getppid())
    results = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a user's fault module prints is not a result

    def emit(result: Result) -> None:
        try:
            results.write(json.dumps(result) + "\n")
            results.flush()
        except BrokenPipeError:  # the requesting process has ended: results are useless
            os._exit(1)

    kept = Kept()
    code = 1  # the requester has ended already
    while request := sys.stdin.readline():
        code = 0
        try:
            answer(json.loads(request), emit, kept)
        except UserError as mistake:
            emit({"refused": str(mistake)})
            return 0
        emit({"ended": True})
    return code


if __name__ == "__main__":
    sys.exit(main())
