"""What is made of an annotated source: known answers, and what is refused."""

import textwrap

import pytest

from dev.declarations import DeclarationError, Declarations, Sources, write_declarations
from dev.stubs import Stub

EVENTS = """\
import cython
from typing import Final

ROW: Final = 10
LONG: Final = 1 << 62

@cython.cclass
class Outbox:
    size: cython.longlong

    @cython.ccall
    def push(self, time: cython.longlong, ref: object = None) -> None:
        self.size += 1
"""
QUEUE = """\
# a queue
from typing import TYPE_CHECKING, Annotated, Final

import cython
from cython.cimports.libc.math import sin

from ranger_sim.ground.events import LONG, ROW, Outbox
from ranger_sim.ground.plain import text

if TYPE_CHECKING:
    from ranger_sim.ground.other import Other

WORDS: Final = 3
TWICE: Final = 2 * WORDS
MASK: cython.longlong = 0xFFFFFFFF
TABLE: cython.short[8]


@cython.final
@cython.cclass
class Queue(Outbox):
    \"\"\"A queue.\"\"\"

    NAMES: dict = {}
    head: cython.longlong
    rows: cython.p_longlong
    kept: Annotated[cython.longlong[::1], "readonly"]
    bytes_seen: cython.const[cython.uchar][::1]
    ring: cython.double[64]
    other: "Other | None"
    name: str

    def __init__(self, name: str) -> None:
        self.name = name
        self.head = self.size = 0

    @property
    def count(self) -> int:
        return self.size

    @cython.ccall
    @cython.exceptval(check=False)
    def put(self, time: cython.longlong, other: "Other", weight: cython.double = 1.0) -> cython.bint:
        return sin(weight) > time

    @cython.cfunc
    @cython.exceptval(-2, check=False)
    def find(self) -> cython.longlong:
        return self.head

    @cython.cfunc
    def note(self, text) -> cython.void:
        pass


@cython.cfunc
@cython.inline
def twice(value: cython.double) -> cython.double:
    return 2.0 * value
"""
OTHER = "import cython\n\n@cython.cclass\nclass Other:\n    pass\n"


@pytest.fixture
def root(tmp_path):
    folder = tmp_path / "ranger_sim" / "ground"
    folder.mkdir(parents=True)
    for name, text in (("events", EVENTS), ("queue", QUEUE), ("other", OTHER), ("plain", "text = 1\n")):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return tmp_path


def made(root, name="queue"):
    sources = Sources(root)
    return Declarations(sources, sources[f"ranger_sim.ground.{name}"])


def test_a_module_that_imports_cython_is_compiled_and_no_other(root):
    assert Sources(root).compiled_modules() == [f"ranger_sim.ground.{name}" for name in ("events", "other", "queue")]


def test_the_declarations_of_a_module_are_these(root):
    assert made(root).pxd() == textwrap.dedent(
        """\
        cimport cython
        from libc.math cimport sin
        from ranger_sim.ground.events cimport LONG, Outbox, ROW
        from ranger_sim.ground.other cimport Other
        cpdef enum:
            WORDS = 3
            TWICE = 6
        cdef long long MASK
        cdef short TABLE[8]
        cdef inline double twice(double value) except? -1
        @cython.final
        cdef class Queue(Outbox):
            cdef public long long head
            cdef long long* rows
            cdef readonly long long[::1] kept
            cdef public const unsigned char[::1] bytes_seen
            cdef public double[64] ring
            cdef public Other other
            cdef public str name
            cpdef bint put(self, long long time, Other other, double weight=*) noexcept
            cdef long long find(self) except <long long>-2
            cdef void note(self, object text) noexcept
        """
    )


def test_a_constant_longer_than_a_c_int_is_a_macro_and_python_gets_its_own(root):
    events = made(root, "events")
    assert "#define RANGER_SIM_LONG 0x4000000000000000LL" in events.pxd()
    assert 'const long long LONG "RANGER_SIM_LONG"' in events.pxd()
    assert "globals()['LONG'] = 4611686018427387904" in events.copy()
    assert "cpdef int push(self, long long time, object ref=*) except -1" in events.pxd()


def test_the_copy_has_the_same_lines_without_what_is_declared(root):
    before, after = QUEUE.splitlines(), made(root).copy().splitlines()
    assert len(before) == len(after)
    changed = {(old.strip(), new.strip()) for old, new in zip(before, after, strict=True) if old != new}
    kept = {(old, new) for old, new in changed if new}
    assert kept == {
        ("from ranger_sim.ground.events import LONG, ROW, Outbox", "from ranger_sim.ground.events import Outbox"),
        ("MASK: cython.longlong = 0xFFFFFFFF", "MASK = 4294967295"),
    }
    gone = {old for old, new in changed if not new}
    assert {"WORDS: Final = 3", "head: cython.longlong", "@cython.ccall", "@cython.cclass"} <= gone
    assert "NAMES: dict = {}" not in gone and "self.head = self.size = 0" not in gone


def test_the_stub_has_what_python_sees_of_the_compiled_module(root):
    sources = Sources(root)
    stub = Stub(sources, sources["ranger_sim.ground.queue"]).text()
    for line in (
        "from ranger_sim.ground.other import Other",
        "WORDS: int",
        "@final",
        "class Queue(Outbox):",
        "    head: int",
        "    def kept(self) -> MutableSequence[int]: ...",
        "    ring: MutableSequence[float]",
        "    other: Other | None",
        "    def __init__(self, name: str) -> None: ...",
        "    def count(self) -> int: ...",
        "    def put(self, time: int, other: Other, weight: float=1.0) -> bool: ...",
    ):
        assert line in stub.splitlines(), line
    assert not any(word in stub for word in ("rows", "find", "note", "MASK", "twice", "cython", "sin"))


@pytest.mark.parametrize(
    ("line", "wrong", "place", "why"),
    [
        ("WORDS: Final = 3", 'WORDS: Final = "x"', "WORDS: Final", "WORDS: a C constant is a whole number, not 'x'"),
        ("WORDS: Final = 3", "WORDS: Final = NO", "WORDS: Final", "WORDS: a constant is made of numbers and earlier"),
        ("head: cython.longlong", "head: cython.longs", "head: cython", "unknown type cython.longs"),
        ("head: cython.longlong", "head: cython.int = 0", "head: cython", "a field of a compiled class has no value"),
        ('"readonly"', '"hidden"', "kept: Annotated", "a field can be annotated as readonly, not as 'hidden'"),
        ("self.head = self.size = 0", "self.haed = 0", "self.haed", "Queue declares no field 'haed'"),
        ("def find(self)", "def find(self, *more)", "def find", "find: a C function has neither stars nor keywords"),
        ("@cython.inline", "@cython.nogil", "def twice", "twice: unknown decorator cython.nogil"),
    ],
)
def test_what_is_not_understood_is_refused_with_file_and_line(root, line, wrong, place, why):
    path = root / "ranger_sim" / "ground" / "queue.py"
    text = QUEUE.replace(line, wrong)
    path.write_text(text, encoding="utf-8")
    [number] = [number for number, each in enumerate(text.splitlines(), 1) if place in each]
    with pytest.raises(DeclarationError) as refused:
        made(root).pxd()
    assert str(refused.value).startswith(f"{path}:{number}: {why}")


def test_a_second_writing_touches_no_file_and_takes_away_what_is_gone(root, tmp_path):
    out = tmp_path / "out"
    names = write_declarations(root, out)
    assert len(names) == 3
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    assert {path.name for path in before} == {
        "__init__.pxd", "events.py", "events.pxd", "other.py", "other.pxd", "queue.py", "queue.pxd",
    }  # fmt: skip
    (out / "ranger_sim" / "ground" / "queue.c").write_text("made by Cython", encoding="utf-8")
    write_declarations(root, out)
    assert all(path.stat().st_mtime_ns == time for path, time in before.items())
    assert (out / "ranger_sim" / "ground" / "queue.c").exists()
    (root / "ranger_sim" / "ground" / "queue.py").unlink()
    write_declarations(root, out)
    assert {path.stem for path in out.rglob("*") if path.is_file()} == {"__init__", "events", "other"}


def test_a_declaration_by_hand_next_to_a_source_gives_its_functions_to_c(root):
    folder = root / "ranger_sim" / "ground"
    (folder / "plain.pxd").write_text("cdef inline long long text(object value):\n    return 1\n", encoding="utf-8")
    queue = made(root)
    assert "from ranger_sim.ground.plain cimport text" in queue.pxd()
    assert "ground.plain" not in queue.copy()
