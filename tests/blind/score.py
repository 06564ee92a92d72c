"""What a diagnosis is worth, from its answers and the truth: `python -m tests.blind.score --truth DIR --answers DIR`.

    truth/ID.json      written by the generator
    answers/ID.json    what `ranger-sim diagnose ... --json` says of the case; a missing one counts as wrong

Every figure comes with how many cases it rests on and its 95 % interval (Clopper and Pearson for shares; order
statistics for a median and a percentile) next to its target.

What counts as named: the causes of an answer that does not abstain. A set: the causes with all that they are tied with.
What theory cannot distinguish is not asked for: a cause with a twin in the truth (`ties`, cosine above 0.95) is outside
the first cause's figures and inside those of ties; an effect outside the catalogue that looks like a cause is left out.
Parameters: the first one of a cause, which is its size. The gain is the answer's own word; next to it is what the
truth says of it, for effects that grow with their size: an effect of size s, modelled with s', leaves (1 - s'/s)^2 of
its square on whatever run. A wrong phase or time constant is not in that figure.
"""

import argparse
import dataclasses
import json
import pathlib

import numpy as np
from scipy import stats

from tests.blind.generator.effects import EFFECTS

LEVEL = 0.95
APART = 0.84  # cosine whose square is the 70 % of an effect that a name must explain
# An answer may call a subsystem by the letter of its balance or by a word.
LETTER = {
    "electrical": "E",
    "motor": "E",
    "winding": "E",
    "mechanical": "M",
    "friction": "M",
    "joint": "M",
    "transmission": "T",
    "gearbox": "T",
    "cable": "T",
    "redundancy": "S",
    "sensor": "S",
    "sensors": "S",
    "angle_sensing": "S",
    "current_sensing": "E",
    "firmware": "C",
    "command": "C",
    "power": "P",
    "timing": "t",
    "time": "t",
}


# Causes that sit in an instrument, in whatever balance they show: an answer may say so.
IN_A_SENSOR = {
    "current_step_at_zero_duty",
    "sensor_scale",
    "sensor_offset",
    "sensor_lag",
    "voltage_clip",
    "eccentricity",
    "lost_counts",
    "clock_drift",
}
# Other words for a cause's size: {(cause, parameter of the truth): (parameter of an answer, factor, summand)}, and two
# components of which the size is the length.
SAME = {
    ("sensor_offset", "value"): ("offset_A", 1.0, 0.0),
    ("sensor_scale", "factor"): ("change", 1.0, 1.0),
    ("current_step_at_zero_duty", "step_A"): ("offset_A", 2.0, 0.0),
    ("cable_backlash", "gap_rad"): ("half_gap_rad", 2.0, 0.0),
    ("lost_counts", "fraction"): ("share", 1.0, 0.0),
    ("clock_drift", "drift"): ("share", 1.0, 0.0),
    ("presliding", "deflection_rad"): ("slide_rad", 1.0, 0.0),
}
COMPONENTS = {
    "amplitude_Nm": ("cosine_Nm", "sine_Nm"),
    "fraction": ("cosine", "sine"),
    "once_rad": ("cosine_rad", "sine_rad"),
}
# The generator's coefficient of temperature is relative, per kelvin: R (1 + per_K (T - 25)), and K alike. An answer
# gives the slope itself, per kelvin of the housing where that is measured: ohm or N m/A per kelvin. R and K of the base
# model hold at 25 C in both, so that per_K is the slope over them: {cause: (slope, base parameter)}. An answer whose
# heat is the current squared (a time constant above 0) knows no kelvin, and is not compared.
PER_KELVIN = {
    "resistance_temperature": ("ohm_per_heat", "resistance_ohm"),
    "torque_constant_temperature": ("per_heat", "torque_constant_Nm_per_A"),
}


PROPORTIONAL = {name for name, effect in EFFECTS.items() if effect.linear}  # what they add grows with their size


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure: value (None without a case), 95 % interval, cases; its target and whether that is a floor."""

    name: str
    value: float | None
    low: float | None
    high: float | None
    cases: int
    target: float | None = None
    at_least: bool = True
    successes: int | None = None

    @property
    def meets(self):
        """Whether the value keeps its target; None without either."""
        if self.value is None or self.target is None:
            return None
        return self.value >= self.target if self.at_least else self.value <= self.target


def share_interval(successes, cases):
    """Exact interval of a share (Clopper and Pearson 1934)."""
    tail = 0.5 * (1.0 - LEVEL)
    low = 0.0 if successes == 0 else float(stats.beta.ppf(tail, successes, cases - successes + 1))
    high = 1.0 if successes == cases else float(stats.beta.ppf(1.0 - tail, successes + 1, cases - successes))
    return low, high


def share(name, hits, target=None, at_least=True):
    """A Figure from one truth value per case."""
    hits = [bool(hit) for hit in hits]
    if not hits:
        return Figure(name, None, None, None, 0, target, at_least)
    count = sum(hits)
    return Figure(
        name, count / len(hits), *share_interval(count, len(hits)), len(hits), target, at_least, successes=count
    )


def quantile(name, values, part, target=None, at_least=True):
    """A Figure of a quantile, its interval from order statistics."""
    values = np.sort(np.asarray(values, dtype=float))
    n = len(values)
    if n == 0:
        return Figure(name, None, None, None, 0, target, at_least)
    tail = 0.5 * (1.0 - LEVEL)
    low = int(max(stats.binom.ppf(tail, n, part) - 1, 0))
    high = int(min(stats.binom.ppf(1.0 - tail, n, part), n - 1))
    return Figure(name, float(np.quantile(values, part)), float(values[low]), float(values[high]), n, target, at_least)


def mean(name, values, target=None, at_least=True):
    """A Figure of a mean, its interval from the normal law."""
    values = np.asarray(values, dtype=float)
    if len(values) == 0:
        return Figure(name, None, None, None, 0, target, at_least)
    spread = 1.96 * float(np.std(values, ddof=1)) / np.sqrt(len(values)) if len(values) > 1 else float("inf")
    middle = float(np.mean(values))
    return Figure(name, middle, middle - spread, middle + spread, len(values), target, at_least)


class Answer:
    """One diagnosis; `data`: its JSON, or None where there is none."""

    def __init__(self, data):
        self.given = data is not None
        data = data or {}
        self.detected = bool(data.get("detected", False))
        self.abstained = bool(data.get("abstained", False))
        self.subsystem = data.get("subsystem")
        self.causes = list(data.get("causes") or []) if self.detected and not self.abstained else []
        self.gain = (data.get("gain") or {}).get("fraction_of_achievable")
        evidence = data.get("evidence") or {}
        self.suspects = list(evidence.get("suspects") or [])
        self.base = evidence.get("parameters") or {}

    def names(self):
        return [cause["name"] for cause in self.causes]

    def groups(self):
        """Each cause with what it is tied with."""
        return [{cause["name"], *(cause.get("tied_with") or [])} for cause in self.causes]

    def reported(self):
        """All names, with ties."""
        return set().union(*self.groups()) if self.causes else set()

    def parameter(self, cause, name):
        """(value, ci95 or None) of a cause's parameter, or None; by other words for it or components too."""
        given = next((entry.get("parameters") or {} for entry in self.causes if entry["name"] == cause), {})
        if name in given:
            return _value(given[name])
        other, factor, summand = SAME.get((cause, name), ("", 1.0, 0.0))
        if other in given and (found := _value(given[other])):
            value, interval = found
            return factor * value + summand, interval and [factor * end + summand for end in interval]
        if name == "per_K":
            return self._per_kelvin(cause, given)
        parts = [_value(given[part]) for part in COMPONENTS.get(name, ()) if part in given]
        if len(parts) == 2 and all(parts):
            return float(np.hypot(parts[0][0], parts[1][0])), self._of_amplitude(cause, COMPONENTS[name][0])
        return None

    def _of_amplitude(self, cause, cosine):
        """The interval of an amplitude, which an answer gives next to the components; None without one."""
        waves = next((entry.get("waves") or {} for entry in self.causes if entry["name"] == cause), {})
        return waves.get("amplitude" + cosine.removeprefix("cosine"), {}).get("ci95")

    def _per_kelvin(self, cause, given):
        """A slope over its base parameter, whose own error (of tenths of a per cent) is negligible for the slope."""
        slope, base = PER_KELVIN.get(cause, ("", ""))
        heat = _value(given.get("time_constant_s", {"value": 0.0}))
        found, over = _value(given.get(slope, {})), _value(self.base.get(base, {}))
        if found is None or over is None or not over[0] > 0.0 or heat is None or heat[0] != 0.0:
            return None
        value, interval = found
        return value / over[0], interval and [end / over[0] for end in interval]


def _value(entry):
    """(value, ci95 or None) of an answer's parameter, or None."""
    return None if entry.get("value") is None else (float(entry["value"]), entry.get("ci95"))


def subsystem_is_right(answer, truth):
    """Whether an answer's subsystem is one in which the cause acts."""
    word = answer.subsystem
    if not isinstance(word, str):
        return False
    cause = truth["causes"][0]
    letter = word if len(word) == 1 else LETTER.get(word, "")
    right = set(cause["balance"]) | ({"T"} if "S" in cause["balance"] else set())
    if "T" in right:
        right.add("S")  # an angle against another angle: one balance on a bench with two of them
    if cause["name"] in IN_A_SENSOR:
        right.add("S")
    return word == cause["subsystem"] or letter in right


def relative_error(cause, name, value):
    """Of a parameter; a scale's error is that of its distance from 1."""
    true = cause["parameters"][name]
    if name == "factor":
        return abs((value - 1.0) / (true - 1.0) - 1.0)
    return abs(value / true - 1.0)


def matched(groups, wanted):
    """(how many of the wanted names are met each by its own group, groups that meet none).

    Two effects, so trying every order is cheap.
    """
    best, extra = 0, len(groups)
    for order in ((0, 1), (1, 0)):
        free = list(groups)
        met = 0
        for i in order[: len(wanted)]:
            hit = next((group for group in free if wanted[i] in group), None)
            if hit is not None:
                free.remove(hit)
                met += 1
        if met > best:
            best, extra = met, len(free)
    return best, extra


def score(truths, answers):
    """[Figure] for {id: truth} and {id: answer's JSON}; an id without an answer counts as wrong."""
    cases = [(truth, Answer(answers.get(key))) for key, truth in truths.items()]
    nulls = [(t, a) for t, a in cases if t["kind"] == "null"]
    singles = [(t, a) for t, a in cases if t["kind"] in ("single", "confusable")]
    pairs = [(t, a) for t, a in cases if t["kind"] == "pair"]
    outside = [(t, a) for t, a in cases if t["kind"] == "outside"]

    def at(*strengths):
        return [(t, a) for t, a in singles if t["causes"][0]["strength"] in strengths]

    def name(truth):
        return truth["causes"][0]["name"]

    def sized(*strengths):
        """(truth, answer, size found, its interval, size hidden) of single effects that are named rightly."""
        for t, a in at(*strengths):
            for parameter, true in list(t["causes"][0]["parameters"].items())[:1]:
                if (found := a.parameter(name(t), parameter)) is not None:
                    yield t, parameter, *found, true

    figures = [share("answers missing", [not a.given for _, a in cases], 0.0, False)]
    figures.append(share("false alarms", [a.detected or not a.given for _, a in nulls], 0.02, False))
    for variant in ("plain", "parameters", "noise"):
        chosen = [a.detected or not a.given for t, a in nulls if t["variant"] == variant]
        figures.append(share(f"false alarms, {variant}", chosen, None, False))
    for strength, target in ((0.5, None), (1.0, None), (2.0, 0.97), (4.0, 0.99)):
        figures.append(share(f"detection at {strength:g}", [a.detected for _, a in at(strength)], target))
    for strength, target in ((0.5, None), (1.0, None), (2.0, 0.85), (4.0, 0.95)):
        hits = [a.names()[:1] == [name(t)] for t, a in at(strength) if a.detected and not t["ties"]]
        figures.append(share(f"top-1 cause at {strength:g}", hits, target))
    strong = [(t, a) for t, a in at(2.0, 4.0) if a.detected]
    figures.append(share("right subsystem", [subsystem_is_right(a, t) for t, a in strong], 0.95))
    figures.append(share("truth in the set", [name(t) in a.reported() for t, a in strong], 0.95))
    figures.append(mean("size of the set", [len(a.reported()) for _, a in strong if a.reported()], 1.5, False))
    tied = [any(name(t) in group and group & set(t["ties"]) for group in a.groups()) for t, a in strong if t["ties"]]
    figures.append(share("confusable pair declared a tie", tied, 0.90))

    covered = []
    for strength, target in ((2.0, 0.10), (4.0, 0.05)):
        errors = []
        for t, parameter, value, interval, true in sized(strength):
            errors.append(relative_error(t["causes"][0], parameter, value))
            if interval is not None:
                covered.append(interval[0] <= true <= interval[1])
        figures.append(quantile(f"parameter error at {strength:g}, median", errors, 0.5, target, False))
    figures.append(share("coverage of 95 % intervals", covered, 0.90))
    figures.append(share("coverage of 95 % intervals, at most", covered, 0.98, False))

    gains = [a.gain for t, a in strong if a.gain is not None and name(t) in a.reported()]
    figures.append(quantile("gain fraction, median", gains, 0.5, 0.90))
    figures.append(quantile("gain fraction, 10th percentile", gains, 0.1, 0.70))
    by_size = [
        1.0 - relative_error(t["causes"][0], parameter, value) ** 2
        for t, parameter, value, _, _ in sized(2.0, 4.0)
        if name(t) in PROPORTIONAL
    ]
    figures.append(quantile("gain by the hidden size, median", by_size, 0.5))
    figures.append(quantile("gain by the hidden size, 10th percentile", by_size, 0.1))
    every_gain = [a.gain for _, a in cases if a.gain is not None]
    figures.append(share("extended model worse", [gain < 0.0 for gain in every_gain], 0.01, False))

    met = [matched(a.groups(), [cause["name"] for cause in t["causes"]]) for t, a in pairs]
    figures.append(share("two effects exact", [found == 2 and extra == 0 for found, extra in met], 0.70))
    figures.append(share("two effects, one or more spurious", [extra > 0 for _, extra in met], 0.10, False))
    figures.append(share("outside: detection", [a.detected for _, a in outside]))
    figures.append(share("outside: abstains", [a.detected and a.abstained for t, a in outside if not t["ties"]], 0.85))
    figures.append(share("outside: wrong name", [bool(a.names()) for t, a in outside if not t["ties"]], 0.05, False))
    apart = [a for t, a in outside if max(t.get("cosines", {}).values(), default=0.0) < APART]
    figures.append(share("outside, apart from all: abstains", [a.detected and a.abstained for a in apart]))
    for letter in "EMT":
        chosen = [a.detected for t, a in at(4.0) if main_balance(t) == letter]
        figures.append(share(f"detection at 4, balance {letter}", chosen))
    return figures


def main_balance(truth):
    """The balance in which a single effect shows most."""
    shares = truth["causes"][0]["share_by_balance"]
    return max(shares, key=shares.get)


def table(figures):
    """The figures as text for a person."""
    lines = [f"{'figure':40s} {'value':>7s}  {'95 % interval':17s} {'cases':>5s}  target"]
    for figure in figures:
        if figure.value is None:
            lines.append(f"{figure.name:40s} {'-':>7s}  {'':17s} {0:5d}")
            continue
        target = ""
        if figure.target is not None:
            target = f"{'>=' if figure.at_least else '<='} {figure.target:g}{'' if figure.meets else '  MISSED'}"
        interval = f"{figure.low:.3f} ... {figure.high:.3f}"
        lines.append(f"{figure.name:40s} {figure.value:7.3f}  {interval:17s} {figure.cases:5d}  {target}".rstrip())
    return "\n".join(lines)


def read_folder(folder):
    """{ID: content} of the JSON files in a folder."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))}


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m tests.blind.score", description=__doc__.splitlines()[0])
    parser.add_argument("--truth", type=pathlib.Path, required=True)
    parser.add_argument("--answers", type=pathlib.Path, required=True)
    parser.add_argument("--json", type=pathlib.Path, help="the figures, for a program")
    options = parser.parse_args(arguments)
    figures = score(read_folder(options.truth), read_folder(options.answers))
    print(table(figures))
    if options.json:
        options.json.write_text(json.dumps([dataclasses.asdict(f) for f in figures], indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
