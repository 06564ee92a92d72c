"""Which causes are missed, and what they are taken for: the score's cases one cause at a time.

A cell of the table is `first set seen / cases` for one strength: in how many of the cases the cause was named first,
was in the reported set, and anything was detected at all. Below stand the answers that were wrong, with strength and
number of the case: `python -m tests.blind.generate --seed S --count N --slice NUMBER` makes that case again.
"""

import collections
import dataclasses

from tests.blind.score import Answer, matched

STRENGTHS = (0.5, 1.0, 2.0, 4.0)
TELLING = 1.0  # below this strength a miss is what theory expects and is not listed


@dataclasses.dataclass
class Cell:
    """Outcomes of one cause at one strength. right: named first, or in the set where it has a tie in the truth."""

    cases: int = 0
    right: int = 0
    first: int = 0
    in_set: int = 0
    seen: int = 0

    def __str__(self):
        return f"{self.first} {self.in_set} {self.seen}/{self.cases}" if self.cases else "-"


@dataclasses.dataclass
class Row:
    """One cause: a Cell for each strength, and where that was wrong (strength, case's number, the answer)."""

    cause: str
    cells: dict
    wrong: list

    @property
    def lost(self):
        """Cases at strength 2 and 4 in which it was not found: what is to be won here."""
        return sum(cell.cases - cell.right for strength, cell in self.cells.items() if strength >= 2.0)


def outcome(answer):
    """What an answer says, in a few words."""
    if not answer.given:
        return "no answer"
    if not answer.detected:
        return "nothing"
    if answer.abstained or not answer.causes:
        return f"no name ({', '.join(answer.suspects)}?)" if answer.suspects else "no name"
    return " + ".join("=".join([cause["name"], *(cause.get("tied_with") or [])]) for cause in answer.causes)


def singles(truths, answers):
    """[Row], the one with most to be won first. Causes of single and of confusable cases."""
    rows = {}
    for key, truth in truths.items():
        if truth["kind"] not in ("single", "confusable") or truth["causes"][0]["strength"] not in STRENGTHS:
            continue
        answer, (cause,) = Answer(answers.get(key)), truth["causes"]
        label = _label(truth)
        row = rows.setdefault(label, Row(label, {strength: Cell() for strength in STRENGTHS}, []))
        cell = row.cells[cause["strength"]]
        first = answer.names()[:1] == [cause["name"]]
        in_set = cause["name"] in answer.reported()
        right = in_set if truth["ties"] else first
        cell.cases += 1
        cell.right += right
        cell.first += first
        cell.in_set += in_set
        cell.seen += answer.detected
        if not right and cause["strength"] >= TELLING:
            row.wrong.append((cause["strength"], truth["number"], outcome(answer)))
    return sorted(rows.values(), key=lambda row: (-row.lost, row.cause))


def _label(truth):
    """A cause with the place where it sits, and with what it cannot be distinguished from."""
    (cause,) = truth["causes"]
    place = cause.get("at") or cause.get("shape", {}).get("channel", "")
    tied = f" = {', '.join(truth['ties'])}" if truth["ties"] else ""
    return cause["name"] + (f" at {place}" if place else "") + tied


def others(truths, answers):
    """{kind: [(what is hidden, what was answered, [number of the case])]} of nulls, pairs and effects outside.

    Of nulls only the alarms, of pairs and of those outside only what is wrong; the commonest first.
    """
    found = {"null": {}, "pair": {}, "outside": {}}
    for key, truth in truths.items():
        kind = truth["kind"]
        if kind not in found:
            continue
        answer = Answer(answers.get(key))
        names = [cause["name"] for cause in truth["causes"]]
        if kind == "null":
            right = answer.given and not answer.detected
        elif kind == "pair":
            right = matched(answer.groups(), names) == (2, 0)
        else:
            right = (answer.detected and answer.abstained) or bool(truth["ties"])
        if not right:
            said = (" + ".join(sorted(names)) or truth["variant"], outcome(answer))
            found[kind].setdefault(said, []).append(truth["number"])
    return {
        kind: sorted(((*said, sorted(numbers)) for said, numbers in each.items()), key=lambda e: (-len(e[2]), e[0]))
        for kind, each in found.items()
    }


def text(truths, answers):
    """Both tables for a terminal."""
    rows = singles(truths, answers)
    width = max((len(row.cause) for row in rows), default=10) + 2
    lines = [
        "Single effects: named first, in the set, detected / cases, by strength; then wrong answers, strength and case"
    ]
    lines.append("cause".ljust(width) + "".join(f"{strength:g}".ljust(12) for strength in STRENGTHS))
    for row in rows:
        lines.append(row.cause.ljust(width) + "".join(str(row.cells[s]).ljust(12) for s in STRENGTHS).rstrip())
        by_answer = collections.defaultdict(list)
        for strength, number, said in sorted(row.wrong, reverse=True):
            by_answer[said].append(f"{strength:g} #{number}")
        for said, where in sorted(by_answer.items(), key=lambda item: -len(item[1])):
            lines.append(f"    {said}: {', '.join(where)}")
    titles = {
        "null": "False alarms",
        "pair": "Pairs that are not exact",
        "outside": "Outside the catalogue, not abstained",
    }
    for kind, entries in others(truths, answers).items():
        cases = sum(truth["kind"] == kind for truth in truths.values())
        lines += ["", f"{titles[kind]}: {sum(len(numbers) for _, _, numbers in entries)} of {cases}"]
        for hidden, said, numbers in entries:
            lines.append(f"    {hidden}: {said}: {', '.join(f'#{number}' for number in numbers)}")
    return "\n".join(lines)


def markdown(truths, answers):
    """The table of single effects for a document; wrong answers counted, at strengths of 2 and 4."""
    lines = [
        f"| cause | {' | '.join(f'{strength:g}' for strength in STRENGTHS)} | taken for, at 2 and 4 |",
        f"|---|{'---|' * len(STRENGTHS)}---|",
    ]
    for row in singles(truths, answers):
        wrong = collections.Counter(said for strength, _, said in row.wrong if strength >= 2.0)
        taken = ", ".join(f"{said}{f' ({count})' if count > 1 else ''}" for said, count in wrong.most_common())
        cells = (f"{c.right} of {c.cases}" if (c := row.cells[s]).cases else "" for s in STRENGTHS)
        lines.append(f"| {row.cause} | {' | '.join(cells)} | {taken} |")
    return "\n".join(lines)
