"""What the compiler settles about a module once is settled here when its source is loaded to run interpreted.

Two expressions in our sources are meant for the compiler, and plain Python would evaluate them at every use, 300,000
times per simulated second: `cython.cast(T, x)`, which says what x is and becomes `x`, and `cython.compiled`, which is
False; of an `if` on that, what runs is left. Nothing else is touched, and every expression keeps its lines and
columns: tracebacks, debuggers and coverage show the source as it stands.
"""

import ast
import importlib.machinery
import importlib.util
import pathlib
import sys
import zlib
from types import CodeType
from typing import Any

# In the names of the bytecode files (PEP 488 leaves this place to whoever changes a syntax tree), with a sum over this
# file and the level of Python's own -O: no other loader uses what ours kept, nor ours what another or an older one did.
TAG = f"settled{zlib.crc32(pathlib.Path(__file__).read_bytes()):08x}{sys.flags.optimize}"


class Settle(ast.NodeTransformer):
    """Puts the value for the two expressions, and what runs for an `if` that depends on nothing else."""

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """`cython.cast(T, x)`: x."""
        match node:
            case ast.Call(ast.Attribute(ast.Name("cython"), "cast"), [_, value], []):
                return self.visit(value)
        return self.generic_visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """`cython.compiled`: False."""
        match node:
            case ast.Attribute(ast.Name("cython"), "compiled", ast.Load()):
                return ast.copy_location(ast.Constant(False), node)
        return self.generic_visit(node)

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        """`if cython.compiled`, `if not cython.compiled`: the statements that run."""
        self.generic_visit(node)
        match node.test:
            case ast.Constant(False):
                return node.orelse or ast.copy_location(ast.Pass(), node)
            case ast.UnaryOp(ast.Not(), ast.Constant(False)):
                return node.body
        return node


class CompileTimeLoader(importlib.machinery.SourceFileLoader):
    """Runs a .py file; one with a .pxd beside it, which is meant for the compiler, with those expressions settled."""

    def __init__(self, fullname: str, path: str) -> None:
        super().__init__(fullname, path)
        self.declaration = pathlib.Path(path).with_suffix(".pxd")
        self.settles = self.declaration.exists()

    def source_to_code(self, data: Any, path: Any, *, _optimize: int = -1) -> CodeType:  # type: ignore[override]
        """The code object of a source text."""
        tree = Settle().visit(ast.parse(data, path)) if self.settles else data
        return super().source_to_code(tree, path, _optimize=_optimize)

    def own_name(self, path: str) -> str:
        """Where we keep what another loader would keep in the file `path`."""
        if self.settles and path.endswith(tuple(importlib.machinery.BYTECODE_SUFFIXES)):
            return importlib.util.cache_from_source(self.path, optimization=TAG)
        return path

    def get_data(self, path: str) -> bytes:
        """The bytes of a source or bytecode file."""
        return super().get_data(self.own_name(path))

    def set_data(self, path: str, data: Any, *, _mode: int = 0o666) -> None:
        """Write a bytecode file."""
        super().set_data(self.own_name(path), data, _mode=_mode)
