"""Tables of the matrix's answers, in Markdown."""

import collections
import itertools
import statistics

from scipy.stats import beta

from tests.sysid.matrix.cells import CELLS, FACTORS

WORSE = 0.5  # of a score: below it a larger effect counts as scored lower. Noise alone moves a large one by less


def short(record):
    """One answer in a few words."""
    if record["refused"]:
        return f"refused: {record['refused']}"
    nothing = "above its noise floor" if record.get("unexplained") else "nothing"
    return " + ".join(record["causes"]) or ("abstains" if record["detected"] else nothing)


def alarm(record):
    """Whether a record says that something is wrong: exit code 1 or 3."""
    return record["detected"] or record.get("unexplained", False)


def at_most(count, of):
    """95 % upper limit of a rate (Clopper and Pearson), count of them seen."""
    return 1.0 if count == of else float(beta.ppf(0.975, count + 1, of - count))


def alarms_by_cell(answers):
    """{cell's name: (alarms, cases, what was named)} of the sound ones."""
    found = collections.OrderedDict((each.name, [0, 0, collections.Counter()]) for each in CELLS)
    for each in answers:
        if not each["hidden"]:
            row = found[each["cell"]]
            row[0] += alarm(each)
            row[1] += 1
            row[2].update([short(each)] if alarm(each) else [])
    return {name: row for name, row in found.items() if row[1]}


def by_level(answers):
    """Rows (factor, level, alarms, cases) of the sound ones."""
    names = list(FACTORS)
    for place, factor in enumerate(names):
        for level in FACTORS[factor]:
            met = [each for each in answers if not each["hidden"] and each["cell"].split()[place] == str(level)]
            if met:
                yield factor, level, sum(alarm(each) for each in met), len(met)


def by_strength(answers):
    """{(machine, effect): {strength: answers}}."""
    found = collections.defaultdict(lambda: collections.defaultdict(list))
    for each in answers:
        if each["hidden"]:
            found[each["cell"].split()[0], each["hidden"]][each["strength"]].append(each)
    return found


def worse(answers):
    """(cell, effect, seed, smaller, larger, how): a larger effect whose answer is worse than a smaller one's."""
    runs = collections.defaultdict(dict)
    for each in answers:
        if each["hidden"]:
            runs[each["cell"], each["hidden"], each["seed"]][each["strength"]] = each
    for key, found in runs.items():
        for small, large in itertools.pairwise(sorted(found)):
            before, after = found[small], found[large]
            if before["detected"] and not after["detected"]:
                yield *key, small, large, "not seen"
            elif before["right"] and not (after["right"] or after["tied"]):
                yield *key, small, large, f"named {short(after)}"
            elif before["right"] and after["right"] and after["bic"] < WORSE * before["bic"]:
                yield *key, small, large, f"score {before['bic']:.0f}, then {after['bic']:.0f}"


def markdown(answers):
    lines = []
    sound = alarms_by_cell(answers)
    if sound:
        lines += ["", "| cell | alarms | what was named |", "|---|---|---|"]
        for name, (alarms, cases, named) in sound.items():
            what = "; ".join(f"{each} ({count})" if count > 1 else each for each, count in named.most_common(3))
            lines.append(f"| {name} | {alarms} of {cases} | {what} |")
        alarms, cases = (sum(row[place] for row in sound.values()) for place in (0, 1))
        lines += ["", f"{alarms} alarms in {cases} sound cases: at most {at_most(alarms, cases):.1%} (95 %).", ""]
        lines += ["| factor | level | alarms |", "|---|---|---|"]
        lines += [f"| {factor} | {level} | {a} of {n} |" for factor, level, a, n in by_level(answers)]
    effects = by_strength(answers)
    if effects:
        lines += [
            "",
            "| machine, effect | strength | detected | named first | tied | interval holds | held-out error, left |",
        ]
        lines.append("|---|---|---|---|---|---|---|")
        for (machine, effect), strengths in effects.items():
            for strength, found in sorted(strengths.items()):
                lines.append(f"| {machine}, {effect} | {strength:g} | {_of_effect(found)} |")
        bad = list(worse(answers))
        lines += ["", f"A larger effect with a worse answer: {len(bad)} of {sum(1 for _ in _steps(answers))} steps."]
        lines += [f"- {cell}, {name}, seed {seed}: {a:g} to {b:g}: {how}" for cell, name, seed, a, b, how in bad]
    if answers:
        lines += ["", f"Processor per answer, median: {statistics.median(each['cpu_s'] for each in answers):.1f} s."]
    return "\n".join(lines) + "\n"


def _steps(answers):
    """Pairs of neighbouring strengths of one case."""
    runs = collections.defaultdict(set)
    for each in answers:
        if each["hidden"]:
            runs[each["cell"], each["hidden"], each["seed"]].add(each["strength"])
    return itertools.chain.from_iterable(itertools.pairwise(sorted(each)) for each in runs.values())


def _of_effect(found):
    count = len(found)
    held = [each["inside"] for each in found if "inside" in each]
    left = [
        sum(error[1] for error in each["errors"].values()) / sum(error[0] for error in each["errors"].values())
        for each in found
        if each.get("errors") and sum(error[0] for error in each["errors"].values()) > 0.0
    ]
    cells = [f"{sum(each[name] for each in found)} of {count}" for name in ("detected", "right", "tied")]
    cells.append(f"{sum(held)} of {len(held)}" if held else "")
    cells.append(f"{statistics.median(left):.0%}" if left else "")
    return " | ".join(cells)
