"""The mutation tool: which faults it makes, how it draws them, and that it separates noticed ones from survivors."""

import dataclasses
import pathlib
import shutil
import subprocess

import pytest

from dev.mutate import work
from dev.mutate.mutants import mutants
from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import CHECKOUT, PACKAGE

SOURCE = '''"""A module."""

import cython

if not cython.compiled:
    LIMIT = 3


class Valve:
    """One."""

    def open(self, flow: cython.double, most: float = 2.0) -> bool:
        """Opens."""
        if flow < 0.5 and not self.stuck:
            raise ValueError(f"no {flow + 1}")
        self.count += 1
        self.rate = most - flow
        return True
'''


def made(source):
    return {(each.operator, each.old, each.new) for each in mutants(source, "valve.py")}


def test_every_operator_makes_its_faults_and_no_others():
    assert made(SOURCE) == {
        ("boolean", "flow < 0.5 and not self.stuck", "(not (flow < 0.5 and (not self.stuck)))"),
        ("boolean", "flow < 0.5 and not self.stuck", "(flow < 0.5 or not self.stuck)"),
        ("comparison", "flow < 0.5", "(flow <= 0.5)"),
        ("constant", "0.5", "(1.0)"),
        ("boolean", "not self.stuck", "(self.stuck)"),
        ("removed statement", 'raise ValueError(f"no {flow + 1}")', "pass"),
        ("removed statement", "self.count += 1", "pass"),
        ("arithmetic", "self.count += 1", "self.count -= 1"),
        ("constant", "1", "(2)"),
        ("removed statement", "self.rate = most - flow", "pass"),
        ("arithmetic", "most - flow", "(most + flow)"),
        ("sign", "most - flow", "(flow - most)"),
        ("constant", "True", "False"),
    }


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ("x = -a\n", ("sign", "-a", "(a)")),
        ("x = a // b\n", ("arithmetic", "a // b", "(a * b)")),
        ("x = a << b\n", ("arithmetic", "a << b", "(a >> b)")),
        ("x = a & b\n", ("arithmetic", "a & b", "(a | b)")),
        ("x = a is None\n", ("comparison", "a is None", "(a is not None)")),
        ("x = a in b\n", ("comparison", "a in b", "(a not in b)")),
        ("x = 0.0\n", ("constant", "0.0", "(1.0)")),
        ("x = 7\n", ("constant", "7", "(8)")),
        ("def f():\n    go()\n", ("removed statement", "go()", "pass")),
        ("while a:\n    break\n", ("removed statement", "break", "pass")),
        ('x = "ä" + b - c\n', ("sign", '"ä" + b - c', "(c - ('ä' + b))")),
    ],
)
def test_a_mutant_is_at_its_place(source, fault):
    assert fault in made(source)
    for mutant in mutants(source, "x.py"):
        assert source[mutant.begin : mutant.end] == mutant.old
        compile(mutant.applied(source), "x.py", "exec")


def test_names_of_mutants_outlive_lines_that_move():
    moved = "\n\n# more\n" + SOURCE
    assert [each.key for each in mutants(SOURCE, "v.py")] == [each.key for each in mutants(moved, "v.py")]
    assert len({each.key for each in mutants("x = (a < b, a < b)\n", "v.py")}) == 2


def test_a_larger_sample_begins_with_the_smaller_one():
    every = work.all_mutants("foundation")
    assert len(every) > 300
    assert [each.key for each in work.sample(every, "foundation", 20, 1)] == [
        each.key for each in work.sample(every, "foundation", 50, 1)[:20]
    ]
    assert work.sample(every, "foundation", 20, 1) != work.sample(every, "foundation", 20, 2)


def test_tests_that_reach_a_mutant_run_cheapest_first_and_within_the_limit():
    mutant = next(each for each in mutants(SOURCE, "a/valve.py") if each.operator == "sign")
    place, other = f"a/valve.py:{mutant.first_line}", "a/valve.py:99"
    found = {
        "t/x.py": {
            "imported": [],
            "shared": [other],
            "late": {},
            "tests": {
                "t/x.py::slow": {"seconds": 5.0, "functions": [place], "starts": False},
                "t/x.py::quick": {"seconds": 0.5, "functions": [place, other], "starts": False},
            },
        },
        "t/y.py": {
            "imported": [],
            "shared": [],
            "late": {},
            "tests": {"t/y.py::elsewhere": {"seconds": 0.1, "functions": ["b/c.py:1"], "starts": False}},
        },
    }
    tests = work.TestsOf(found)
    assert tests.of(mutant, 60.0) == (["t/x.py::quick", "t/x.py::slow"], 0)
    assert tests.of(mutant, 1.0) == (["t/x.py::quick"], 1)
    # what runs while a module is imported is everybody's who uses the module; fixtures are their whole file's
    found["t/x.py"]["imported"] = [place]
    assert work.TestsOf(found).of(mutant, 60.0) == (["t/x.py::quick", "t/x.py::slow"], 0)
    found["t/x.py"]["imported"] = []
    found["t/y.py"]["shared"] = [place]
    assert work.TestsOf(found).of(mutant, 0.2) == (["t/y.py::elsewhere"], 2)


def test_a_constant_is_shown_to_the_tests_of_the_modules_that_import_it_after_those_of_its_own_module():
    [mutant] = mutants("LIMIT = 5\n", "a/numbers.py")[:1]
    every = {
        "t::own": {"seconds": 3.0, "functions": ["a/numbers.py:9"], "starts": False},
        "t::reader": {"seconds": 0.5, "functions": ["b/reader.py:3"], "starts": False},
        "t::apart": {"seconds": 0.1, "functions": ["b/apart.py:3"], "starts": False},
    }
    found = {"t": work.NOTHING | {"tests": every}}
    readers = {"a/numbers.py": {"b/reader.py"}}
    assert work.TestsOf(found, readers).of(mutant, 9.0) == (["t::own", "t::reader"], 0)
    del every["t::own"]
    assert work.TestsOf(found, readers).of(mutant, 9.0) == (["t::reader"], 0)
    assert work.TestsOf(found).of(mutant, 9.0) == ([], 0)


def test_the_readers_of_a_module_are_those_that_import_it_or_from_it(tmp_path):
    for name, text in {
        "plant/size.py": "LEG = 1.0\n",
        "boards/one.py": "from ranger_sim.plant.size import LEG\n",
        "boards/two.py": "def it():\n    from ranger_sim.plant import size\n    return size.LEG\n",
        "boards/three.py": "import ranger_sim.plant.size\n",
        "boards/four.py": "import math\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert work.importers_in(tmp_path) == {"plant/size.py": {"boards/one.py", "boards/two.py", "boards/three.py"}}


def test_tests_that_last_too_long_or_start_processes_count_for_what_they_may_notice():
    mutant = next(each for each in mutants(SOURCE, "a/valve.py") if each.operator == "sign")
    place = f"a/valve.py:{mutant.first_line}"
    of_file = {
        "imported": [],
        "shared": [],
        "late": {"t::walk": [place]},
        "tests": {
            "t::near": {"seconds": 0.5, "functions": [place], "starts": False},
            "t::programs": {"seconds": 2.0, "functions": ["a/other.py:3"], "starts": True},
            "t::more": {"seconds": 9.0, "functions": [], "starts": True},
            "t::apart": {"seconds": 0.1, "functions": ["a/other.py:3"], "starts": False},
        },
    }
    tests = work.TestsOf({"t": of_file})
    assert tests.of(mutant, 5.0) == (["t::near", "t::programs"], 2)  # left out: 9 s, and the walk that does not end
    # built, the walk ends; what the interpreted map knows to pass it by takes no part, what it does not know may
    seconds = {"t::near": 0.1, "t::walk": 1.0, "t::apart": 0.1, "t::only compiled": 0.3}
    every = {name: {"seconds": took, "functions": [], "starts": False} for name, took in seconds.items()}
    built = work.TestsOf({"t": {"imported": [], "shared": [], "late": {}, "tests": every}})
    assert built.built_of(mutant, tests, 1.0) == (["t::near", "t::only compiled"], 1)
    assert built.built_of(mutant, tests, 2.0) == (["t::near", "t::only compiled", "t::walk"], 0)
    # a function that runs compiled alone is reached by whoever runs anything of its module
    of_file["tests"]["t::near"]["functions"], of_file["late"] = ["a/valve.py:99"], {}
    assert built.built_of(mutant, work.TestsOf({"t": of_file}), 2.0)[0] == ["t::near", "t::only compiled", "t::walk"]


def test_mutants_that_are_listed_as_equivalent_exist_and_have_reasons(tmp_path):
    for entry in work.known():
        path = entry.key.partition("::")[0]
        of_file = mutants((PACKAGE / path).read_text(encoding="utf-8"), path)
        assert entry.key in {each.key for each in of_file}, f"no such mutant any more: {entry.key}"
    listed = tmp_path / "equivalent.toml"
    listed.write_text('[[mutant]]\nkey = "a"\nreason = " "\n', encoding="utf-8")
    with pytest.raises(UserError, match="an entry has key and reason"):
        work.known(listed)
    listed.write_text('[[mutant]]\nkey = "a"\nreason = "b"\n' * 2, encoding="utf-8")
    with pytest.raises(UserError, match="is listed twice"):
        work.known(listed)


VALVE = """\
import functools

LIMIT = 3


@functools.cache
def clip(x):
    return LIMIT if x > 3 else x - 0


def twice(x):
    return [x * each for each in (1, 2)]
"""
TESTS = """\
import os

import pytest
from ranger_sim.plant.valve import clip, twice

clip(9)  # what is kept from before must not hide a mutant


@pytest.fixture(scope="module")
def doubled():
    return twice(7)


def test_it_clips():
    assert clip(9) == 3


def test_it_doubles(doubled):
    assert doubled == [7, 14]


def test_that_fails_in_a_second_process():
    assert not os.path.exists("seen")
    open("seen", "w").close()
    clip(1)
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A checkout small enough to be mutated in a test."""
    root = tmp_path_factory.mktemp("mutate") / "source"
    needed = ("ranger_sim/__init__.py", "ranger_sim/loading.py")
    for name in (*needed, "dev/__init__.py", "dev/mutate/__init__.py", "dev/mutate/serve.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(CHECKOUT / name, root / name)
    (root / "pyproject.toml").write_text('[tool.pytest.ini_options]\naddopts = "-p no:ranger_sim"\n', encoding="utf-8")
    (root / "plant").mkdir()
    (root / "plant" / "__init__.py").touch()
    (root / "ranger_sim" / "plant").symlink_to("../plant")
    (root / "plant" / "valve.py").write_text(VALVE, encoding="utf-8")
    (root / "tests").mkdir()
    (root / "tests" / "test_valve.py").write_text(TESTS, encoding="utf-8")
    for command in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *command], cwd=root, check=True, capture_output=True)
    return root


@pytest.fixture(scope="module")
def tried(source):
    """{(function, change): verdict} of all its mutants."""
    root = source
    copy = work.Copy(root.parent / "work" / "copy", root)
    results = work.Results(root.parent / "work" / "verdicts.jsonl")
    with copy.server(["tests"]) as ask:
        tests = work.reach_of(copy, ask, "plant", ["tests"], 60.0, print)
        (copy.folder / "seen").touch()
        for mutant in mutants(VALVE, "plant/valve.py"):
            results.add(work.judge(copy, ask, mutant, tests, 60.0))
    assert (copy.folder / "plant" / "valve.py").read_text(encoding="utf-8") == VALVE
    assert (root / "plant" / "valve.py").read_text(encoding="utf-8") == VALVE
    assert work.Results(results.path).verdicts == results.verdicts  # as the next run finds them
    return {(each.key.split("::")[1], each.key.split("::")[3]): each for each in results.verdicts.values()}


def test_mutants_are_noticed_or_survive_in_a_copy_and_verdicts_are_kept(tried):
    assert {change: verdict.outcome for change, verdict in tried.items()} == {
        ("", "3 -> (4)"): work.KILLED,  # it runs at import: in a process of its own
        ("clip", "3 -> (4)"): work.SURVIVED,  # 9 is above both; the last of TESTS fails on the original as well
        ("clip", "x > 3 -> (x >= 3)"): work.SURVIVED,
        ("clip", "x - 0 -> (x + 0)"): work.SURVIVED,
        ("clip", "x - 0 -> (0 - x)"): work.SURVIVED,
        ("clip", "0 -> (1)"): work.SURVIVED,
        ("twice", "x * each -> (x + each)"): work.KILLED,
        ("twice", "1 -> (2)"): work.KILLED,
        ("twice", "2 -> (3)"): work.KILLED,
    }
    assert tried["", "3 -> (4)"].by == "tests/test_valve.py::test_it_clips"
    assert tried["twice", "2 -> (3)"].by == "tests/test_valve.py::test_it_doubles"


def test_a_mutant_is_noticed_as_well_by_a_second_server_that_has_a_map_already(source, tried, monkeypatch):
    """It must have imported everything when the first mutant is put into a file; folders may be given from here."""
    monkeypatch.chdir(source.parent)
    copy = work.Copy(pathlib.Path("work/copy"), source)
    (copy.folder / "seen").unlink()
    said = []
    with copy.server(["tests"]) as ask:
        tests = work.reach_of(copy, ask, "plant", ["tests"], 60.0, said.append)
        for mutant in mutants(VALVE, "plant/valve.py"):
            if mutant.old == "x * each":
                verdict = work.judge(copy, ask, mutant, tests, 60.0)
    assert not said, "it was mapped once more"
    assert verdict.outcome == work.KILLED
    assert verdict.by == "tests/test_valve.py::test_it_doubles"


class Rebuilt(work.Copy):
    """A copy in which nothing has to be compiled, except for what cannot be."""

    def build(self):
        return "not a" not in (self.folder / "plant" / "valve.py").read_text(encoding="utf-8")


def test_what_is_built_anew_is_noticed_by_tests_that_pass_with_the_original(source):
    copy = Rebuilt(source.parent / "built" / "copy", source)
    (copy.folder / "seen").touch()  # so that the last of TESTS always fails
    names = ["it_clips", "it_doubles", "that_fails_in_a_second_process"]
    every = {f"tests/test_valve.py::test_{name}": {"seconds": 0.1, "functions": [], "starts": False} for name in names}
    compiled = work.TestsOf({"t": work.NOTHING | {"tests": every}})
    plain = work.TestsOf({"t": work.NOTHING})
    of_file = {each.old: each for each in mutants(VALVE, "plant/valve.py")}
    noticed = work.judge_built(copy, of_file["x * each"], plain, compiled, 60.0)
    assert (noticed.outcome, noticed.by, noticed.tests) == (work.KILLED, "tests/test_valve.py::test_it_doubles", 3)
    # the last test is blamed, fails with the original as well, and takes no part from then on
    passed = work.judge_built(copy, of_file["x > 3"], plain, compiled, 60.0)
    assert (passed.outcome, passed.tests, passed.left) == (work.SURVIVED, 2, 0)
    assert work.judge_built(copy, of_file["x > 3"], plain, compiled, 0.15).outcome == work.NOT_WITHIN
    broken = dataclasses.replace(of_file["x > 3"], new="(not a > 3)")
    assert work.judge_built(copy, broken, plain, compiled, 60.0).by == "the build"
    assert (copy.folder / "plant" / "valve.py").read_text(encoding="utf-8") == VALVE


def test_packages_have_mutants_and_no_key_twice():
    for package in ("foundation", "datatable"):
        keys = [each.key for each in work.all_mutants(package)]
        assert len(keys) == len(set(keys)) > 300
        assert not any(key.startswith("datatable/generated/") for key in keys)
