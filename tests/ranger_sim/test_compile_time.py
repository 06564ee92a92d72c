"""`cython.cast` and `cython.compiled` are settled when a source is loaded; everything else stays as and where it is."""

import ast
import importlib.machinery
import importlib.util
import pathlib
import sys
import traceback

import pytest

from ranger_sim.compile_time import CompileTimeLoader, Settle

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
DECLARED = [
    path.with_suffix(".py")
    for package in ("foundation", "datatable", "can_bus", "plant", "firmware_sim", "boards", "harness")
    for path in sorted((ROOT / package).rglob("*.pxd"))
]
SOURCE = """\
import cython

def first(row):
    return (
        cython.cast(int,
                    row[0]) / 0
    )

def second():
    if cython.compiled:
        return "compiled"
    return "interpreted"
"""


def settled(text):
    return Settle().visit(ast.parse(text))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cython.cast(T, x)", "x"),
        ("cython.cast(T, rows[cython.cast(cython.longlong, i)]).take(cython.cast(U, b))", "rows[i].take(b)"),
        ("a = f() if cython.compiled else g()", "a = f() if False else g()"),
        ("if not cython.compiled:\n    import x\n    f()", "import x\nf()"),
        ("if cython.compiled:\n    f()\nelse:\n    g()\n    h()", "g()\nh()"),
        ("if a:\n    f()\nelif cython.compiled:\n    g()\nelse:\n    h()", "if a:\n    f()\nelse:\n    h()"),
        ("while a:\n    if cython.compiled:\n        f()", "while a:\n    pass"),
        ("if cython.compiled and a:\n    f()", "if False and a:\n    f()"),
        # what only looks like it
        ("cython.cast(T, x, typecheck=True)", "cython.cast(T, x, typecheck=True)"),
        ("cython.cast(*both)", "cython.cast(*both)"),
        ("other.cast(T, x), cast(T, x), cython.cast", "other.cast(T, x), cast(T, x), cython.cast"),
        ("cython.compiled = 1", "cython.compiled = 1"),
        ("other.compiled, other.cython.compiled", "other.compiled, other.cython.compiled"),
    ],
)
def test_settled_expressions(text, expected):
    assert ast.dump(settled(text)) == ast.dump(ast.parse(expected))


@pytest.mark.parametrize("path", DECLARED, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_nothing_is_left_to_settle_and_everything_keeps_its_place(path):
    def places(tree):
        return {
            (type(node), node.lineno, node.col_offset, node.end_lineno, node.end_col_offset)
            for node in ast.walk(tree)
            if hasattr(node, "lineno") and not isinstance(node, ast.Constant | ast.Pass)
        }

    text = path.read_text(encoding="utf-8")
    tree = settled(text)
    assert places(tree) <= places(ast.parse(text))
    assert not any(
        isinstance(node, ast.Attribute) and ast.unparse(node) in ("cython.cast", "cython.compiled")
        for node in ast.walk(tree)
    )


def load(path, kind):
    spec = importlib.util.spec_from_loader("trial", kind("trial", str(path)))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def source(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "trial.pxd").touch()
    (tmp_path / "trial.py").write_text(SOURCE, encoding="utf-8")
    return tmp_path / "trial.py"


def test_a_traceback_shows_the_lines_of_the_file(source):
    try:
        load(source, CompileTimeLoader).first([1])
    except ZeroDivisionError as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
    assert (place.lineno, place.end_lineno, place.colno) == (5, 6, 8)


def test_a_module_that_is_not_for_the_compiler_is_left_as_it_is(source):
    source.with_suffix(".pxd").unlink()
    assert "compiled" in load(source, CompileTimeLoader).second.__code__.co_names


def test_what_is_kept_is_used_again_but_by_no_other_loader(source, monkeypatch):
    plain = importlib.machinery.SourceFileLoader
    for _ in range(2):  # the second time from the bytecode
        assert "compiled" in load(source, plain).second.__code__.co_names
        assert "compiled" not in load(source, CompileTimeLoader).second.__code__.co_names
    monkeypatch.setattr("ranger_sim.compile_time.TAG", "other")
    load(source, CompileTimeLoader)
    assert len(list(source.parent.rglob("*.pyc"))) == 3
    monkeypatch.setattr("ranger_sim.compile_time.Settle", None)  # nothing is settled any more
    assert load(source, CompileTimeLoader).second() == "interpreted"
