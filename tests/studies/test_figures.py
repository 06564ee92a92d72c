"""Diagnosis from figures, on machines of a few lines whose answers are known."""

import math
import pathlib

import numpy as np
import pytest
from scipy import integrate, optimize

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from studies.figures import file
from studies.figures.diagnose import diagnose
from studies.figures.hypotheses import Evidence, Judge
from studies.figures.question import Candidate, Figure, Measurement, Outcome, Question
from studies.figures.surface import Surface

SEEDS = (1, 2, 3)
NOISE = 0.005


def candidate(name, known_sd=0.02, low=-1.0, high=1.0, step=0.2):
    return Candidate(name, "m", 0.0, low, high, known_sd, step, "geometry", {name: 1.0})


def machine(figures, fails=None, ask=None):
    """A simulator: figures(values) -> {name: value}, with noise; fails(values) -> hazard of each of 100 steps."""

    def simulate(points):
        for point in points:
            if ask is not None:
                ask.append(point)
            values = {**dict.fromkeys("abc", 0.0), **dict(point.changes)}
            random = generator(point.seed, f"test machine {point.changes}")
            shown = {name: value + NOISE * random.normal() for name, value in figures(values).items()}
            hazard = fails(values) if fails is not None else 0.0
            lasted = min(100.0, random.exponential(1.0 / hazard)) if hazard > 0.0 else 100.0
            yield Outcome(shown, lasted, lasted < 100.0)

    return simulate


def three(values):
    """Three figures of three numbers, bent, each number with its own signature."""
    a, b, c = (values[name] for name in "abc")
    return {"x": 1.0 + a + 0.3 * a * a + 0.2 * c, "y": 2.0 - 0.5 * a + b, "z": c - 0.4 * b + 0.2 * a * b, "only_b": b}


def question(true, names=("x", "y", "z"), figures=three, sd=0.01, **more):
    shown = figures({**dict.fromkeys("abc", 0.0), **true})
    measured = tuple(Figure(name, shown[name], sd) for name in names)
    return Question("test", measured, tuple(map(candidate, "abc")), **more)


@pytest.mark.parametrize("true", [{"a": 0.4}, {"a": -0.5}, {"b": -0.3}, {"c": 0.35}])
def test_the_one_wrong_number_is_named_with_an_interval_that_holds_it(true):
    ((name, value),) = true.items()
    found = diagnose(question(true), machine(three), SEEDS).answer
    assert found["detected"] and not found["abstained"]
    assert [cause["at"] for cause in found["causes"]] == [name]
    told = found["causes"][0]["parameters"][name]
    low, high = told["ci95"]
    assert low < value < high
    # figures to 0.01 with slopes of 1 and the others known to 0.02: not better than +-0.01, not worse than +-0.1
    assert 0.01 < high - low < 0.2


def test_two_wrong_numbers_are_named_together():
    found = diagnose(question({"a": 0.5, "c": -0.4}), machine(three), SEEDS).answer
    assert [cause["at"] for cause in found["causes"]] == ["a", "c"]
    for name, value in (("a", 0.5), ("c", -0.4)):
        low, high = next(each for each in found["causes"] if each["at"] == name)["parameters"][name]["ci95"]
        assert low < value < high


def test_a_sound_machine_has_nothing_wrong():
    found = diagnose(question({}), machine(three), SEEDS).answer
    assert not found["detected"] and found["causes"] == []


def test_what_the_numbers_are_known_to_is_not_a_fault():
    """0.045 of a number known to 0.02 shows in a figure four times over its own error of 0.01."""
    found = diagnose(question({"b": 0.045}), machine(three), SEEDS).answer
    assert not found["detected"]
    sharp = question({"b": -0.045})
    sharp = Question("test", sharp.figures, tuple(candidate(name, 1e-4) for name in "abc"))
    assert diagnose(sharp, machine(three), SEEDS).answer["detected"]


def test_what_no_candidate_explains_is_not_given_a_name():
    asked = question({})
    spoiled = (Figure("x", 0.2, 0.01), Figure("y", 3.9, 0.01), Figure("z", 1.7, 0.01), Figure("only_b", -0.9, 0.01))
    found = diagnose(Question("test", spoiled, asked.candidates), machine(three), SEEDS).answer
    assert found["detected"] and found["abstained"] and found["causes"] == []


def alike(values):
    """b and c do the same, but for one bench."""
    a, b, c = (values[name] for name in "abc")
    return {"x": a + b + c, "y": 2.0 * a - b - c, "bench_b": b, "bench_a": a}


def test_a_tie_is_reported_and_the_measurement_that_breaks_it_breaks_it():
    benches = (Measurement("bench_a", 0.01, "look at a"), Measurement("bench_b", 0.01, "look at b"))
    asked = question({"b": 0.4}, ("x", "y"), alike, measurements=benches)
    found = diagnose(asked, machine(alike), SEEDS).answer
    assert found["detected"] and found["causes"] == []
    assert {"b", "c"} <= set(found["suspects"])
    assert ["b", "c"] in [tie[:2] for tie in found["evidence"]["ties"]]
    best = found["next_experiment"][0]
    assert best["measurement"] == "bench_b"
    assert best["shrinks"]["b"] > 0.8 and best["shrinks"]["c"] > 0.8
    broken = question({"b": 0.4}, ("x", "y", "bench_b"), alike)
    again = diagnose(broken, machine(alike), SEEDS).answer
    assert [cause["at"] for cause in again["causes"]] == ["b"]


def test_a_machine_that_fails_where_the_measured_one_did_not_is_refused():
    """The figures are the same for a and b; with b the machine fails once in fifty steps, the measured one never."""

    def figures(values):
        return {"x": values["a"] + values["b"], "y": 1.0 - values["a"] - values["b"], "z": values["c"]}

    def fails(values):
        return 0.02 if values["b"] > 0.15 else 0.0

    asked = question({"a": 0.4}, ("x", "y", "z"), figures)
    without = diagnose(asked, machine(figures, fails), SEEDS).answer
    assert without["causes"] == [] and {"a", "b"} <= set(without["suspects"])
    walked_far = Figure("steps", 1e5, endurance=True, at_least=True)
    asked = Question("test", (*asked.figures, walked_far), asked.candidates)
    found = diagnose(asked, machine(figures, fails), SEEDS).answer
    assert [cause["at"] for cause in found["causes"]] == ["a"]
    # and the other way round: a machine that was seen to fail after 40 is not one that never does
    fell = Figure("steps", 40.0, endurance=True)
    asked = Question("test", (*asked.figures[:3], fell), asked.candidates)
    found = diagnose(asked, machine(figures, fails), SEEDS).answer
    assert found["hypotheses"][0]["wrong"] == ["b"]


def test_the_chance_to_endure_is_the_hazard_integrated_out():
    """Against a numerical integral over the hazard: Gamma(F + 1/2) as the failures leave it."""
    judge = Judge([candidate("a")], [Figure("x", 0.0, 1.0)], None)
    evidence = Evidence({}, np.array([[0.0]]), np.array([300.0]), np.array([2.0]), 100.0)
    seen, power = 400.0, 2.5
    for at_least in (True, False):
        figure = Figure("steps", 700.0, endurance=True, at_least=at_least)

        def density(hazard, sharp=at_least):
            known = seen**power / math.gamma(power) * hazard ** (power - 1.0) * math.exp(-hazard * seen)
            return known * math.exp(-hazard * 700.0) * (1.0 if sharp else hazard)

        whole = integrate.quad(density, 0.0, 0.2, epsabs=1e-14, limit=200)[0]
        told = float(evidence.log_endurance(np.array([[0.0]]), figure)[0])
        assert told == pytest.approx(math.log(whole), rel=1e-6)
    far = float(evidence.log_endurance(np.array([[20.0]]), figure)[0])  # nobody looked there: 100 units, no failure
    assert far == pytest.approx(0.5 * math.log(100.0 / 800.0) + math.log(0.5 / 800.0))
    assert judge.count == 1


def test_others_are_left_as_well_known_as_they_are():
    """Misfit, estimates and the free value of a linear machine, against a minimiser that knows no matrices."""
    slopes = np.array([[1.0, -0.6, 0.3], [0.2, 0.8, -0.5]])
    measured, error, known = np.array([0.5, -0.3]), np.array([0.04, 0.05]), 0.1
    places = np.array([[0.0, 0.0, 0.0], *np.eye(3), *-np.eye(3)])
    runs = [[np.array([figure @ place] * 4) for place in places] for figure in slopes]
    surfaces = {name: Surface(places, each) for name, each in zip("xy", runs, strict=True)}
    evidence = Evidence(surfaces, places, np.zeros(7), np.zeros(7), 1.0)
    candidates = [candidate(name, known, -9.0, 9.0, 1.0) for name in "abc"]
    figures = [Figure(name, value, sd) for name, value, sd in zip("xy", measured, error, strict=True)]
    found = Judge(candidates, figures, None).weigh(evidence, ("a",))

    def cost(values):
        return (((measured - slopes @ values) / error) ** 2).sum() + ((values[1:] / known) ** 2).sum()

    best = optimize.minimize(cost, np.zeros(3), tol=1e-12)
    # the grid of `a` is as fine as a hundredth of its interval, and the surfaces know a line to a thousandth
    assert found.place == pytest.approx(best.x, abs=0.01)
    assert found.misfit == pytest.approx(best.fun, abs=0.02)
    whole = np.linalg.inv(slopes.T @ np.diag(error**-2.0) @ slopes + np.diag([0.0, known**-2.0, known**-2.0]))
    low, high = found.intervals["a"]
    assert (high - low) / 2.0 == pytest.approx(math.sqrt(3.84 * whole[0, 0]), rel=0.05)


def test_a_surface_is_the_polynomial_behind_it():
    def bent(z):
        return 3.0 + z[..., 0] - 0.5 * z[..., 1] + 0.3 * z[..., 0] ** 2 + 0.2 * z[..., 0] * z[..., 1]

    places = np.array([[i, j] for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)])
    surface = Surface(places, [np.array([value, value]) for value in bent(places)])
    asked = np.array([[0.5, -0.4], [-0.8, 0.9]])
    mean, variance = surface(asked)
    assert mean == pytest.approx(bent(asked), abs=0.01)
    assert np.all(variance < 1e-3) and float(surface(np.array([[5.0, 5.0]]))[1][0]) > float(variance.max())
    step = 1e-5
    for column, shift in enumerate(np.eye(2) * step):
        numeric = (surface.mean(asked + shift) - surface.mean(asked - shift)) / (2.0 * step)
        assert surface.slopes(asked)[:, column] == pytest.approx(numeric, rel=1e-6, abs=1e-9)
    assert surface.mean(asked) == pytest.approx(mean)


def test_a_number_on_its_limit_is_not_moved_beyond():
    """Of a mass that is 0 only more is possible, though the figures would like less."""
    candidates = (candidate("a"), candidate("b", known_sd=0.3, low=0.0), candidate("c"))
    places = []
    asked = Question("test", question({"b": -0.2}).figures, candidates)
    found = diagnose(asked, machine(three, ask=places), SEEDS).answer
    assert found["estimates"]["b"]["value"] >= 0.0
    assert all(dict(point.changes).get("b", 0.0) >= 0.0 for point in places)
    assert {dict(point.changes).get("b") for point in places} >= {0.2, 0.4}  # two steps up in place of one down


def test_every_run_is_asked_for_with_every_seed_and_the_answer_is_always_the_same():
    first, again = [], []
    answers = [diagnose(question({"a": 0.4}), machine(three, ask=each), SEEDS).answer for each in (first, again)]
    assert first == again and answers[0] == answers[1]
    assert len(first) == answers[0]["evidence"]["runs"]
    assert {point.seed for point in first} == set(SEEDS)


def test_progress_is_reported_to_the_end():
    told = []
    diagnose(question({"a": 0.4}), machine(three), SEEDS, lambda *each: told.append(each))
    done = [each[0] for each in told]
    assert done == sorted(done) and told[-1][0] == told[-1][1]


@pytest.mark.parametrize(
    ("made", "complaint"),
    [
        (lambda: Figure("x", math.nan, 1.0), "figure x: value nan"),
        (lambda: Figure("x", 1.0), "figure x: sd 0 and model_sd 0"),
        (lambda: Figure("x", 1.0, 0.1, at_least=True), "only an endurance"),
        (lambda: Figure("x", -1.0, endurance=True), "above 0"),
        (lambda: candidate("a", low=0.5), "candidate a: 0.0 m is not within"),
        (lambda: candidate("a", known_sd=0.0), "known_sd is 0.0"),
        (lambda: candidate("a", step=-1.0), "step is -1.0"),
        (lambda: Measurement("x", 0.0), "measurement x: sd is 0.0"),
        (lambda: Question("t", (), (candidate("a"),)), "figures: none"),
        (lambda: Question("t", (Figure("x", 1.0, 0.1),), ()), "candidates: none"),
        (lambda: Question("t", (Figure("x", 1.0, 0.1),) * 2, (candidate("a"),)), "x comes twice"),
    ],
)
def test_a_question_that_means_nothing_is_refused_in_a_line(made, complaint):
    with pytest.raises(UserError, match=complaint) as told:
        made()
    assert "\n" not in str(told.value)


FILE = """
title = "t"
[[figure]]
name = "x"
value = 1.0
sd = 0.1
source = "somebody"
[[candidate]]
name = "a"
unit = "m"
low = 0
high = 2
known_sd = 0.1
step = 0.1
cause = "geometry"
source = "somebody"
moves = { "body.a" = 1, "body.b" = -1 }
[[measurement]]
name = "y"
sd = 0.1
how = "look"
"""


def loaded(folder, text):
    path = pathlib.Path(folder) / "asked.toml"
    path.write_text(text, encoding="utf-8")
    return file.question(path, file.load(path), lambda name: {"body.a": 0.5, "body.b": 0.7}[name])


def test_a_file_makes_the_question_that_is_in_it(tmp_path):
    asked = loaded(tmp_path, FILE)
    (a,) = asked.candidates
    assert (a.value, a.moves) == (0.5, {"body.a": 1.0, "body.b": -1.0})  # the value is that of the first it moves
    assert [each.name for each in (*asked.figures, *asked.measurements)] == ["x", "y"]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('title = "t"', "title = 3", "title = 3"),
        ('title = "t"', 'titel = "t"', "unknown key 'titel'"),
        ("value = 1.0", "", "figure x: it lacks value"),
        ("value = 1.0", 'value = "1"', "a finite number is expected"),
        ("value = 1.0", "value = nan", "a finite number is expected"),
        ("value = 1.0", "value = true", "a finite number is expected"),
        ("sd = 0.1\nsource", "sd = 0.1\nendurance = 1\nsource", "true or false"),
        ('cause = "geometry"', 'cause = "fate"', "not in the catalogue"),
        ('moves = { "body.a" = 1, "body.b" = -1 }', "moves = {}", "names and factors"),
        ('how = "look"', 'how = " "', "text is expected"),
        ("low = 0", "low = 1", "candidate a"),
        ("title", "title =", "not valid TOML"),
    ],
)
def test_a_file_that_is_wrong_is_reported_in_a_line(tmp_path, old, new, complaint):
    assert old in FILE
    with pytest.raises(UserError, match=complaint) as told:
        loaded(tmp_path, FILE.replace(old, new, 1))
    assert "asked.toml" in str(told.value) and "\n" not in str(told.value)
