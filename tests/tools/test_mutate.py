"""The mutation tool: which faults it makes, how it draws them, and that it tells noticed ones from survivors."""

import json
import subprocess

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import HOUSE
from ranger_sim.tools.mutate import work
from ranger_sim.tools.mutate.mutants import mutants

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
def test_a_fault_stands_where_its_place_is(source, fault):
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
        "imported": [],
        "files": {"t/x.py": [other]},
        "tests": {
            "t/x.py::slow": {"seconds": 5.0, "functions": [place]},
            "t/x.py::quick": {"seconds": 0.5, "functions": [place, other]},
            "t/y.py::elsewhere": {"seconds": 0.1, "functions": ["b/c.py:1"]},
        },
    }
    tests = work.TestsOf(found)
    assert tests.of(mutant, 60.0) == ["t/x.py::quick", "t/x.py::slow"]
    assert tests.of(mutant, 1.0) == ["t/x.py::quick"]
    # what runs while a module is imported is everybody's who uses the module; fixtures are their whole file's
    assert work.TestsOf(found | {"imported": [place]}).of(mutant, 60.0) == ["t/x.py::quick", "t/x.py::slow"]
    assert work.TestsOf(found | {"files": {"t/y.py": [place]}}).of(mutant, 0.2) == ["t/y.py::elsewhere"]


def test_mutants_that_are_listed_as_equivalent_exist_and_have_reasons(tmp_path):
    for entry in work.known():
        room = entry.key.partition("/")[0]
        assert entry.key in {each.key for each in work.all_mutants(room)}, f"no such mutant any more: {entry.key}"
    listed = tmp_path / "equivalent.toml"
    listed.write_text('[[mutant]]\nkey = "a"\nreason = " "\n', encoding="utf-8")
    with pytest.raises(UserError, match="an entry has key and reason"):
        work.known(listed)
    listed.write_text('[[mutant]]\nkey = "a"\nreason = "b"\n' * 2, encoding="utf-8")
    with pytest.raises(UserError, match="stands there twice"):
        work.known(listed)


@pytest.fixture
def house(tmp_path):
    """A checkout small enough to be mutated in a test: one function, and a test of half of it."""
    root = tmp_path / "house"
    (root / "tests").mkdir(parents=True)
    (root / "pyproject.toml").write_text('[tool.pytest.ini_options]\naddopts = "-p no:ranger_sim"\n', encoding="utf-8")
    (root / "valve.py").write_text("def clip(x):\n    return 3 if x > 3 else x - 0\n", encoding="utf-8")
    (root / "tests" / "test_valve.py").write_text(
        "from valve import clip\n\n\ndef test_it_clips():\n    assert clip(9) == 3\n", encoding="utf-8"
    )
    for command in (["init", "-q"], ["add", "-A"]):
        subprocess.run(["git", *command], cwd=root, check=True, capture_output=True)
    return root


def test_a_mutant_is_noticed_or_survives_in_a_copy_and_the_verdict_is_kept(house, tmp_path):
    source = (house / "valve.py").read_text(encoding="utf-8")
    copy = work.Copy(tmp_path / "work" / "copy", house)
    results = work.Results(tmp_path / "work" / "verdicts.jsonl")
    wanted = {
        each.new: each for each in mutants(source, "valve.py") if each.new in ("(4)", "(0 - x)") and not each.occurrence
    }
    tests = work.AllOf(["tests/test_valve.py"])
    for mutant in wanted.values():
        results.add(work.judge(copy, mutant, tests, 60.0))
    outcome = {json.loads(line)["key"]: json.loads(line) for line in results.path.read_text("utf-8").splitlines()}
    assert outcome[wanted["(4)"].key]["outcome"] == work.KILLED
    assert outcome[wanted["(4)"].key]["by"] == "tests/test_valve.py::test_it_clips"
    assert outcome[wanted["(0 - x)"].key]["outcome"] == work.SURVIVED
    assert (copy.folder / "valve.py").read_text(encoding="utf-8") == source
    assert (house / "valve.py").read_text(encoding="utf-8") == source
    assert set(work.Results(results.path).verdicts) == set(outcome)  # as the next run finds them


def test_rooms_have_mutants_and_no_key_twice():
    for room in ("foundation", "datatable"):
        keys = [each.key for each in work.all_mutants(room)]
        assert len(keys) == len(set(keys)) > 300
        assert not any(key.startswith("datatable/generated/") for key in keys)
    assert (HOUSE / "tests").is_dir()
