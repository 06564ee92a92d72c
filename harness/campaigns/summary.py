"""Totals of a campaign's results: shares with the intervals of its design, times compared with their tolerance, the
tables by place and mode, and the worst cases with the commands that replay them."""

import collections
import math
import shlex
from collections.abc import Callable, Sequence
from typing import Any

from ranger_sim.harness.campaigns.cases import Case
from ranger_sim.harness.campaigns.engine import Campaign
from ranger_sim.harness.campaigns.outcomes import OUTCOMES, SEVERITY, severity
from ranger_sim.harness.campaigns.plan import Plan, Range, Tolerance
from ranger_sim.harness.campaigns.statistics import (
    INTERVALS,
    Share,
    census,
    shown_to_miss,
    tolerance_place,
    values_needed,
)
from ranger_sim.harness.faults import text as typed_text

WORST = 20  # cases that are listed
MOST_SETTINGS = 200  # of a sweep that are listed
PROVES_NOTHING = ("invalid", "timed out", "crashed")
SAFE = ("no effect", "masked", "detected and safe")

Result = dict[str, Any]
Row = tuple[Case, Result]


def of(campaign: Campaign) -> dict[str, Any]:
    """Everything that the page, the Markdown and the JSON show."""
    plan = campaign.plan
    rows = [(case, result) for case in campaign.cases if (result := campaign.result(case)) is not None]
    valid = [row for row in rows if row[1]["outcome"] not in PROVES_NOTHING]
    felt = [row for row in valid if row[1]["outcome"] != "no effect"]
    share = sharing(campaign, rows)
    return {
        "title": plan.title,
        "description": plan.description,
        "file": plan.path,
        "design": plan.design,
        "population": plan.population(),
        "version": campaign.version,
        "runs": len(rows),
        "foreseen": campaign.foreseen,
        "finished": is_finished(campaign, rows),
        "stopped_at_look": campaign.stopped_at,
        "interval": interval_text(plan, is_finished(campaign, rows)),
        "criteria": plan.subject.criteria,
        "outcomes": {
            name: as_dict(share(sum(result["outcome"] == name for _, result in rows), len(rows)))
            for name in plan.subject.criteria
        },
        "coverage": {
            "detected, of the runs whose fault reached the firmware": as_dict(
                share(sum(bool(result.get("detected")) for _, result in felt), len(felt))
            ),
            "safe (no effect, masked, detected and safe), of the runs whose fault acted": as_dict(
                share(sum(result["outcome"] in SAFE for _, result in valid), len(valid))
            ),
            "detected before the fall, of the falls": as_dict(
                share(
                    *counted(
                        [row for row in valid if row[1].get("fall_ms") is not None], lambda r: bool(r.get("detected"))
                    )
                )
            ),
        },
        "tolerances": [tolerance(plan, wanted, felt) for wanted in plan.tolerances if is_finished(campaign, rows)],
        "healthy": [
            {name: value for name, value in result.items() if name != "healthy"}
            for result in campaign.healthy_results()
        ],
        "axes": {name: by_axis(rows, name) for name in plan.axes if name != "fault" and varies(rows, name)},
        "axis_names": [name for name in plan.axes if name != "fault"],
        "heat": heat(rows),
        "codes": codes(felt),
        "settings": settings_table(plan, rows),
        "extremes": extremes(plan, rows),
        "worst": [worst_row(plan, row) for row in worst(valid)],
        "unsure": [worst_row(plan, row) for row in rows if row[1]["outcome"] in PROVES_NOTHING],
        "cpu_s": round(sum((result.get("spent") or {}).get("cpu_s") or 0.0 for _, result in rows), 1),
        "rows": [flat(plan, row) for row in rows],
    }


def is_finished(campaign: Campaign, rows: Sequence[Row]) -> bool:
    """Whether all runs of the plan are done."""
    return bool(rows) and (len(rows) == campaign.foreseen or campaign.stopped_at is not None)


def counted(rows: Sequence[Row], hit: Callable[[Result], bool]) -> tuple[int, int]:
    """(number of hits, total)."""
    return sum(hit(result) for _, result in rows), len(rows)


def sharing(campaign: Campaign, rows: Sequence[Row]) -> Callable[[int, int], Share]:
    """How a share of this campaign's runs is reported: plain, or with the interval of its finished sample."""
    sample = campaign.plan.sample
    if sample is None or not is_finished(campaign, rows):
        return census
    stopping, look = sample.stopping, campaign.stopped_at
    if stopping is not None and look is not None:
        return lambda count, total: stopping.interval(count, total, look) if total else Share(count, total)
    make = INTERVALS[sample.interval]
    return lambda count, total: make(count, total, sample.confidence) if total else Share(count, total)


def interval_text(plan: Plan, finished: bool) -> str:
    """How to read the shares, in a sentence."""
    if not finished:
        return "Shares are of the runs that are there and of nothing else: those that end soon come first."
    if plan.search:
        return (
            "The runs were chosen to find the worst case: shares describe the search, not a population, so "
            "they have no interval."
        )
    if plan.sample is None:
        return "A census: every member of the population is run, so shares are exact and have no interval."
    percent = f"{100.0 * plan.sample.confidence:g} %"
    if plan.sample.stopping:
        rule, looks = plan.sample.stopping.rule, plan.sample.stopping.looks
        return (
            f"A random sample with up to {looks} looks: repeated intervals of {percent} by the {rule} "
            "rule, which hold at whichever look it stopped."
        )
    return f"A random sample of the population, with replacement: {plan.sample.interval} intervals of {percent}."


def as_dict(share: Share) -> dict[str, Any]:
    """As plain types for JSON."""
    value = None if share.total == 0 else share.value
    return {"count": share.count, "of": share.total, "share": value, "low": share.low, "high": share.high}


def first_ms(result: Result, what: str) -> float:
    """When it was detected, or reacted to, in ms; infinite when never."""
    if what == "detection":
        return float(result["detected"][0]["ms"]) if result.get("detected") else math.inf
    return float(result["reaction"]["ms"]) if result.get("reaction") else math.inf


def tolerance(plan: Plan, wanted: Tolerance, felt: Sequence[Row]) -> dict[str, Any]:
    """A time compared with its tolerance: of a sample the tolerance limit, of a census the share itself."""
    times = sorted(first_ms(result, wanted.what) for _, result in felt)
    within = sum(each <= wanted.limit_ms for each in times)
    requirement: dict[str, Any] = {
        "what": wanted.what,
        "limit_ms": wanted.limit_ms,
        "share": wanted.share,
        "within": within,
        "of": len(times),
        "median_ms": finite(times[len(times) // 2]) if times else None,
    }
    if plan.sample is None:
        met = bool(times) and within >= wanted.share * len(times)
        return {**requirement, "verdict": "met" if met else "not met", "by": "census"}
    place = tolerance_place(len(times), wanted.share, wanted.confidence)
    if place is None:
        needed = values_needed(wanted.share, wanted.confidence)
        return {**requirement, "verdict": f"open: {needed} runs are needed", "by": f"{100 * wanted.confidence:g} %"}
    limit = times[place - 1]
    if limit <= wanted.limit_ms:
        verdict = "met"
    elif shown_to_miss(within, len(times), wanted.share, wanted.confidence):
        verdict = "not met"
    else:
        verdict = "open: this many runs show neither it nor its contrary"
    return {**requirement, "verdict": verdict, "by": f"{100 * wanted.confidence:g} %", "upper_ms": finite(limit)}


def finite(value: float) -> float | None:
    """None for never."""
    return value if math.isfinite(value) else None


def varies(rows: Sequence[Row], name: str) -> bool:
    """Whether an axis has two to twenty values, so that a table by them is useful."""
    return 2 <= len({str(case.axes.get(name)) for case, _ in rows}) <= 20


def by_axis(rows: Sequence[Row], name: str) -> dict[str, dict[str, int]]:
    """{value: {outcome: count}} of one axis."""
    found: dict[str, collections.Counter[str]] = {}
    for case, result in rows:
        found.setdefault(str(case.axes.get(name)), collections.Counter())[result["outcome"]] += 1
    return {value: dict(counts) for value, counts in found.items()}


def heat(rows: Sequence[Row]) -> dict[str, Any]:
    """By place and mode: {places, modes, cells: {place: {mode: [outcomes]}}}; empty without faults."""
    cells: dict[str, dict[str, list[str]]] = {}
    for case, result in rows:
        if case.fault:
            parts = typed_text.parse(case.fault)
            cells.setdefault(parts.place, {}).setdefault(parts.mode, []).append(result["outcome"])
    modes = sorted({mode for of_place in cells.values() for mode in of_place})
    return {"places": list(cells), "modes": modes, "cells": cells}


def settings_table(plan: Plan, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Each run of a sweep that is a census: settings, outcome, gait, and the slot with the least margin."""
    if plan.design != "census" or len(rows) > MOST_SETTINGS:
        return []
    return [
        {
            "axes": case.axes,
            "outcome": result["outcome"],
            "why": result.get("why", ""),
            "gait": result.get("gait") or {},
            "slot": least_slot(result),
        }
        for case, result in rows
        if not case.fault
    ]


def least_slot(result: Result) -> dict[str, Any]:
    """{board, margin, overruns}: of the board with the least margin, and the overruns of all boards."""
    slots = result.get("slots")
    if not slots:
        return {"board": "", "margin": None, "overruns": None}
    board = min(slots, key=lambda name: slots[name]["margin"])
    overruns = sum(each["overruns"] for each in slots.values())
    return {"board": board, "margin": slots[board]["margin"], "overruns": overruns}


def extremes(plan: Plan, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """For each listed combination of a search: how many had the outcome, the least value, the soonest fall."""
    if plan.search is None:
        return []
    search = plan.search
    ranges = [name for name, values in plan.axes.items() if isinstance(values, Range)]
    of_cell: dict[str, list[Row]] = {}
    for case, result in {result["key"]: (case, result) for case, result in rows}.values():
        cell = ", ".join(f"{name} {value}" for name, value in case.axes.items() if name not in ranges)
        of_cell.setdefault(cell, []).append((case, result))
    found = []
    for cell, members in of_cell.items():
        hits = [row for row in members if search.hits(row[1])]
        falls = [row for row in members if row[1].get("fall_ms") is not None]
        least = min(hits, key=lambda row: row[0].axes[str(search.least)], default=None) if search.least else None
        soonest = min(falls, key=lambda row: row[1]["fall_ms"], default=None)
        found.append(
            {
                "cell": cell,
                "runs": len(members),
                "outcome": search.outcome,
                "hits": len(hits),
                "least": least and worst_row(plan, least),
                "soonest": soonest and worst_row(plan, soonest),
            }
        )
    return found


def worst_of(outcomes: Sequence[str]) -> str:
    """The worst of several outcomes."""
    return max(outcomes, key=lambda each: (SEVERITY[each], OUTCOMES.index(each)))


def codes(felt: Sequence[Row]) -> list[dict[str, Any]]:
    """The errors that revealed faults first: board, code, how often, median ms; also faults without one."""
    found: dict[tuple[str, str], list[float]] = {}
    own: collections.Counter[tuple[str, str]] = collections.Counter()
    for case, result in felt:
        if result.get("detected"):
            first = result["detected"][0]
            key = (first["board"], first["code"])
            found.setdefault(key, []).append(first["ms"])
            own[key] += bool(case.fault) and typed_text.parse(str(case.fault)).place.startswith(first["board"] + ".")
    return [
        {
            "board": board,
            "code": code,
            "first": len(times),
            "own_board": own[board, code],
            "median_ms": sorted(times)[len(times) // 2],
        }
        for (board, code), times in sorted(found.items(), key=lambda each: -len(each[1]))
    ]


def worst(valid: Sequence[Row]) -> list[Row]:
    """The worst cases, worst first; earlier falls before later ones."""
    once = {result["key"]: (case, result) for case, result in valid}.values()  # a search may repeat a point
    bad = [row for row in once if SEVERITY[row[1]["outcome"]] >= SEVERITY["degraded"]]
    return sorted(bad, key=lambda row: -severity(row[1]))[:WORST]


def worst_row(plan: Plan, row: Row) -> dict[str, Any]:
    """A case for the list of worst ones."""
    case, result = row
    return {
        "key": result["key"],
        "fault": case.fault,
        "axes": {name: value for name, value in case.axes.items() if name != "fault"},
        "outcome": result["outcome"],
        "why": result.get("why", ""),
        "fall_ms": result.get("fall_ms"),
        "detected": result["detected"][0] if result.get("detected") else None,
        "replay": replay(plan, row),
    }


def replay(plan: Plan, row: Row) -> str:
    """A command that runs the case again from power-up."""
    case, result = row
    options = plan.subject.walk_options(case.settings)
    if not case.fault or options is None:
        return f"ranger-sim campaign {shlex.quote(plan.path)} --replay {result['key']}"
    parts = ["ranger-sim", "walk", "--fault", case.fault]
    if plan.fault_module is not None:
        parts += ["--fault-module", plan.fault_module]
    parts += options
    began = (result.get("fault") or {}).get("activated_s")
    since_s = plan.watch.from_s if began is None else began
    parts += ["--time", f"{since_s + plan.watch.after_s:.3f}s"]
    return shlex.join(parts)


def flat(plan: Plan, row: Row) -> dict[str, Any]:
    """A run as a line of a table of numbers and texts."""
    case, result = row
    fault = result.get("fault") or {}
    first = result["detected"][0] if result.get("detected") else {}
    parts = typed_text.parse(case.fault) if case.fault else None
    requirement = {
        "key": result["key"],
        "place": parts.place if parts else "",
        "mode": parts.mode if parts else "",
        "fault": case.fault or "",
        **{name: value for name, value in case.axes.items() if name != "fault"},
        "outcome": result["outcome"],
        "why": result.get("why", ""),
        "acted": fault.get("acted"),
        "largest_difference": fault.get("largest_difference"),
        "unit": fault.get("unit"),
        "first_firmware": name_of(result.get("first_firmware")),
        "first_firmware_ms": (result.get("first_firmware") or {}).get("ms"),
        "detected_by": f"{first['code']} from {first['board']}" if first else "",
        "detection_ms": first.get("ms"),
        "reaction": reaction_text(result.get("reaction")),
        "reaction_ms": (result.get("reaction") or {}).get("ms"),
        "fall_ms": result.get("fall_ms"),
        "deviation": result.get("deviation"),
        **(result.get("gait") or {}),
        **{f"{board}_slot_margin": each["margin"] for board, each in (result.get("slots") or {}).items()},
        **{f"{board}_overruns": each["overruns"] for board, each in (result.get("slots") or {}).items()},
        "digest": (result.get("digest") or "")[:16],
        "replay": replay(plan, row),
    }
    return requirement


def name_of(difference: dict[str, Any] | None) -> str:
    """Where the firmware first differed."""
    return f"{difference['name']} on {difference['where']}" if difference else ""


def reaction_text(reaction: dict[str, Any] | None) -> str:
    """The machine that first differed."""
    return f"{reaction['machine']}: {reaction['state']}, not {reaction['instead_of']}" if reaction else ""
