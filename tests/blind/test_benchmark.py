"""The benchmark's command and its table of what is missed, on cases whose answers are known."""

import concurrent.futures
import json
import subprocess
import sys

import pytest

from tests.blind import benchmark, confusion, generate
from tests.blind.comparators import said

NUMBER = iter(range(1000))


def hidden(*causes, kind="single", strength=4.0, ties=(), variant="", channel=None):
    """A truth with its own number."""
    shape = {"channel": channel} if channel else {}
    listed = [{"name": name, "balance": "M", "strength": strength, "shape": shape, "parameters": {}} for name in causes]
    return {"number": next(NUMBER), "kind": kind, "variant": variant, "causes": listed, "ties": list(ties)}


def of(*pairs):
    """Truths and answers by number."""
    truths = {str(truth["number"]): truth for truth, _ in pairs}
    return truths, {str(truth["number"]): answer for truth, answer in pairs if answer is not None}


def tied(first, *rest):
    answer = said(True, "M", [first])
    answer["causes"][0]["tied_with"] = list(rest)
    return answer


DRAG, NOTHING, UNSURE = said(True, "M", ["drag"]), said(), said(True, "M", [], True)


def test_a_cause_is_counted_as_first_in_the_set_and_seen():
    (row,) = confusion.singles(
        *of(
            (hidden("drag"), DRAG),
            (hidden("drag"), tied("stribeck", "drag")),
            (hidden("drag"), UNSURE),
            (hidden("drag", strength=2.0), NOTHING),
            (hidden("drag", strength=0.5), NOTHING),
            (hidden("drag", strength=1.0), None),
        )
    )
    assert (row.cause, row.lost) == ("drag", 3)
    assert str(row.cells[4.0]) == "1 2 3/3"
    assert str(row.cells[2.0]) == "0 0 0/1"
    answers = [(strength, answer) for strength, _, answer in row.wrong]
    assert answers == [(4.0, "stribeck=drag"), (4.0, "no name"), (2.0, "nothing"), (1.0, "no answer")]


def test_what_loses_most_comes_first_and_places_are_apart():
    lost = [(hidden("sensor_lag", channel="T"), NOTHING)] * 1 + [(hidden("cogging"), DRAG), (hidden("cogging"), DRAG)]
    found = [(hidden("drag"), DRAG), (hidden("sensor_lag", channel="I"), tied("sensor_lag"))]
    rows = confusion.singles(*of(*found, *lost))
    assert [row.cause for row in rows] == ["cogging", "sensor_lag at T", "drag", "sensor_lag at I"]


def test_the_text_names_wrong_answers_with_strength_and_number():
    truth = hidden("cogging")
    text = confusion.text(*of((truth, said(True, "M", ["drag", "stribeck"]))))
    assert f"    drag + stribeck: 4 #{truth['number']}" in text


def test_an_answer_without_name_names_the_suspects():
    answer = UNSURE | {"evidence": {"suspects": ["cable_backlash at transmission"]}}
    text = confusion.text(*of((hidden("cable_backlash"), answer)))
    assert "no name (cable_backlash at transmission?)" in text


def test_alarms_inexact_pairs_and_names_for_the_nameless_are_listed():
    alarm, pair = hidden(kind="null", variant="noise"), hidden("drag", "cogging", kind="pair", strength=2.0)
    outside = hidden("mains_pickup", kind="outside")
    right = [
        (hidden(kind="null", variant="plain"), NOTHING),
        (hidden("cogging", "drag", kind="pair"), said(True, "M", ["drag", "cogging"])),
        (hidden("mains_pickup", kind="outside"), UNSURE),
    ]
    found = confusion.others(*of((alarm, DRAG), (pair, DRAG), (outside, DRAG), *right))
    assert found == {
        "null": [("noise", "drag", [alarm["number"]])],
        "pair": [("cogging + drag", "drag", [pair["number"]])],
        "outside": [("mains_pickup", "drag", [outside["number"]])],
    }


def test_the_table_for_a_document_counts_only_strong_cases():
    table = confusion.markdown(
        *of((hidden("drag"), NOTHING), (hidden("drag"), NOTHING), (hidden("drag", strength=1.0), UNSURE))
    )
    assert table.splitlines()[-1] == "| drag |  | 0 of 1 |  | 0 of 2 | nothing (2) |"


def run(folder, *arguments):
    """The command in a separate process, which leaves nothing of its pool in this one."""
    command = [sys.executable, "-m", "tests.blind.benchmark", *at(folder), *arguments]
    subprocess.run(command, check=True, capture_output=True)


def at(folder):
    return ["--out", str(folder), "--cases", "3", "--seconds", "1", "--methods", "refit_only,majority_label"]


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark")
    run(folder, "--seed", "8")
    return folder


def test_a_run_leaves_truth_answers_and_tables_and_no_data(ran):
    assert len(list((ran / "truth").iterdir())) == 3
    for method in ("refit_only", "majority_label"):
        assert {path.name for path in (ran / "answers" / method).iterdir()} == {
            path.name for path in (ran / "truth").iterdir()
        }
    assert list(ran.rglob("*.csv")) == []
    text = (ran / "table.txt").read_text()
    assert text.startswith("motor-bench, 3 cases, seed 8") and "DX 2025" in text
    page = (ran / "table.md").read_text()
    assert "| figure | cases | target | refit_only | 95 % interval | majority_label |" in page
    figures = json.loads((ran / "score.json").read_text())
    assert figures["refit_only"][0] == figures["majority_label"][0]  # answers missing: none


def test_an_interrupted_run_goes_on_and_a_finished_one_asks_no_one(ran, monkeypatch):
    """Of three cases one has no answer yet: that one is asked, and the tables come out as they were."""
    before = {path: path.read_bytes() for path in ran.rglob("*.*") if path.suffix in (".json", ".txt", ".md")}
    lost = next((ran / "answers" / "refit_only").iterdir())
    lost.unlink()
    asked = []

    def generated(self, part, folder):
        command = self.generation(part, folder)
        generate.main(command[command.index("tests.blind.generate") + 1 :])
        return folder / "data"

    def answered(self, missing, jobs, tell):
        with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            asked.extend(missing)
            self.answer(missing, pool, tell)

    monkeypatch.setattr(benchmark.Benchmark, "generate", generated)
    monkeypatch.setattr(benchmark.Benchmark, "in_processes", answered)
    benchmark.main(at(ran))  # with its own seed
    assert {path: path.read_bytes() for path in before} == before
    benchmark.main(at(ran))
    assert asked == [(0, 3)]


def test_a_folder_of_another_run_is_refused(ran, capsys):
    with pytest.raises(SystemExit):
        benchmark.main([*at(ran), "--seed", "9"])
    assert "holds another run" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--methods", "oracle"], "--methods oracle"),
        (["--cases", "0"], "1 or more"),
    ],
)
def test_what_cannot_be_run_is_reported(arguments, said, tmp_path, capsys):
    with pytest.raises(SystemExit):
        benchmark.main(["--out", str(tmp_path), *arguments])
    assert said in capsys.readouterr().err


def test_a_library_that_is_not_there_is_reported(monkeypatch):
    monkeypatch.setattr(benchmark.importlib.util, "find_spec", lambda name: None)
    methods, left_out = benchmark.methods_of(["refit_only", "sindy"])
    assert [method.name for method in methods] == ["refit_only"]
    assert left_out == ["sindy: not run, pysindy is not installed (pip install --group comparators)"]


def test_a_slice_of_the_cases_is_the_same_as_in_the_whole(tmp_path):
    common = ["--seconds", "1", "--count", "3", "--seed", "21"]
    generate.main([*common, "--out", str(tmp_path / "all")])
    generate.main([*common, "--out", str(tmp_path / "one"), "--slice", "1"])
    (truth,) = (tmp_path / "one" / "truth").iterdir()
    assert json.loads(truth.read_text())["number"] == 1
    assert truth.read_bytes() == (tmp_path / "all" / "truth" / truth.name).read_bytes()
    for name in ("a.csv", "b.csv"):
        one, whole = (tmp_path / each / "data" / truth.stem / name for each in ("one", "all"))
        assert one.read_bytes() == whole.read_bytes()
