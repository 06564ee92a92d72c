"""Hidden walks put to the comparison with twins, and counted."""

import dataclasses
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.results import TwinsEvidence
from ranger_sim.sysid.twins import evidence
from ranger_sim.tools.twins.emulation import emulate
from studies.hidden_walks.draw import Hidden, as_row, recorded, tolerance_of
from studies.hidden_walks.kinds import KINDS, Kind

MULTIPLES = (2.0, 4.0, 8.0)  # of the smallest size that the method says it would detect
FLOORS_M = {"level": 0.0, "1 mm": 0.001}
ROWS = ("full", "link", "2015")
TURNS = tuple(range(len(MULTIPLES)))


@dataclasses.dataclass(frozen=True)
class Case:
    """One answer. right: the first cause; tied: the truth is among those that it says it cannot distinguish."""

    kind: str
    multiple: float
    floor: str
    row: str
    truth: str
    size: float
    steps: int
    detected: bool
    named: str
    right: bool
    tied: bool
    holds: bool
    value: float
    low: float
    high: float
    since: int


def visible(row: str, floor: str, seed: int) -> dict[str, float]:
    """The smallest sizes that the method prints for a sound walk: {"cause at place: parameter": size}."""
    found, _ = evidence.of([as_row(recorded(Hidden(None, 0.0, seed, FLOORS_M[floor], 1.0, loose=False)), row)])
    return dict(found.smallest_visible)


def sound(
    rows: Sequence[str],
    floor: str,
    seed: int,
    count: int,
    each: Callable[[str, TwinsEvidence], None] = lambda row, found: None,
) -> dict[str, list[TwinsEvidence]]:
    """Answers by row about sound walks: other seeds, batteries, bodies within tolerance."""
    answers: dict[str, list[TwinsEvidence]] = {row: [] for row in rows}
    for hidden in drawn_sound(floor, seed, count):
        walk = recorded(hidden)
        for row in rows:
            found, _ = evidence.of([as_row(walk, row)], emulator=emulate)
            answers[row].append(found)
            each(row, found)
    return answers


def drawn_sound(floor: str, seed: int, count: int) -> list[Hidden]:
    """Sound walks."""
    draw = generator(seed, f"sound walks on {floor}")
    return [
        Hidden(None, 0.0, int(draw.integers(1, 2**31)), FLOORS_M[floor], float(draw.uniform(0.35, 1.0)))
        for _ in range(count)
    ]


def drawn(kind: Kind, multiple: float, least: float, floor: str, seed: int) -> Hidden:
    """A hidden walk of a kind at a multiple of the smallest visible size."""
    draw = generator(seed, f"{kind.name} {multiple} {floor}")
    sign = 1.0 if kind.one_sided or draw.random() < 0.5 else -1.0
    return Hidden(kind, sign * multiple * least, int(draw.integers(1, 2**31)), FLOORS_M[floor],
                  float(draw.uniform(0.35, 1.0)))  # fmt: skip


def judged(hidden: Hidden, multiple: float, floor: str, rows: Sequence[str]) -> Iterator[Case]:
    """Walks once; judges by every row."""
    assert hidden.kind is not None
    dataset = recorded(hidden)
    for row in rows:
        yield case_of(hidden, multiple, floor, row, evidence.of([as_row(dataset, row)], emulator=emulate)[0])


def case_of(hidden: Hidden, multiple: float, floor: str, row: str, found: TwinsEvidence) -> Case:
    """An answer compared with the truth."""
    kind = hidden.kind
    assert kind is not None
    named = found.named
    text = f"{named.name} at {named.at}" if named else ""
    right = text == kind.right and named is not None and kind.parameter in named.parameters
    tied = kind.right in (*found.ties, *found.never_distinguished)
    value = next(iter(named.parameters.values())) if named else None
    low, high = value.ci95 if value else (0.0, 0.0)
    whole = hidden.size + tolerance_of(hidden)  # what this body differs by, of which the size is found
    return Case(kind.name, multiple, floor, row, kind.right, hidden.size, found.steps, found.detected, text, right,
         tied,
                bool(right and low <= whole <= high), value.value if value else 0.0, low, high,
                     found.since_step)  # fmt: skip


def all_cases(
    seed: int,
    floors: Sequence[str],
    rows: Sequence[str],
    kinds: Sequence[str] = (),
    each: Callable[[Case], None] = lambda case: None,
    turns: Sequence[int] = TURNS,
) -> list[Case]:
    """Every kind at every multiple on every floor, by the full row's smallest sizes.

    turns: a turn has every kind once on each floor, at a multiple that changes from kind to kind, from floor to floor
    and from turn to turn; all turns have every kind at every multiple.
    """
    found = []
    least = {floor: visible("full", floor, seed) for floor in floors}
    for turn in turns:
        for number, kind in enumerate(KINDS):
            key = f"{kind.right}: {kind.parameter}"
            for floor in floors:
                if key not in least[floor] or (kinds and kind.name not in kinds):
                    continue
                multiple = MULTIPLES[(number + turn + list(FLOORS_M).index(floor)) % len(MULTIPLES)]
                for case in judged(drawn(kind, multiple, least[floor][key], floor, seed), multiple, floor, rows):
                    found.append(case)
                    each(case)
    return found


def table(cases: Sequence[Case], alarms: dict[tuple[str, str], tuple[int, int]]) -> list[dict[str, Any]]:
    """Rates by row, floor and multiple."""
    out = []
    for row in ROWS:
        for floor in FLOORS_M:
            for multiple in MULTIPLES:
                here = [each for each in cases if (each.row, each.floor, each.multiple) == (row, floor, multiple)]
                if not here:
                    continue
                seen = [each for each in here if each.detected]
                right = [each for each in seen if each.right]
                out.append({
                    "row": row, "floor": floor, "multiple": multiple, "walks": len(here), "detected": len(seen),
                    "named": sum(bool(each.named) for each in seen), "right": len(right),
                    "right or tied": sum(each.right or each.tied for each in seen),
                    "holds": sum(each.holds for each in right), "alarms": alarms.get((row, floor)),
                })  # fmt: skip
    return out


def checksum(cases: Sequence[Case]) -> int:
    """Of the answers, to compare two runs."""
    return zlib.crc32(repr(cases).encode())
