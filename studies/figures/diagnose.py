"""The diagnosis from figures: what to simulate, which hypotheses explain the figures, what to measure next.

First the simulation runs unchanged and with each candidate a step up and down; then, round by round, at the best fits
of the best hypotheses, with all candidates at their estimates, until each has been simulated at its claimed place. So
every named cause has been simulated. The project's usual rule decides (docs/diagnose.md): something is wrong when the
figures refuse "nothing is" at 1 % or a hypothesis earns 10 in the Bayesian information criterion; hypotheses within 6
of the best are tied; a candidate is named when every hypothesis of the tie has it; nothing is named when the best one
is refused at 1 % itself.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from ranger_sim.foundation.user_error import UserError
from studies.figures.hypotheses import Evidence, Hypothesis, Judge
from studies.figures.question import Candidate, Figure, Outcome, Point, Question, Simulator
from studies.figures.surface import Array, Surface

DETECTED_P = 0.01
DETECTED_BIC = 10.0
TIE_BIC = 6.0
REFUSED_P = 0.01
NOT_SEPARABLE = 0.95  # |cos| of two signatures, as everywhere in this package
MOST_FREE = 2  # candidates of a hypothesis: a handful of figures supports no more
ROUNDS = 4
PER_ROUND = 3  # hypotheses that are simulated in a round
TOLD = 12  # number of the best pairs that the answer lists
CHECKED = 0.3  # steps: a place nearer than this to a simulated one counts as simulated
PROMISING = 20.0  # of the criterion at a first search: hypotheses farther from the best are not searched again

Tell = Callable[[int, int, str], None]  # runs done, runs planned, purpose


@dataclasses.dataclass
class Simulated:
    """Every simulated place, in steps, and its outcomes; the first is the unchanged simulation."""

    candidates: Sequence[Candidate]
    places: list[Array] = dataclasses.field(default_factory=list)
    outcomes: list[list[Outcome]] = dataclasses.field(default_factory=list)

    def evidence(self, names: Sequence[str], seeds: int) -> Evidence:
        """Surfaces of the figures `names`, and the endurance by place. UserError for a figure that no run showed."""
        surfaces = {name: self._surface(name) for name in names}
        survived = [sum(each.survived for each in runs) for runs in self.outcomes]
        failures = [sum(each.failed for each in runs) for runs in self.outcomes]
        longest = max((each.survived for runs in self.outcomes for each in runs), default=1.0)
        return Evidence(
            surfaces, np.array(self.places), np.array(survived), np.array(failures, dtype=float), seeds * longest
        )

    def _surface(self, name: str) -> Surface:
        runs = [np.array([each.figures[name] for each in at if name in each.figures]) for at in self.outcomes]
        told = [number for number, each in enumerate(runs) if len(each)]
        if not told:
            raise UserError(f"figure {name}: none of {sum(map(len, self.outcomes))} simulated runs reached it")
        return Surface(np.array(self.places)[told], [runs[number] for number in told])

    def nearest(self, place: Array) -> float:
        """Distance to the nearest simulated place, in steps."""
        return float(np.sqrt(((np.array(self.places) - place) ** 2).sum(axis=1).min()))


@dataclasses.dataclass
class Diagnosis:
    """Result of a diagnosis. ranking: all hypotheses, the best first; `answer`: in the form of the JSON."""

    question: Question
    simulated: Simulated
    judge: Judge
    evidence: Evidence
    ranking: list[Hypothesis]
    answer: dict[str, Any]

    @property
    def best(self) -> Hypothesis:
        return self.ranking[0]


def diagnose(
    question: Question,
    simulate: Simulator,
    seeds: Sequence[int],
    tell: Tell = lambda done, foreseen, what: None,
    rounds: int = ROUNDS,
) -> Diagnosis:
    """The whole diagnosis. seeds: of the runs at every place. UserError when the simulation shows none of the figures.

    The same question, seeds and simulator give the same answer.
    """
    judge = Judge(question.candidates, question.gait, question.endurance)
    simulated = Simulated(question.candidates)
    names = [each.name for each in question.gait]
    first = design(judge)
    foreseen = len(seeds) * (len(first) + rounds * PER_ROUND)
    run(simulated, simulate, first, seeds, tell, foreseen, "each candidate a step up and down")
    evidence = simulated.evidence(names, len(seeds))
    ranking = ranked(judge, evidence)
    for number in range(rounds):
        wanted = unchecked(ranking, simulated)
        if not wanted:
            break
        run(simulated, simulate, wanted, seeds, tell, foreseen, f"the best hypotheses, round {number + 1}")
        evidence = simulated.evidence(names, len(seeds))
        ranking = ranked(judge, evidence)
    done = sum(map(len, simulated.outcomes))
    tell(done, done, "weighed")
    answer = answered(question, judge, simulated, evidence, ranking)
    return Diagnosis(question, simulated, judge, evidence, ranking, answer)


def design(judge: Judge) -> list[Array]:
    """The first places: unchanged, and each candidate a step up and down; at a limit two steps the other way."""
    count = len(judge.names)
    places = [np.zeros(count)]
    for number in range(count):
        up, down = min(1.0, judge.high[number]), max(-1.0, judge.low[number])
        steps = [down, up]
        if up - down < 1.5:  # the value is at a limit, or nearly
            steps = [min(2.0, judge.high[number]), up] if up > -down else [max(-2.0, judge.low[number]), down]
        for step in steps:
            if abs(step) > 1e-6:
                place = np.zeros(count)
                place[number] = step
                places.append(place)
    return places


def run(
    simulated: Simulated,
    simulate: Simulator,
    places: Sequence[Array],
    seeds: Sequence[int],
    tell: Tell,
    foreseen: int,
    what: str,
) -> None:
    """Simulate every place with every seed and keep the outcomes."""
    done = sum(map(len, simulated.outcomes))
    points = [Point(changes(simulated.candidates, place), seed) for place in places for seed in seeds]
    outcomes: list[Outcome] = []
    tell(done, foreseen, what)
    for outcome in simulate(points):
        outcomes.append(outcome)
        tell(done + len(outcomes), foreseen, what)
    if len(outcomes) != len(points):
        raise UserError(f"the simulator answered {len(outcomes)} of {len(points)} points")
    for number, place in enumerate(places):
        simulated.places.append(place)
        simulated.outcomes.append(outcomes[number * len(seeds) : (number + 1) * len(seeds)])


def changes(candidates: Sequence[Candidate], place: Array) -> tuple[tuple[str, float], ...]:
    """The changed values at a place, by candidate, with nine digits: the same place gives the same run."""
    values = [
        float(f"{each.value + each.step * float(step):.9g}") for each, step in zip(candidates, place, strict=True)
    ]
    return tuple(
        (each.name, min(max(value, each.low), each.high))
        for each, value in zip(candidates, values, strict=True)
        if value != each.value
    )


def ranked(judge: Judge, evidence: Evidence) -> list[Hypothesis]:
    """Hypotheses that nothing, one candidate or a pair is wrong: best first, the simpler first where equal."""
    most = min(MOST_FREE, len(judge.gait) - 1)
    subsets = [free for size in range(most + 1) for free in itertools.combinations(judge.names, size)]
    looks = {free: judge.weigh(evidence, free, 0) for free in subsets}
    least = min(each.bic for each in looks.values())
    found = [
        judge.weigh(evidence, free) if len(free) < MOST_FREE or each.bic < least + PROMISING else each
        for free, each in looks.items()
    ]
    return sorted(found, key=lambda each: (round(each.bic, 6), len(each.free)))


def unchecked(ranking: Sequence[Hypothesis], simulated: Simulated) -> list[Array]:
    """Places of the best hypotheses, and of the best with one candidate, that are not simulated yet."""
    near = [each for each in ranking if each.bic < ranking[0].bic + TIE_BIC]
    single = next((each for each in ranking if len(each.free) == 1), None)
    if single is not None and single not in near[:PER_ROUND]:
        near.insert(min(1, len(near)), single)
    found: list[Array] = []
    for each in near:
        alone = all(np.linalg.norm(each.place - place) > CHECKED for place in found)
        if alone and simulated.nearest(each.place) > CHECKED and len(found) < PER_ROUND:
            found.append(each.place)
    return found


def answered(
    question: Question, judge: Judge, simulated: Simulated, evidence: Evidence, ranking: Sequence[Hypothesis]
) -> dict[str, Any]:
    """The answer with the keys of every diagnosis of this package, and more.

    sharper: candidates that are not wrong, but that the figures move within their known errors.
    """
    best = ranking[0]
    nothing = next(each for each in ranking if not each.free)
    tie = [each for each in ranking if each.bic < best.bic + TIE_BIC]
    detected = nothing.p < DETECTED_P or nothing.bic > best.bic + DETECTED_BIC
    abstained = detected and (best.p < REFUSED_P or not best.free)
    shared = set.intersection(*(set(each.free) for each in tie)) if detected and not abstained else set()
    by_name = {each.name: each for each in question.candidates}
    named = [name for name in judge.names if name in shared]
    suspects = sorted({name for each in tie for name in each.free} - set(named), key=judge.names.index)
    cosines = signatures(judge, evidence, best)
    estimates = {each.name: value_of(each, judge, best) for each in question.candidates}
    return {
        "detected": bool(detected),
        "misfit": misfit(judge, nothing),
        "subsystem": "body" if named else None,
        "causes": [
            {
                "name": by_name[name].cause,
                "at": name,
                "balance": "walk",
                "parameters": {name: value_of(by_name[name], judge, best)},
                "tied_with": [other for other in suspects if cosines[name].get(other, 0.0) > NOT_SEPARABLE],
                "evidence": {
                    "delta_bic": _plain(min(each.bic for each in ranking if name not in each.free) - best.bic),
                    "cosines": {other: _plain(value) for other, value in cosines[name].items()},
                },
            }
            for name in named
        ],
        "abstained": bool(abstained),
        "gain": None,
        "next_experiment": next_measurements(question, judge, simulated, best, tie),
        "model_file": None,
        "data_findings": [],
        "hypotheses": [
            {
                "wrong": list(each.free),
                "values": {name: value_of(by_name[name], judge, each) for name in each.free},
                "bic": _plain(each.bic - best.bic),
                "p": _plain(each.p),
                "simulated": simulated.nearest(each.place) <= CHECKED,
            }
            for place, each in enumerate(ranking)
            if len(each.free) < MOST_FREE or (each in tie and place < TOLD)
        ],
        "suspects": suspects,
        "sharper": [name for name, each in estimates.items() if name not in best.free and beyond(each)],
        "estimates": estimates,
        "figures": misfit(judge, best),
        "evidence": {
            "p_nothing": _plain(nothing.p),
            "p_best": _plain(best.p),
            "figures": judge.count,
            "runs": sum(map(len, simulated.outcomes)),
            "failures": int(evidence.failures.sum()),
            "ties": [
                [first, second, _plain(value)]
                for first, second in itertools.combinations(judge.names, 2)
                if (value := cosines[first].get(second, 0.0)) > NOT_SEPARABLE
            ],
        },
    }


def misfit(judge: Judge, at: Hypothesis) -> list[dict[str, Any]]:
    """Each figure: measured less simulated at a hypothesis' best place, with the allowed error."""
    return [
        {
            "channel": figure.name,
            "regime": "all",
            "measured": figure.value,
            "simulated": _plain(figure.value - residual),
            "rms": _plain(abs(residual)),
            "noise": _plain(figure.error),
            "repeatable_fraction": _plain(max(0.0, 1.0 - (figure.error / residual) ** 2) if residual else 0.0),
        }
        for figure, residual in zip(judge.gait, at.residual, strict=True)
    ]


def value_of(candidate: Candidate, judge: Judge, at: Hypothesis) -> dict[str, Any]:
    """Value and 95 % interval: of a free candidate by its profile, of another from its prior and the figures."""
    number = judge.names.index(candidate.name)
    place = float(at.place[number])
    on_limit = [False, False]
    if candidate.name in at.free:
        ends = at.intervals[candidate.name]
        on_limit = [end is None for end in ends]
        steps = [judge.low[number] if ends[0] is None else ends[0], judge.high[number] if ends[1] is None else ends[1]]
    else:
        reach = float(stats.norm.ppf(0.975)) * float(at.sd[number])
        steps = [max(place - reach, judge.low[number]), min(place + reach, judge.high[number])]
    return {
        "value": _plain(candidate.value + candidate.step * place),
        "ci95": [_plain(candidate.value + candidate.step * float(step)) for step in steps],
        "was": candidate.value,
        "unit": candidate.unit,
        "open_ends": on_limit,
    }


def beyond(estimate: Mapping[str, Any]) -> bool:
    """Whether the interval of an estimate excludes the simulation's value."""
    low, high = estimate["ci95"]
    return not low <= estimate["was"] <= high


def signatures(judge: Judge, evidence: Evidence, at: Hypothesis) -> dict[str, dict[str, float]]:
    """|cos| of the effects of each pair of candidates on the figures at a hypothesis' best, all others as known."""
    everything = list(range(len(judge.names)))
    place = at.place[None, :]
    slopes = judge.slopes(evidence, place, everything)[0]
    variance = np.diag(judge.variance + judge.simulated(evidence, place)[1][0])
    found: dict[str, dict[str, float]] = {name: {} for name in judge.names}
    for first, second in itertools.combinations(everything, 2):
        others = [each for each in everything if each not in (first, second)]
        whole = variance + (slopes[:, others] * judge.known[others] ** 2) @ slopes[:, others].T
        ours = np.linalg.solve(np.linalg.cholesky(whole), slopes[:, [first, second]])
        sizes = np.linalg.norm(ours, axis=0)
        cosine = abs(float(ours[:, 0] @ ours[:, 1])) / float(sizes.prod()) if sizes.prod() > 0.0 else 0.0
        found[judge.names[first]][judge.names[second]] = found[judge.names[second]][judge.names[first]] = cosine
    return found


def next_measurements(
    question: Question, judge: Judge, simulated: Simulated, best: Hypothesis, tie: Sequence[Hypothesis]
) -> list[dict[str, Any]]:
    """Benefit of each further measurement, the largest first.

    Linear about the best hypothesis. Every candidate of the tie is free within its limits, the others have their known
    errors: P is their covariance given the figures. A measurement with slopes h and error s turns P into
    P - P h h' P / (h' P h + s^2). `bits`: its information, log2 of the root of (1 + h' P h / s^2). `shrinks`: the share
    by which the interval of each candidate of the tie gets shorter.
    """
    wanted = [each.name for each in question.measurements]
    if not wanted:
        return []
    told = [name for name in wanted if any(name in run.figures for runs in simulated.outcomes for run in runs)]
    evidence = simulated.evidence([*(each.name for each in judge.gait), *told], 1)
    place, everything = best.place[None, :], list(range(len(judge.names)))
    slopes = judge.slopes(evidence, place, everything)[0]
    variance = judge.variance + judge.simulated(evidence, place)[1][0]
    in_tie = {name for each in tie for name in each.free}
    prior = np.array(
        [
            each.spread / each.step if each.name in in_tie else known
            for each, known in zip(question.candidates, judge.known, strict=True)
        ]
    )
    left = np.linalg.inv(np.diag(1.0 / prior**2) + slopes.T @ (slopes / variance[:, None]))
    found = []
    for each in question.measurements:
        if each.name not in told:
            continue
        surface = Judge(question.candidates, [Figure(each.name, 0.0, each.sd)], None)
        slope = surface.slopes(evidence, place, everything)[0, 0]
        noise = each.sd**2 + float(evidence.surfaces[each.name](place)[1][0])
        moved = left @ slope
        after = np.diag(left) - moved**2 / (float(slope @ moved) + noise)
        shrinks = 1.0 - np.sqrt(np.maximum(after, 0.0) / np.diag(left))
        found.append(
            {
                "measurement": each.name,
                "sd": each.sd,
                "how": each.how,
                "expected": _plain(float(evidence.surfaces[each.name].mean(place)[0])),
                "bits": _plain(0.5 * float(np.log2(1.0 + float(slope @ moved) / noise))),
                "shrinks": {
                    name: _plain(float(shrinks[number])) for number, name in enumerate(judge.names) if name in in_tie
                },
            }
        )
    return sorted(found, key=lambda each: -each["bits"])


def _plain(value: float) -> float:
    """A number with six digits, as in files."""
    return float(f"{float(value):.6g}")


def values_of(answer: Mapping[str, Any]) -> dict[str, float]:
    """The values of the named candidates."""
    return {name: each["value"] for cause in answer["causes"] for name, each in cause["parameters"].items()}
