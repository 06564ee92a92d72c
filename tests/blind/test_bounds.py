"""The bounds of a blind run: kept by a method that meets the targets, broken by what must not pass.

Here diagnoses are played: an oracle that is right as often as the targets ask, and comparators that need no data. The
diagnosis itself is held to these bounds on fresh cases by `make test-blind`, minutes of processor; RANGER_SIM_BLIND (a
seed, or "fresh") has the comparators as well, on the cases of that seed.
"""

import os
import subprocess
import sys

import pytest
from scipy import stats

from ranger_sim.foundation.random_arrays import generator
from tests.blind import confusion
from tests.blind.bounds import BOUNDS, RISK, least, refusals
from tests.blind.comparators import COMPARATORS, NEEDS, majority_label, refit_only, said, without_balance
from tests.blind.generator.experiment import SUBSYSTEM
from tests.blind.generator.motor_bench import MOTOR_BENCH
from tests.blind.score import read_folder, score, table

DIAGNOSIS = "tests.blind.answers:diagnosis"
GIVEN = os.environ.get("RANGER_SIM_BLIND", "")
# Of a recording: a strength is in units of what can be detected in it, so a short one is as fair as a long one.
SECONDS = "5"
SINGLE_RISK = RISK / len(BOUNDS)


def truths(seed):
    """{id: truth} of the continuous integration's cases at a seed, without their data."""
    out = {}
    for case in MOTOR_BENCH.check_plan(seed):
        causes = []
        for name, strength in case.effects:
            balance = MOTOR_BENCH.EFFECTS[name].balance
            main = balance[0] if balance[0] in "EMT" else "M"
            causes.append(
                {
                    "name": name,
                    "balance": balance,
                    "subsystem": SUBSYSTEM[balance],
                    "strength": strength,
                    "share_by_balance": {"E": 0.0, "M": 0.0, "T": 0.0} | {main: 1.0},
                    "parameters": {},
                }
            )
        ties = [name for name in MOTOR_BENCH.CONFUSABLE if name != causes[0]["name"]] if case.poor else []
        out[str(case.number)] = {"kind": case.kind, "variant": case.variant, "causes": causes, "ties": ties}
    return out


def oracle(rng, truth):
    """An answer that is right just as often as the targets ask."""
    causes = truth["causes"]
    if not causes:
        return said(rng.random() < 0.02)
    name, strength, balance = causes[0]["name"], causes[0]["strength"], causes[0]["balance"][0]
    other = str(rng.choice([cause for cause in MOTOR_BENCH.CAUSES if cause != name]))
    if truth["kind"] == "pair":
        draw = rng.random()
        names = [cause["name"] for cause in causes] if draw < 0.70 else [name]
        return said(True, balance, [*names, other] if draw > 0.90 else names)
    if rng.random() > (0.97 if strength < 4.0 else 0.99):
        return said()
    if truth["kind"] == "outside":
        draw = rng.random()
        return said(True, balance, [], True) if draw > 0.05 else said(True, balance, [other])
    right = rng.random() < (0.85 if strength < 4.0 else 0.95)
    found = said(True, balance if rng.random() < 0.95 else "P", [name if right else other])
    if not right and rng.random() < 0.8:
        found["causes"][0]["tied_with"] = [name]
    if truth["ties"] and rng.random() < 0.9:
        found["causes"][0] |= {"name": name, "tied_with": truth["ties"]}
    return found


def perfect(truth):
    """An answer that is right, with balances named."""
    causes = truth["causes"]
    if not causes:
        return said()
    if truth["kind"] == "outside":
        return said(True, causes[0]["balance"][0], [], True)
    found = said(True, main_of(causes[0]), [cause["name"] for cause in causes])
    for entry, cause in zip(found["causes"], causes, strict=True):
        entry["balance"] = main_of(cause)
    if truth["ties"]:
        found["causes"][0]["tied_with"] = truth["ties"]
    return found


def main_of(cause):
    return max(cause["share_by_balance"], key=cause["share_by_balance"].get)


def refused(hidden, answer):
    """Refusals of a method that answers from the truth."""
    return refusals(score(hidden, {key: answer(truth) for key, truth in hidden.items()}))


@pytest.mark.parametrize("bound", BOUNDS, ids=lambda bound: bound.figure)
def test_a_bound_fails_falsely_within_its_risk_and_is_the_tightest_that_does(bound):
    share = bound.target if bound.hits else 1.0 - bound.target
    for cases in range(1, 120, 7):
        k = least(cases, share, SINGLE_RISK)
        assert stats.binom.cdf(k - 1, cases, share) <= SINGLE_RISK  # P(fewer than k)
        assert k == cases or stats.binom.cdf(k, cases, share) > SINGLE_RISK


def test_known_bounds():
    """0.5 to the tenth is 0.001: with ten fair coins one head may be asked for at that risk, not two."""
    assert least(10, 0.5, 0.001) == 1
    assert least(10, 0.5, 0.0009) == 0
    assert least(10, 1.0, 1e-9) == 10


def test_the_subset_has_fifty_two_cases_of_the_kinds_that_so_few_can_bound():
    hidden = truths(1)
    kinds = [truth["kind"] for truth in hidden.values()]
    assert len(hidden) == 52
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "single": 32,
        "null": 10,
        "outside": 10,
    }
    for figure in ("two effects exact", "two effects, one or more spurious", "confusable pair declared a tie"):
        (bound,) = (each for each in BOUNDS if each.figure == figure)
        share = bound.target if bound.hits else 1.0 - bound.target
        assert least(6, share, SINGLE_RISK) == 0  # six pairs or ties would cost a tenth of the time and refuse nothing


def test_an_oracle_that_meets_the_targets_is_never_refused():
    """50 runs at a millionth each: to see one refusal by chance has a probability of 5e-5, and the seeds are fixed."""
    rng = generator(1, "oracle")
    for seed in range(50):
        hidden = truths(seed)
        assert refused(hidden, lambda truth: oracle(rng, truth)) == []


def test_a_perfect_diagnosis_is_not_refused():
    assert refused(truths(3), perfect) == []


@pytest.mark.parametrize("seed", range(2))
def test_no_answer_at_all_is_refused(seed):
    assert refusals(score(truths(seed), {}))


@pytest.mark.parametrize("seed", range(2))
def test_a_refit_is_refused_by_each_figure_of_detection(seed):
    refusal = "\n".join(refused(truths(seed), lambda truth: said(gain=0.0)))
    for figure in (
        "detection at 2:",
        "detection at 4:",
        "balance E:",
        "balance M:",
        "balance T:",
        "outside: abstains:",
    ):
        assert figure in refusal


@pytest.mark.parametrize("label", MOTOR_BENCH.CAUSES)
def test_one_label_for_everything_is_refused_whichever_it_is(label):
    """Each is the majority's somewhere: false alarms, and a name that is right for few."""
    refusal = "\n".join(refused(truths(7), lambda truth: said(True, "M", [label])))
    assert "false alarms:" in refusal
    assert "top-1 cause at 4:" in refusal


@pytest.mark.parametrize("balance", "EMT")
def test_a_diagnosis_without_one_balance_is_refused_for_that_balance(balance):
    """Else perfect. Eight cases at strength 4 show in that balance alone, and it sees none of them."""
    for seed in range(5):
        hidden = truths(seed)
        refusal = refused(hidden, lambda truth: without_balance(lambda *_: perfect(truth), balance)([], [], ""))
        assert any(text.startswith(f"detection at 4, balance {balance}:") for text in refusal), seed


def test_comparators_speak_the_form_of_an_answer():
    answer = majority_label([], [], "motor-bench")
    assert answer["detected"] and answer["causes"][0]["name"] in MOTOR_BENCH.CAUSES
    assert set(answer) == {
        "detected",
        "misfit",
        "subsystem",
        "causes",
        "abstained",
        "gain",
        "next_experiment",
        "model_file",
        "data_findings",
    }


def generated(folder, *arguments):
    """(folder of the data, {id: truth}) of cases made in a separate process, which prints the seed."""
    command = [sys.executable, "-m", "tests.blind.generate", "--out", str(folder), *arguments]
    print(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return folder / "data", read_folder(folder / "truth")


def answered(name, data, out, *arguments):
    """{id: answer} of a method, asked in separate processes."""
    command = [sys.executable, "-m", "tests.blind.answers", "--data", str(data), "--by", name, "--out", str(out)]
    subprocess.run([*command, "--processes", "2", *arguments], capture_output=True, check=True)
    return read_folder(out)


@pytest.fixture(scope="module")
def fresh_cases(tmp_path_factory):
    """The cases with a seed of this run, or the given one."""
    seed = [] if GIVEN in ("", "fresh") else ["--seed", GIVEN]
    return generated(tmp_path_factory.mktemp("blind"), "--check", "--seconds", SECONDS, *seed)


@pytest.mark.blind
def test_the_diagnosis_keeps_the_bounds_on_fresh_cases(fresh_cases, tmp_path):
    data, hidden = fresh_cases
    found = answered(DIAGNOSIS, data, tmp_path)
    figures = score(hidden, found)
    said = "\n".join((table(figures), confusion.text(hidden, found), (tmp_path / "errors.txt").read_text()))
    print(said)
    assert not refusals(figures), said


@pytest.mark.blind
@pytest.mark.skipif(not GIVEN, reason="beside the diagnosis: set RANGER_SIM_BLIND to a seed or to fresh")
@pytest.mark.parametrize("name", COMPARATORS)
def test_comparators_are_refused_on_the_cases(name, fresh_cases, tmp_path):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name][0])
    data, hidden = fresh_cases
    figures = score(hidden, answered(name, data, tmp_path))
    print(table(figures))
    assert (tmp_path / "errors.txt").read_text() == ""
    assert refusals(figures)


@pytest.mark.blind
@pytest.mark.parametrize("letter", "EMT")
def test_the_diagnosis_with_a_balance_taken_out_of_the_machine_is_refused(letter, fresh_cases, tmp_path):
    """It sees none of the eight cases at strength 4 that show in that balance alone, but for a false alarm: four of
    these, at 2 % each, have a probability of 1e-5.
    """
    data, hidden = fresh_cases
    there = {key: truth for key, truth in hidden.items() if in_one_balance(truth, letter)}
    assert len(there) == MOTOR_BENCH.CHECK_AT_4
    found = answered(f"tests.blind.deaf:without_{letter}", data, tmp_path, "--no-holdout", "--only", *there)
    assert len(found) == len(there), (tmp_path / "errors.txt").read_text()
    refusal = refusals(score(there, found))
    assert any(text.startswith("detection at 4:") for text in refusal), (refusal, confusion.text(there, found))


def in_one_balance(truth, letter):
    """Whether a case is one of those that show in that balance alone."""
    return (
        truth["kind"] == "single"
        and truth["causes"][0]["strength"] == 4.0
        and truth["causes"][0]["name"] in MOTOR_BENCH.ONLY_IN[letter]
    )


def test_the_refit_reads_the_files_and_finds_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(MOTOR_BENCH, "SAMPLES", 1500)
    (case,) = MOTOR_BENCH.plan(4, 1, ["null"], list(MOTOR_BENCH.CAUSES))
    ((_, files, holdout, _),) = MOTOR_BENCH.generate(4, [case], tmp_path)
    answer = refit_only([tmp_path / files[0]], [tmp_path / holdout[0]], "motor-bench")
    assert answer["detected"] is False and answer["gain"]["fraction_of_achievable"] == 0.0
