"""What a fault did, compared with the golden run: the same scenario without it.

Terms. *Acted*: the value at the fault's place differed from the unfaulted one. *No effect*: it acted, and the firmware
shows no difference: not in a frame on a bus, not in the main brain's variables, not in the boards' error counts (state
that a board never sends is not visible). *Masked*: the firmware differs, the outcome does not. *Detected*:
an error code, or its rate, that healthy walks do not have. *Invalid*: the fault never acted; that proves nothing.

Healthy walks raise errors too, thousands of them. So an error detects a fault only if no healthy walk has its code, or
if more of it occurred within a time than `RATE_FACTOR` times the most that any healthy walk had within a time of that
length, and `RATE_MORE` on top (`Healthy`). `false_alarms` counts how often that rule alone gives a false alarm.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from ranger_sim.harness.faults.evidence import Record
from ranger_sim.harness.names import Names

NS_PER_MS = 1e6
# A code that healthy walks have detects a fault when it occurs twice as often as in the worst of them, and five times
# more: chosen by us, because one healthy walk's bursts of MC_INTEG_SATUR are half as long again as those of two others;
# every campaign counts how often this still gives false alarms.
RATE_FACTOR = 2.0
RATE_MORE = 5
# Counts at which rates are checked: each of the first ones, then a tenth further each time.
EACH_COUNT_TO = 32
COUNT_GROWTH = 1.1


Key = tuple[str, int]  # board, error code


@dataclasses.dataclass(frozen=True)
class Difference:
    """What differs first: `where` (a bus, "errors", "body", the board whose memory is logged), `name`, values."""

    where: str
    name: str
    time_ns: int
    golden: float | None
    faulty: float | None


@dataclasses.dataclass(frozen=True)
class Detection:
    """An error that reveals the fault. `rate`: healthy walks have the code too, but less often."""

    board: str
    code: str
    time_ns: int
    rate: bool


@dataclasses.dataclass(frozen=True)
class Reaction:
    """A state machine in another state than in the golden run."""

    machine: str
    state: str
    instead_of: str
    time_ns: int


@dataclasses.dataclass(frozen=True)
class Proof:
    """The whole result. Times are ns; `*_ms` count from the fault's activation. None: it did not happen.

    reaction: the first machine that is in another state than golden at the same time; after small differences that is
    soon a mere shift in time. unusual: the first change of state that no healthy walk has.
    """

    acted: bool
    activated_ns: int
    first: Difference | None
    first_firmware: Difference | None
    detections: tuple[Detection, ...]
    reaction: Reaction | None
    unusual: Reaction | None
    fell_ns: int | None
    fall_cause: str

    @property
    def detected(self) -> Detection | None:
        """The first error that reveals the fault."""
        return self.detections[0] if self.detections else None

    def after_ms(self, what: Difference | Detection | Reaction | None) -> float | None:
        """How long after the fault's activation, in ms."""
        return None if what is None else (what.time_ns - self.activated_ns) / NS_PER_MS

    @property
    def detection_ms(self) -> float | None:
        """Activation to the first error that reveals it."""
        return self.after_ms(self.detected)

    @property
    def reaction_ms(self) -> float | None:
        """Activation to the first other state."""
        return self.after_ms(self.reaction)

    @property
    def fall_ms(self) -> float | None:
        """Activation to the fall."""
        return None if self.fell_ns is None else (self.fell_ns - self.activated_ns) / NS_PER_MS

    def summary(self) -> dict[str, Any]:
        """As `walk --proof` stores it: names, and ms after the activation; None for what did not happen."""
        first, detection, reacted = self.first_firmware, self.detected, self.reaction
        return {
            "first_difference": first and {"where": first.where, "name": first.name, "after_ms": self.after_ms(first)},
            "detected": detection and {"code": detection.code, "board": detection.board, "rate": detection.rate},
            "detection_ms": self.detection_ms,
            "reaction": reacted
            and {"machine": reacted.machine, "state": reacted.state, "instead_of": reacted.instead_of},
            "reaction_ms": self.reaction_ms,
            "fall_ms": self.fall_ms,
        }


def prove(golden: Record, faulty: Record, activated_ns: int, acted: bool, healthy: "Healthy | None" = None) -> Proof:
    """Compare the faulty run with the golden one. Both begin at one time, before the fault; golden ends no earlier.

    healthy: what healthy walks raise; without it the golden run and the master table define what is normal.
    """
    normal = healthy if healthy is not None else Healthy.of([golden], normal_per_s(golden.names))
    firmware = [
        *frame_differences(golden, faulty),
        *word_differences(golden, faulty),
        *error_differences(golden, faulty),
    ]
    return Proof(
        acted=acted,
        activated_ns=activated_ns,
        first=earliest([*firmware, *body_differences(golden, faulty)]),
        first_firmware=earliest(firmware),
        detections=tuple(normal.detections(faulty, activated_ns)) if acted else (),
        reaction=reaction(golden, faulty),
        unusual=normal.unusual_change(faulty, activated_ns),
        fell_ns=faulty.fell_ns if faulty.fell_ns >= 0 else None,
        fall_cause=faulty.fall_cause,
    )


def normal_per_s(names: Names) -> dict[Key, float]:
    """The normal errors per second by board and number, from the master table's column."""
    rates = names.normal_per_s.items()
    return {(board, code): rate for code, boards in rates for board, rate in boards.items()}


def earliest(differences: Iterable[Difference]) -> Difference | None:
    """The first of them; of those at one time the one listed first."""
    return min(differences, key=lambda each: each.time_ns, default=None)


# --- what differs ---------------------------------------------------------------------------------------------------


def first_other_row(golden: np.ndarray, faulty: np.ndarray) -> int | None:
    """Index of the first row that differs; None when the shorter is a prefix of the longer."""
    common = min(len(golden), len(faulty))
    differs = np.flatnonzero((golden[:common] != faulty[:common]).any(axis=1))
    return int(differs[0]) if len(differs) else None


def frame_differences(golden: Record, faulty: Record) -> Iterable[Difference]:
    """The first frame of each bus that differs in content or time, until the faulty run's end."""
    for bus, rows in faulty.frames.items():
        # a frame under way at the end is in the stream of the run that has decided on it already
        reference, rows = (each[each[:, 0] <= faulty.end_ns] for each in (golden.frames[bus], rows))
        place = first_other_row(reference, rows)
        if place is None:
            if len(reference) == len(rows):
                continue
            place = min(len(reference), len(rows))
        here = rows[place] if place < len(rows) else None
        there = reference[place] if place < len(reference) else None
        first = min((row for row in (there, here) if row is not None), key=lambda row: int(row[0]))
        number = int(first[2]) & 0x1FFFFFFF
        same = here is not None and there is not None and int(here[2]) & 0x1FFFFFFF == int(there[2]) & 0x1FFFFFFF
        yield Difference(
            bus,
            faulty.names.variables.get(number, f"frame {number:X}"),
            int(first[0]),
            frame_value(faulty.names, number, there) if same else None,
            frame_value(faulty.names, number, here) if same else None,
        )


def frame_value(names: Names, number: int, row: Any) -> float | None:
    """The variable's value in a frame, None for what is not a variable."""
    return float(names.value(number, (int(row[1]) >> 12) & 0xFFFFFFFF)) if number in names.types else None


def word_differences(golden: Record, faulty: Record) -> Iterable[Difference]:
    """The first variable of the logged memory that differs."""
    place = first_other_row(golden.words, faulty.words)
    if place is not None:
        column = int(np.flatnonzero(golden.words[place] != faulty.words[place])[0])
        number = column - 1
        names = faulty.names
        there, here = (float(names.value(number, int(run.words[place, column]))) for run in (golden, faulty))
        yield Difference(faulty.memory, names.variables.get(number, "?"), int(faulty.words[place, 0]), there, here)


def error_differences(golden: Record, faulty: Record) -> Iterable[Difference]:
    """The first error that occurred in one run and not in the other."""
    reference = golden.errors[golden.errors[:, 0] < faulty.end_ns]
    rows = faulty.errors[faulty.errors[:, 0] < faulty.end_ns]
    place = first_other_row(reference, rows)
    if place is None:
        if len(reference) == len(rows):
            return
        place = min(len(reference), len(rows))
    # rows of one time are in order of board and code: the lower one is missing in the other run
    row = min((run[place] for run in (reference, rows) if place < len(run)), key=lambda each: tuple(each[:3]))
    name = f"{faulty.boards[int(row[1])]} {faulty.names.errors.get(int(row[2]), int(row[2]))}"
    yield Difference("errors", name, int(row[0]), None, None)


def body_differences(golden: Record, faulty: Record) -> Iterable[Difference]:
    """The first quantity of the body that differs."""
    place = first_other_row(golden.samples, faulty.samples)
    if place is not None:
        column = int(np.flatnonzero(golden.samples[place] != faulty.samples[place])[0])
        name = faulty.quantities[column - 1] if column else "time"
        time_ns = round(float(faulty.samples[place, 0]) * 1e9)
        yield Difference(
            "body", name, time_ns, float(golden.samples[place, column]), float(faulty.samples[place, column])
        )


def reaction(golden: Record, faulty: Record) -> Reaction | None:
    """The first machine whose state is not golden's at that time."""
    common = min(len(golden.words), len(faulty.words))
    found = None
    for machine in faulty.machines:
        there, here = golden.machine(machine)[:common], faulty.machine(machine)[:common]
        differs = np.flatnonzero(there != here)
        if len(differs) and (found is None or differs[0] < found[0]):
            found = (int(differs[0]), machine, int(here[differs[0]]), int(there[differs[0]]))
    if found is None:
        return None
    place, machine, now, then = found
    names = faulty.machines[machine].states
    return Reaction(machine, names.get(now, str(now)), names.get(then, str(then)), int(faulty.words[place, 0]))


# --- what is normal -------------------------------------------------------------------------------------------------


class Healthy:
    """What walks without a fault raise.

    counts: numbers of errors at which rates are known; spans: {(board, code): the shortest time (ns) in which any
    healthy walk had that number, one per count, largest number where none had}. changes: {machine: {(from, to)}}.
    """

    def __init__(
        self,
        spans: dict[Key, list[int]],
        changes: dict[str, set[tuple[int, int]]],
        per_s: dict[Key, float] | None = None,
    ) -> None:
        self.spans = spans
        self.changes = changes
        self.per_s = per_s if per_s is not None else {}

    @classmethod
    def of(cls, records: Sequence[Record], per_s: dict[Key, float] | None = None) -> "Healthy":
        """From runs without a fault. `per_s`: further errors, and how many of each per second are normal."""
        spans: dict[Key, list[int]] = {}
        changes: dict[str, set[tuple[int, int]]] = {machine: set() for each in records for machine in each.machines}
        for record in records:
            for key, times in event_times(record).items():
                here = shortest_spans(times)
                known = spans.setdefault(key, [])
                longer, shorter = (known, here) if len(known) > len(here) else (here, known)
                spans[key] = [min(a, b) for a, b in zip(longer, shorter, strict=False)] + longer[len(shorter) :]
            for machine, seen in changes.items():
                seen.update(changes_of(record.machine(machine)))
        return cls(spans, changes, per_s)

    def most(self, key: Key, duration_ns: int) -> int:
        """The most errors of this kind that any healthy walk had within this time.

        Below the next count that is checked; beyond the last count that any of them reached, that one.
        """
        spans = self.spans.get(key)
        normal = int(self.per_s.get(key, 0.0) * duration_ns * 1e-9)
        if not spans:
            return normal
        counts = looked_at(len(spans) + 1)
        place = int(np.searchsorted(spans, duration_ns, side="right"))
        return max(normal, counts[place] - 1 if place < len(spans) else counts[len(spans) - 1])

    def knows(self, key: Key) -> bool:
        """Healthy walks have this error of this board."""
        return key in self.spans or key in self.per_s

    def detections(self, record: Record, since_ns: int) -> list[Detection]:
        """The first error of each board and code, from `since_ns` on, that no healthy walk explains; in order."""
        found = []
        for key, times in event_times(record).items():
            times = times[times > since_ns]
            for count in looked_at_below(len(times)):
                duration = int(times[count - 1]) - since_ns
                most = self.most(key, duration)
                if count > (RATE_FACTOR * most + RATE_MORE if self.knows(key) else 0):
                    name = record.names.errors.get(key[1], str(key[1]))
                    found.append(Detection(key[0], name, int(times[count - 1]), self.knows(key)))
                    break
        return sorted(found, key=lambda each: (each.time_ns, each.board, each.code))

    def unusual_change(self, record: Record, since_ns: int) -> Reaction | None:
        """The first change of state from `since_ns` on that no healthy walk has."""
        found = None
        for machine in record.machines:
            states = record.machine(machine)
            places = np.flatnonzero(states[1:] != states[:-1]) + 1
            for place in places[record.words[places, 0] >= since_ns]:
                before, now = int(states[place - 1]), int(states[place])
                if (before, now) not in self.changes[machine]:
                    time_ns, names = int(record.words[place, 0]), record.machines[machine].states
                    if found is None or time_ns < found.time_ns:
                        found = Reaction(machine, names.get(now, str(now)), names.get(before, str(before)), time_ns)
                    break
        return found

    def as_dict(self) -> dict[str, Any]:
        """As plain types for JSON."""
        return {
            "spans": [[board, code, spans] for (board, code), spans in self.spans.items()],
            "changes": {machine: sorted(map(list, seen)) for machine, seen in self.changes.items()},
        }

    @classmethod
    def from_dict(cls, found: dict[str, Any]) -> "Healthy":
        """The same from the result of `as_dict`."""
        changes = {machine: {(a, b) for a, b in seen} for machine, seen in found["changes"].items()}
        return cls({(board, code): spans for board, code, spans in found["spans"]}, changes)

    def merged(self, other: "Healthy") -> "Healthy":
        """What either has recorded."""
        spans = {key: list(each) for key, each in self.spans.items()}
        for key, here in other.spans.items():
            known = spans.get(key, [])
            longer, shorter = (known, here) if len(known) > len(here) else (here, known)
            spans[key] = [min(a, b) for a, b in zip(longer, shorter, strict=False)] + longer[len(shorter) :]
        changes = {
            machine: self.changes.get(machine, set()) | other.changes.get(machine, set())
            for machine in (*self.changes, *other.changes)
        }
        return Healthy(spans, changes)


def all_looked_at() -> Iterator[int]:
    """The counts at which rates are checked: each of the first, then increasingly spaced."""
    count = 0
    while True:
        count = count + 1 if count < EACH_COUNT_TO else int(count * COUNT_GROWTH)
        yield count


def looked_at(places: int) -> list[int]:
    """The first `places` of them."""
    return list(itertools.islice(all_looked_at(), places))


def looked_at_below(total: int) -> Iterable[int]:
    """Those of them up to `total`."""
    return itertools.takewhile(lambda count: count <= total, all_looked_at())


def event_times(record: Record) -> dict[Key, np.ndarray]:
    """When each board noted each error, ns: one entry per error."""
    found = {}
    rows = record.errors
    kinds = rows[:, 1] * 65536 + rows[:, 2]
    for kind in np.unique(kinds):
        of_kind = rows[kinds == kind]
        key = (record.boards[int(kind) // 65536], int(kind) % 65536)
        found[key] = np.repeat(of_kind[:, 0], of_kind[:, 3])
    return found


def shortest_spans(times: np.ndarray) -> list[int]:
    """For each checked count: the shortest time from one error to the one that completes the count."""
    return [int((times[count - 1 :] - times[: len(times) - count + 1]).min()) for count in looked_at_below(len(times))]


def changes_of(states: np.ndarray) -> set[tuple[int, int]]:
    """The changes of state that a machine made."""
    places = np.flatnonzero(states[1:] != states[:-1])
    return {(int(a), int(b)) for a, b in zip(states[places], states[places + 1], strict=True)}


# --- the walk -------------------------------------------------------------------------------------------------------

MOTORS = ("hip", "outer", "inner", "steering")
# Peak currents: what the boards hold each motor to, for its gearhead (robot.md N8.5, boards/hip.py, ankle_board.py,
# steering.py); a current beyond it by a fifth for longer than 10 ms, five times as long as one of a gait's own peaks in
# our walks, is damage: both chosen by us.
PEAK_A = {"hip": 5.0, "outer": 8.0, "inner": 8.0, "steering": 0.3}
PEAK_FACTOR, PEAK_S = 1.2, 0.010
# Heat: the thermal state that the boards keep, a' = I^2 - a / tau, held to 3.1 A for 10 s (0.3 A, steering).
SUSTAINED_A = {"hip": 3.1, "outer": 3.1, "inner": 3.1, "steering": 0.3}
THERMAL_S = 10.0


@dataclasses.dataclass(frozen=True)
class Gait:
    """A walk between two times. None where it made fewer than two steps."""

    steps: int
    step_length_m: float | None
    step_time_s: float | None
    motor_power_W: float

    MEASURES = ("step_length_m", "step_time_s", "motor_power_W")


def gait(record: Record, since_ns: int, until_ns: int | None = None) -> Gait:
    """Means over the steps from `since_ns` on."""
    time = record.samples[:, 0]
    window = time >= since_ns * 1e-9
    if until_ns is not None:
        window &= time <= until_ns * 1e-9
    if not window.any():
        return Gait(0, None, None, 0.0)
    steps = record.sample("steps")[window]
    times, xs = time[window], record.sample("hip_x_m")[window]
    strikes = np.flatnonzero(np.diff(steps) > 0) + 1
    power = sum(np.maximum(record.sample(f"{motor}_W")[window], 0.0).mean() for motor in MOTORS)
    made = int(steps[-1] - steps[0])
    if len(strikes) < 2:
        return Gait(made, None, None, float(power))
    between = int(steps[strikes[-1]] - steps[strikes[0]])
    length = (xs[strikes[-1]] - xs[strikes[0]]) / between
    return Gait(made, float(length), float((times[strikes[-1]] - times[strikes[0]]) / between), float(power))


def damage(record: Record, since_ns: int) -> str:
    """What was overloaded after `since_ns`, in a few words; empty when nothing was."""
    window = record.samples[:, 0] >= since_ns * 1e-9
    time = record.samples[window, 0]
    for motor in MOTORS:
        current = record.sample(f"{motor}_A")[window]
        longest = longest_run(np.abs(current) > PEAK_FACTOR * PEAK_A[motor], time)
        if longest > PEAK_S:
            return f"{motor} motor beyond {PEAK_FACTOR * PEAK_A[motor]:g} A for {1e3 * longest:.0f} ms"
        heat = thermal_state(current, time)
        if heat > PEAK_FACTOR * SUSTAINED_A[motor] ** 2 * THERMAL_S:
            return f"{motor} motor's thermal state at {heat:.0f} A2s"
    return ""


def longest_run(beyond: np.ndarray, time: np.ndarray) -> float:
    """The longest time, s, for which `beyond` holds without a break."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(int)))
    if len(edges) == 0:
        return 0.0
    last = len(time) - 1
    return float(max(time[min(b, last)] - time[a] for a, b in zip(edges[::2], edges[1::2], strict=True)))


def thermal_state(current: np.ndarray, time: np.ndarray) -> float:
    """The largest a of a' = I^2 - a / THERMAL_S, from 0; A2s."""
    if len(time) < 2:
        return 0.0
    grown = np.exp((time - time[0]) / THERMAL_S)  # a e^(t/tau) has the derivative I^2 e^(t/tau)
    integral = np.concatenate(
        [[0.0], np.cumsum(0.5 * ((current**2 * grown)[1:] + (current**2 * grown)[:-1]) * np.diff(time))]
    )
    return float((integral / grown).max())


def false_alarms(records: Sequence[Record], starts_ns: Sequence[int]) -> tuple[int, int, list[Detection]]:
    """(false alarms, trials, which): healthy walks judged by the other ones as if a fault began at each start."""
    alarms: list[Detection] = []
    count = 0
    for number, record in enumerate(records):
        others = Healthy.of([each for place, each in enumerate(records) if place != number])
        for start_ns in starts_ns:
            found = others.detections(record, start_ns)
            count += bool(found)
            alarms += found[:1]
    return count, len(records) * len(starts_ns), alarms
