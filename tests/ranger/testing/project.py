"""A user's project in a folder, and pytest in it, as its engineer would start it."""

import dataclasses
import functools
import os
import pathlib
import subprocess
import sys
import xml.etree.ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[3]
LIMIT_S = 500  # a guard against waiting for ever; nothing asserts on it


# As pytest looks for plugins: in every distribution, also in one that another of the same name hides.
HAS_ENTRY_POINT = """\
from importlib.metadata import distributions
found = [each for one in distributions() for each in one.entry_points if each.group == "pytest11"]
print(sum(each.name == "ranger_sim" for each in found))
"""


@functools.cache
def how_to_find_the_plugin():
    """Nothing where ranger-sim is installed with its entry point; a checkout may be linked without it.

    A process like the one that pytest will run in is asked, away from the checkout: this one has the checkout on its
    path, and the packaging data that a build leaves there.
    """
    done = subprocess.run(
        [sys.executable, "-c", HAS_ENTRY_POINT],
        cwd=os.sep, env=environment(), capture_output=True, text=True, timeout=LIMIT_S, check=True,
    )  # fmt: skip
    return [] if int(done.stdout) else ["-p", "ranger_sim.ranger.testing.plugin"]


def environment():
    """That of a user's process: of RANGER_SIM_... here only the way it runs, and nothing of our pytest."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("RANGER_SIM_", "PYTEST_"))}
    return kept | {name: os.environ[name] for name in ("RANGER_SIM_INTERPRETED",) if name in os.environ}


@dataclasses.dataclass
class Done:
    """What pytest printed. `cases`: {name: (outcome, text, properties)}, from its JUnit XML."""

    code: int
    text: str
    cases: dict

    def outcome(self, name):
        return self.cases[name][0]

    def reason(self, name):
        return self.cases[name][1]

    def properties(self, name):
        return self.cases[name][2]


def write(folder, **files):
    """Files by their names without .py; `tests__test_hip` is tests/test_hip.py."""
    for name, text in files.items():
        path = folder / (name.replace("__", "/") + ".py")
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text, encoding="utf-8")


def pytest_in(folder, *arguments, plugin=True, **more):
    """Run pytest in a folder; `more`: variables of its environment."""
    xml_file = folder / "junit.xml"
    xml_file.unlink(missing_ok=True)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--junitxml", str(xml_file)]
    done = subprocess.run(
        [*command, *(how_to_find_the_plugin() if plugin else []), *map(str, arguments)],
        cwd=folder,
        env={**environment(), "COLUMNS": "200", **more},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    return Done(done.returncode, done.stdout + done.stderr, read(xml_file) if xml_file.exists() else {})


def read(xml_file):
    """{name: (outcome, text, {property: value})} of the cases of a JUnit file; a case may be there twice."""
    found = {}
    for case in xml.etree.ElementTree.parse(xml_file).iter("testcase"):
        outcome, text = "passed", ""
        for kind in ("failure", "error", "skipped"):
            for part in case.findall(kind):
                outcome, text = kind, "\n".join([text, part.get("message") or "", part.text or ""])
        text += "".join(part.text or "" for kind in ("system-out", "system-err") for part in case.findall(kind))
        properties = {each.get("name"): each.get("value") for each in case.iter("property")}
        found[case.get("name")] = (outcome, text, properties)
    return found
