"""Files that are not recordings, or not what they say: a line and exit code 2 or a finding, never a traceback."""

import io
import json
import os
import pathlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Finding
from ranger_sim.sysid.machines import MACHINES, made
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.preparation import Prepared
from ranger_sim.tools.cli import main
from ranger_sim.tools.diagnose import work
from tests.examples import examples
from tests.sysid.test_diagnose import Cart, cart_run

ROWS = 400


def table_of(experiment):
    """(names, rows) with every channel that an experiment needs: walks of bounded steps, 2 ms apart."""
    known = made(experiment)().quantities
    names = ["t_s", *([each.name for each in known if each.needed] or [each.name for each in known[:3]])]
    walk = np.cumsum(generator(1, "bad data").normal(size=(ROWS, len(names))), axis=0)
    rows = 0.05 * (walk - walk.mean(axis=0))
    rows[:, 0] = 0.002 * np.arange(ROWS)
    return names, rows


def text_of(names, rows):
    out = io.StringIO()
    np.savetxt(out, rows, delimiter=",", header=",".join(names), comments="", fmt="%.7g")
    return out.getvalue()


def with_column(rows, number, values):
    changed = rows.copy()
    changed[:, number] = values
    return changed


def holes(rows, share):
    changed = rows.copy()
    gone = generator(2, "holes").random(rows.shape) < share
    gone[:, 0] = False
    changed[gone] = np.nan
    return changed


# {case: (names, rows) -> content of the file}
REFUSED = {
    "empty": lambda names, rows: b"",
    "header only": lambda names, rows: (",".join(names) + "\n").encode(),
    "one row": lambda names, rows: text_of(names, rows[:1]),
    "three rows": lambda names, rows: text_of(names, rows[:3]),
    "a column without stamps": lambda names, rows: text_of(names[1:2], rows[:, 1:2]),
    "stamps only": lambda names, rows: text_of(names[:1], rows[:, :1]),
    "no header": lambda names, rows: text_of(names, rows).split("\n", 1)[1],
    "binary": lambda names, rows: generator(1, "binary").integers(0, 256, 4000, dtype=np.uint8).tobytes(),
    "zeros": lambda names, rows: bytes(1000),
    "a page of the web": lambda names, rows: "<html><body>404 not found</body></html>",
    "JSON": lambda names, rows: json.dumps({"rows": rows[:5].tolist()}),
    "two columns of one name": lambda names, rows: text_of([names[0], *[names[1]] * (len(names) - 1)], rows),
    "decimal commas between commas": lambda names, rows: text_of(names, rows).replace(".", ","),
    "half the cells are no numbers": lambda names, rows: text_of(names, holes(rows, 0.5)),
    "a channel of no numbers": lambda names, rows: text_of(names, with_column(rows, 1, np.nan)),
    "rows of other lengths": lambda names, rows: text_of(names, rows).replace("\n0", ",7,8\n0", 200),
    "all constant": lambda names, rows: text_of(names, np.column_stack([rows[:, 0], np.ones_like(rows[:, 1:])])),
    "no time passes": lambda names, rows: text_of(names, with_column(rows, 0, 1.0)),
    "two recordings in one file": lambda names, rows: text_of(names, with_column(rows, 0, rows[:, 0] % 0.4)),
    "stamps in ms": lambda names, rows: text_of(names, with_column(rows, 0, 1000.0 * rows[:, 0])),
    "every stamp twice": lambda names, rows: text_of(names, with_column(rows, 0, np.repeat(rows[::2, 0], 2))),
    "endless digits": lambda names, rows: ",".join(names) + "\n" + (",".join(["9" * 400] * len(names)) + "\n") * 50,
}  # fmt: skip


@pytest.mark.parametrize("experiment", MACHINES)
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_a_recording_is_reported_in_a_line(case, experiment, tmp_path, capsys):
    path = tmp_path / "bad.csv"
    content = REFUSED[case](*table_of(experiment))
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    if case == "two columns of one name" and len(table_of(experiment)[0]) < 3:
        pytest.skip("it needs one channel only")
    assert main(["diagnose", str(path), "--experiment", experiment]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
    assert said.err.startswith("ranger-sim: ") and "bad.csv" in said.err


def cart_text(**changes):
    """A cart's run with drag, as a file; columns by name multiplied or replaced."""
    run = cart_run(1, drag=0.02)
    columns = {**run.columns, **changes}
    return text_of(["t_s", *columns], np.column_stack([run.time_s, *columns.values()])[:2000])


def diagnosed(path, capsys, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    code = main(["diagnose", str(path), "--experiment", "tests.sysid.test_diagnose:Cart", "--json", "-"])
    return code, json.loads(capsys.readouterr().out)


def test_marks_and_encodings_and_decimal_commas_change_nothing(tmp_path, capsys):
    path, text = tmp_path / "a.csv", cart_text()
    plain = diagnosed(path, capsys, text)
    assert plain[0] == 1 and plain[1]["causes"][0]["name"] == "drag"
    for other in (
        b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode(),
        text.replace(",", ";").replace(".", ",").encode("utf-16"),
    ):
        code, told = diagnosed(path, capsys, other)
        assert code == 1 and told["causes"] == plain[1]["causes"]


@pytest.mark.parametrize("column", ["force_N", "v_m_per_s"])
@pytest.mark.parametrize("factor", [1000.0, -1.0, 180.0 / np.pi])
def test_a_channel_in_another_unit_is_a_finding_and_no_cause_where_no_machine_has_such_values(
    column, factor, tmp_path, capsys
):
    run = cart_run(1, drag=0.02)
    code, told = diagnosed(tmp_path / "a.csv", capsys, cart_text(**{column: factor * run[column]}))
    found = [each["kind"] for each in told["data_findings"]]
    assert {"impossible", "far_off", "unexplained"} & set(found)
    if {"impossible", "unexplained"} & set(found):
        assert told["causes"] == [] and told["abstained"] and code == 1


SOUND = cart_text().splitlines()[:250]
EDITS = st.one_of(
    st.tuples(st.just("cut"), st.integers(0, 6000), st.integers(1, 3000), st.just("")),
    st.tuples(st.just("put"), st.integers(0, 6000), st.just(0), st.text(max_size=12)),
    st.tuples(
        st.just("put"), st.integers(0, 6000), st.just(0), st.sampled_from(["\n", ",", ";", "nan", "1e999", "\0"])
    ),
    st.tuples(st.just("again"), st.integers(0, 6000), st.integers(1, 2000), st.just("")),
    st.tuples(st.just("turn"), st.integers(0, 6000), st.integers(1, 2000), st.just("")),
)


def edited(text, edits):
    for kind, start, length, more in edits:
        start = min(start, len(text))
        part = text[start : start + length]
        middle = {"cut": "", "put": more, "again": part + part, "turn": part[::-1]}[kind]
        text = text[:start] + middle + text[start + length :]
    return text


@settings(max_examples=examples(15), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=st.lists(EDITS, min_size=1, max_size=4))
def test_no_mutilation_of_a_file_leads_to_a_traceback(edits, tmp_path, capsys):
    path = tmp_path / "a.csv"
    path.write_text(edited("\n".join(SOUND), edits), encoding="utf-8", errors="replace", newline="")
    code = main(["diagnose", str(path), "--experiment", "tests.sysid.test_diagnose:Cart"])
    said = capsys.readouterr()
    assert code in (0, 1, 2)
    if code == 2:
        assert said.out == "" and said.err.count("\n") == 1 and said.err.startswith("ranger-sim: ")
    else:
        assert said.err == "" and said.out.startswith("cart: ")


def test_a_name_of_a_file_that_is_not_utf_8_is_escaped_in_the_answer(tmp_path, capsys):
    path = pathlib.Path(os.fsdecode(os.fsencode(tmp_path) + b"/m\xe9ss.csv"))
    path.write_text(cart_text())
    machine, out = "tests.sysid.test_diagnose:Cart", tmp_path / "found"
    assert main(["diagnose", str(path), "--experiment", machine, "--out", str(out), "--json", "-"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert list(told["data_ledger"]) == ["m\\udce9ss.csv"]
    for name in ("report.html", "extended.toml", "diagnosis.json"):
        assert "\\udce9ss.csv" in (out / name).read_text(encoding="utf-8")


def walk_with_gaps():
    """What a diagnosis has to print of a recording with many gaps, and no gain."""
    gaps = [
        Finding(f"{name}_rad", "gap", 1.0 * k, 2.0, 0.1 * k, "s", f"no sample for {0.1 * k:.4g} s", "note")
        for name in ("hip", "knee")
        for k in range(1, 4)
    ]
    run = cart_run(1, drag=0.02)
    run.name = "walk"
    return diagnose(Cart(), [run], prepared=[Prepared(run, gaps, [], {})])


def test_many_gaps_are_one_line_on_a_screen_and_a_gain_is_shown_where_one_was_measured():
    found = walk_with_gaps()
    console = Console(file=io.StringIO(), width=200)
    work._show(found, console)
    printed = console.file.getvalue()
    assert "data: walk: gaps in 2 channels; the longest is 0.3 s at 3 s, in hip_rad\n" in printed
    assert "no sample for" not in printed and "gain on" not in printed


def test_a_slow_machine_of_ones_own_may_have_slow_samples(tmp_path, capsys):
    run = cart_run(1, drag=0.02)
    columns = np.column_stack([1e3 * run.time_s, *run.columns.values()])[:2000]  # steps of some seconds
    code, told = diagnosed(tmp_path / "a.csv", capsys, text_of(["t_s", *run.columns], columns))
    assert code in (0, 1) and "slow_samples" in {each["kind"] for each in told["data_findings"]}


def test_values_that_no_machine_has_do_not_end_with_the_code_of_a_sound_one(tmp_path, capsys):
    """A force that counts the other way round: the mass and the damping come out negative."""
    run = cart_run(1)
    rows = np.column_stack((run.time_s, -run["force_N"], run["v_m_per_s"]))
    path = tmp_path / "backwards.csv"
    np.savetxt(path, rows, delimiter=",", header="t_s,force_N,v_m_per_s", comments="")
    assert main(["diagnose", str(path), "--experiment", "tests.sysid.test_diagnose:Cart"]) != 0
    shown = capsys.readouterr().out
    assert "mass_kg comes out as" in shown and "nothing that these data could show is missing" not in shown
