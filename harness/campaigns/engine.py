"""Runs a plan: healthy walks first, then every run that is not on disk yet, in groups with one golden run each."""

import collections
import hashlib
import json
import math
import pathlib
from collections.abc import Callable, Iterator
from typing import Any

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.campaigns.cases import Case, Settings, version
from ranger_sim.harness.campaigns.group import request_of, start_of
from ranger_sim.harness.campaigns.plan import Plan, Range, combinations
from ranger_sim.harness.campaigns.statistics import Stopping
from ranger_sim.harness.campaigns.store import Store

# Runs of a group: few enough that a group's results arrive soon and the workers end together, many enough
# that its golden run, walked twice (3 s of computing), is shared: chosen by us.
MOST_IN_A_GROUP = 16
# A golden run, walked twice, costs what three runs do: a round of a search is not distributed one by one.
LEAST_IN_A_GROUP = 4
NARROWER = 0.5  # of a search's box, from round to round
FIRST_BOX = 0.25  # half its width in the first round, of the whole range

Result = dict[str, Any]


def jsonl(folder: pathlib.Path) -> pathlib.Path:
    """Where a campaign's results are."""
    return folder / "results.jsonl"


class Campaign:
    """A plan and its results so far, in `folder`. `cases`: the runs decided on, in order; a search adds to them."""

    def __init__(self, plan: Plan, folder: pathlib.Path) -> None:
        self.plan = plan
        self.folder = folder
        self.version = version(plan.machine)
        self.store = Store(jsonl(folder))
        self.cases: list[Case] = []
        self.stopped_at: int | None = None  # look at which a sample sufficed

    def key(self, case: Case) -> str:
        """The key under which the result of a case is stored."""
        return case.key(self.version, self.plan.watch_key())

    def result(self, case: Case) -> Result | None:
        """The stored result of a case, or None; None as well for one that timed out and has more time now."""
        found = self.store.results.get(self.key(case))
        if found is not None and found["outcome"] == "timed out" and found["limit_s"] < self.plan.watch.limit_s:
            return None
        return found

    @property
    def foreseen(self) -> int:
        """The most runs that the plan can have."""
        plan = self.plan
        if plan.sample:
            return plan.sample.runs
        if not plan.search:
            return sum(1 for _ in combinations(plan.axes))
        return len(self.cells()) * (plan.search.first + plan.search.rounds * plan.search.each)

    def run(self, pool: Any, report: Callable[[int, str], None]) -> None:
        """Run what is missing. It calls `report(done, what)` after every result; `pool`: of pools.py, left without
        processes."""
        try:
            self._run(pool, report)
        finally:
            pool.release()

    def _run(self, pool: Any, report: Callable[[int, str], None]) -> None:
        plan = self.plan
        self.cases, self.stopped_at = [], None
        if plan.search:
            for cases in self.searching(plan.search):
                self.cases += cases
                self.do(cases, pool, report)
            return
        cases = plan.cases()
        stopping = plan.sample.stopping if plan.sample else None
        if stopping is None:
            self.cases = cases
            self.do(cases, pool, report)
            return
        for look in range(1, stopping.looks + 1):
            more = cases[len(self.cases) : stopping.look_after(look)]
            self.cases += more
            self.do(more, pool, report)
            if self.settled(stopping, look):
                break

    def settled(self, stopping: Stopping, look: int) -> bool:
        """Whether the sample, complete up to look number `look`, suffices."""
        self.stopped_at = look
        hits = sum((self.result(case) or {}).get("outcome") == stopping.outcome for case in self.cases)
        return stopping.decides(stopping.interval(hits, len(self.cases), look))

    def take_known(self) -> None:
        """The runs decided on that have results, as far as the plan was carried out; nothing is run."""
        plan = self.plan
        self.cases, self.stopped_at = [], None
        if plan.search:
            for cases in self.searching(plan.search):
                self.cases += [case for case in cases if self.result(case) is not None]
                if any(self.result(case) is None for case in cases):
                    return
            return
        cases = plan.cases()
        stopping = plan.sample.stopping if plan.sample else None
        if stopping is not None:
            for look in range(1, stopping.looks + 1):
                more = cases[len(self.cases) : stopping.look_after(look)]
                if any(self.result(case) is None for case in more):
                    break
                self.cases += more
                if self.settled(stopping, look):
                    return
        self.cases = [case for case in cases if self.result(case) is not None]
        self.stopped_at = None if len(self.cases) < len(cases) else self.stopped_at

    def do(self, cases: list[Case], pool: Any, report: Callable[[int, str], None]) -> None:
        """Run those of `cases` whose results are missing."""
        keys = {self.key(case): case for case in cases if self.result(case) is None}
        groups: dict[str, list[tuple[str, Case]]] = {}
        for key, case in keys.items():
            groups.setdefault(case.golden().text(), []).append((key, case))
        healthy = self.healthy([members[0][1].golden() for members in groups.values()], pool, report)
        requests = []
        for key in keys:
            self.store.forget(key)  # one that timed out
        for members in groups.values():
            golden = members[0][1].golden()
            starts = {start_of(case.fault) for _, case in members if case.fault}
            least = min(LEAST_IN_A_GROUP, math.ceil(len(members) / pool.jobs))
            size = min(MOST_IN_A_GROUP, max(least, math.ceil(len(members) / (3 * pool.jobs))))
            for start in range(0, len(members), size):
                part = members[start : start + size]
                requests.append(
                    request_of(
                        [case for _, case in part],
                        [key for key, _ in part],
                        golden,
                        self.plan.watch,
                        healthy[self.healthy_key(golden)]["healthy"],
                        self.version,
                        self.plan.fault_module,
                        starts,
                    )
                )
        done = self.done  # counted on: a key is a digest of the whole case
        times = collections.Counter(self.key(case) for case in cases)  # a random sample may draw a case twice
        for result in pool.run(requests):
            if self.store.add(result):
                done += times[result["key"]]
            report(done, result["outcome"])

    @property
    def done(self) -> int:
        """The number of decided cases that have results."""
        return sum(self.result(case) is not None for case in self.cases)

    def healthy_key(self, golden: Settings) -> str:
        """The key of the healthy walks with these settings (of any seed)."""
        walk = {name: value for name, value in golden.walk.items() if name != "seed"}
        whole = {**golden.as_dict(), "walk": walk, "version": self.version, "watch": self.plan.watch_key()}
        return "healthy-" + hashlib.blake2b(json.dumps(whole, sort_keys=True).encode(), digest_size=8).hexdigest()

    def healthy(self, goldens: list[Settings], pool: Any, report: Callable[[int, str], None]) -> dict[str, Result]:
        """What healthy walks raise, for each of these settings; walked when it is missing."""
        wanted = {self.healthy_key(golden): golden for golden in goldens}
        requests = [
            {
                "key": key,
                "settings": golden.as_dict(),
                "seeds": list(self.plan.healthy_seeds),
                "watch": self.plan.watch.as_dict(),
            }
            for key, golden in wanted.items()
            if key not in self.store.results
        ]
        for result in pool.run(requests):
            self.store.add(result)
            report(self.done, "healthy runs")
        return {key: self.store.results[key] for key in wanted}

    def healthy_of(self, case: Case) -> dict[str, Any] | None:
        """What the healthy walks of a case raise, when they have been walked."""
        found = self.store.results.get(self.healthy_key(case.golden()))
        return None if found is None else found["healthy"]

    def healthy_results(self) -> list[Result]:
        """The stored results of healthy walks."""
        goldens = {self.healthy_key(case.golden()) for case in self.cases}
        return [self.store.results[key] for key in sorted(goldens) if key in self.store.results]

    def searching(self, search: Any) -> Iterator[list[Case]]:
        """The runs of a search, round by round: spread over the ranges, then around the worst of each cell."""
        cells = self.cells()
        ranges = {name: values for name, values in self.plan.axes.items() if isinstance(values, Range)}
        tried: list[list[tuple[dict[str, float], Case]]] = [[] for _ in cells]
        for number in range(search.rounds + 1):
            round_cases = []
            for place, cell in enumerate(cells):
                stream = RandomStream(search.seed, f"campaign search {json.dumps(cell, sort_keys=True)} {number}")
                if number == 0:
                    points = spread(search.first, list(ranges), stream)
                else:
                    worst, case = max(
                        tried[place],
                        key=lambda each: search.badness(each[0].get(search.least, 0.0), self.result(each[1])),
                    )
                    below = search.least if search.hits(self.result(case)) else None
                    points = around(worst, search.each, FIRST_BOX * NARROWER ** (number - 1), stream, below)
                for point in points:
                    values = {name: ranges[name].at(share) for name, share in point.items()}
                    case = self.plan.case({name: values.get(name, cell.get(name)) for name in self.plan.axes})
                    tried[place].append((point, case))
                    round_cases.append(case)
            yield round_cases

    def cells(self) -> list[dict[str, Any]]:
        """Every combination of what a search does not search over."""
        return list(combinations({name: each for name, each in self.plan.axes.items() if not isinstance(each, Range)}))

    def close(self) -> None:
        """Release the results for another writer."""
        self.store.close()


def spread(count: int, names: list[str], stream: Any) -> list[dict[str, float]]:
    """`count` points in the unit box, one in each `count`-th of every axis (a Latin hypercube)."""
    columns = {}
    for name in names:
        order = list(range(count))
        for place in range(count - 1, 0, -1):
            other = stream.integer(place + 1)
            order[place], order[other] = order[other], order[place]
        columns[name] = [(place + stream.uniform()) / count for place in order]
    return [{name: columns[name][number] for name in names} for number in range(count)]


def around(
    centre: dict[str, float], count: int, half: float, stream: Any, below: str | None = None
) -> list[dict[str, float]]:
    """`count` points in a box around `centre`, inside the unit box; of the axis `below` no more than the centre's."""

    def near(name: str, share: float) -> float:
        chance = stream.uniform()
        return min(1.0, max(0.0, share + half * (-chance if name == below else 2.0 * chance - 1.0)))

    return [{name: near(name, share) for name, share in centre.items()} for _ in range(count)]
