"""The stubs of the compiled modules: what is written for a small module, and that the modules are what theirs say."""

import ast
import importlib
from typing import get_args

import pytest

from ranger_sim import loading
from ranger_sim.harness.ranger import BOARD_CLASSES, BoardName
from ranger_sim.harness.wiring.ranger import BOARDS
from ranger_sim.tools import stubs

DECLARATION = """\
from ranger_sim.foundation.other cimport Base, helper

cdef extern from *:
    \"\"\"
    #define BIG 1
    \"\"\"
    const long long BIG

cdef long long _HIDDEN

cpdef enum:
    FIRST = 1  # a number
    SECOND = 2

cdef inline long long quick(long long a) noexcept:
    return a

cdef double inside(double x) noexcept
cpdef long long add(long long a, double b=*, list c=*, double[::1] d=*) except? -1

@cython.final
cdef class Thing(Base):
    cdef public long long count, place
    cdef readonly double[::1] samples
    cdef public unsigned char[4] bytes_kept  # four
    cdef long long* address
    cdef list secret
    cdef public bint on
    cdef public Base other
    cdef public object anything
    cpdef bint wait(
        self, long long time,
    ) except? -1
    cdef void private(self) noexcept
"""
SOURCE = """\
import cython

from ranger_sim.foundation.more import GIVEN as GIVEN
from ranger_sim.foundation.more import OWN

if not cython.compiled:
    from ranger_sim.foundation.other import helper
    FIRST = 1
    SECOND = 2
    BIG = 1 << 40
    slow = min
else:
    globals()["BIG"] = 1 << 40
_HIDDEN = 5
NAMES = ("a", "b")
SHARE = 1 / 3

def quick(a: cython.longlong) -> cython.longlong:
    return a

def inside(x: cython.double) -> cython.double:
    return x

def add(a, b=1.5, c=None, d=None):
    return a

def build(names, kind: str = "x") -> list:
    return []

class Thing(Base):
    LIMIT = 3

    def __init__(self, count, samples, other, flag=True) -> None:
        self.count = count
        self.samples = samples
        self.other = other
        self.on = flag if flag else False

    def wait(self, time: cython.longlong) -> cython.bint:
        return self.other is None

    def private(self) -> cython.void:
        pass

    @property
    def twice(self):
        return 2 * self.count

    @twice.setter
    def twice(self, value) -> None:
        self.count = value // 2

    @staticmethod
    def of(text: str) -> "Thing":
        return Thing(len(text), [], None)

class Plain:
    def __init__(self, size: int) -> None:
        self.size = size
        self.name = "plain"
"""
STUB = """\
# Generated from foundation/thing.py and foundation/thing.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.more import GIVEN as GIVEN
from ranger_sim.foundation.other import Base
from typing import Any
from typing import final

FIRST: int
SECOND: int
BIG: int
NAMES: tuple[str, ...]
SHARE: float

def add(a: int, b: float = 1.5, c: list[Any] | None = None, d: MutableSequence[float] | None = None) -> int: ...
def build(names: Any, kind: str = 'x') -> list[Any]: ...

@final
class Thing(Base):
    count: int
    place: int
    @property
    def samples(self) -> MutableSequence[float]: ...
    bytes_kept: MutableSequence[int]
    on: bool
    other: Base | None
    anything: Any
    LIMIT: int
    def __init__(self, count: int, samples: VIEW, other: Base | None, flag: Any = True) -> None: ...
    def wait(self, time: int) -> bool: ...
    @property
    def twice(self) -> int: ...
    @twice.setter
    def twice(self, value: int) -> None: ...
    @staticmethod
    def of(text: str) -> Thing: ...

class Plain:
    size: int
    name: str
    def __init__(self, size: int) -> None: ...
""".replace("VIEW", "MutableSequence[float] | memoryview[float]").replace(
    "d: MutableSequence[float] | None", "d: MutableSequence[float] | memoryview[float] | None"
)


def test_the_stub_of_a_small_module_has_what_python_sees_of_it_with_its_types(tmp_path):
    (tmp_path / "foundation").mkdir()
    (tmp_path / "foundation" / "thing.pxd").write_text(DECLARATION, encoding="utf-8")
    (tmp_path / "foundation" / "thing.py").write_text(SOURCE, encoding="utf-8")
    assert stubs.Module(tmp_path, "ranger_sim.foundation.thing", {}).text() == STUB


def test_stubs_are_what_sources_and_declarations_give(capsys):
    assert stubs.stubs() == stubs.kept(stubs.STUBS), f"run `{stubs.REGENERATE}`"
    assert stubs.main(["--check"]) == 0 and capsys.readouterr().out == ""


def test_a_stale_a_missing_and_a_surplus_stub_are_told_and_mended(tmp_path, monkeypatch, capsys):
    fresh = {"foundation/a.pyi": "A: int\n", "foundation/b.pyi": "B: int\n"}
    monkeypatch.setattr(stubs, "STUBS", tmp_path)
    monkeypatch.setattr(stubs, "stubs", lambda: fresh)
    (tmp_path / "foundation").mkdir()
    (tmp_path / "foundation" / "a.pyi").write_text("A: str\n", encoding="utf-8")
    (tmp_path / "foundation" / "c.pyi").write_text("C: int\n", encoding="utf-8")
    assert stubs.main(["--check"]) == 1
    assert capsys.readouterr().out.split() == [
        each for name in "abc" for each in ("stale:", f"stubs/foundation/{name}.pyi")
    ]
    assert stubs.main([]) == 0
    assert stubs.kept(tmp_path) == fresh and stubs.main(["--check"]) == 0


@pytest.mark.parametrize("name", list(loading.declared_modules()))
def test_a_module_has_what_its_stub_says(name):
    """Whether it runs compiled or interpreted: its names, and methods, properties and fields of its classes."""
    module = importlib.import_module(name)
    path = stubs.STUBS.joinpath(*name.split(".")[1:]).with_suffix(".pyi")
    faults = []
    declared = stubs.read_declaration(loading.HOUSE.joinpath(*name.split(".")[1:]).with_suffix(".pxd").read_text())
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.AnnAssign) and not hasattr(module, node.target.id):
            faults.append(node.target.id)
        elif isinstance(node, ast.FunctionDef) and not callable(getattr(module, node.name, None)):
            faults.append(node.name)
        elif isinstance(node, ast.ClassDef):
            there = getattr(module, node.name)
            for part in node.body:
                if isinstance(part, ast.FunctionDef) and not hasattr(there, part.name):
                    faults.append(f"{node.name}.{part.name}")
                elif isinstance(part, ast.AnnAssign) and node.name in declared.classes:
                    if not hasattr(there, part.target.id):
                        faults.append(f"{node.name}.{part.target.id}")
    assert not faults


@pytest.mark.parametrize("name", list(loading.declared_modules()))
def test_what_a_compiled_class_shows_stands_in_its_stub(name):
    module = importlib.import_module(name)
    path = stubs.STUBS.joinpath(*name.split(".")[1:]).with_suffix(".pyi")
    declared = stubs.read_declaration(loading.HOUSE.joinpath(*name.split(".")[1:]).with_suffix(".pxd").read_text())
    faults = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and node.name in declared.classes:
            told = {
                part.name if isinstance(part, ast.FunctionDef) else part.target.id
                for part in node.body
                if not isinstance(part, ast.Pass)
            }
            shown = {each for each in vars(getattr(module, node.name)) if not each.startswith("__")}
            if loading.COMPILED_MODULES:  # interpreted, C methods and fields are ordinary ones
                faults += [f"{node.name}.{each}" for each in sorted(shown - told)]
    assert not faults


def test_names_of_boards_are_the_same_for_type_checkers_and_at_run_time():
    assert get_args(BoardName) == tuple(BOARD_CLASSES) and set(BOARD_CLASSES) == set(BOARDS)
