"""The faults that can be put into a source file: one expression or statement of it, replaced.

Left alone: annotations, decorators, defaults of fields, doc strings, the text of messages (everything inside `raise`
and f-strings), and what asks for `cython.compiled`: a mutant runs interpreted.
"""

import ast
import dataclasses
import difflib

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
}


@dataclasses.dataclass(frozen=True)
class Mutant:
    """One fault: `old` from `begin` to `end` (characters of the file's text) is replaced by `new`.

    `function`: the qualified name around it, empty at the top of the module; `first_line`: where the code of that
    function begins, as Python counts it (with its decorators).
    """

    path: str
    line: int
    function: str
    first_line: int
    operator: str
    old: str
    new: str
    begin: int
    end: int
    occurrence: int = 0  # of the same replacement in the same function, from 0

    @property
    def key(self) -> str:
        """Key that stays valid while the code of its function is unchanged: it has no line numbers."""
        return f"{self.path}::{self.function}::{self.operator}::{self.old} -> {self.new}::{self.occurrence}"

    def applied(self, source: str) -> str:
        """The file's text with this fault in it."""
        return source[: self.begin] + self.new + source[self.end :]

    def difference(self, source: str) -> str:
        """The fault as the changed lines of a unified diff."""
        changes = difflib.unified_diff(source.splitlines(), self.applied(source).splitlines(), lineterm="", n=0)
        return "\n".join(line for line in list(changes)[2:] if not line.startswith("@@"))


def mutants(source: str, path: str) -> list[Mutant]:
    """Every fault that can be put into this text, in order of place; each leaves a file that can be compiled."""
    finder = Finder(source, path)
    finder.visit(ast.parse(source))
    seen: dict[str, int] = {}
    found = []
    for mutant in sorted(finder.found, key=lambda each: (each.begin, each.end, each.operator, each.new)):
        number = seen.get(mutant.key, 0)
        seen[mutant.key] = number + 1
        found.append(dataclasses.replace(mutant, occurrence=number))
    return found


class Finder(ast.NodeVisitor):
    """Walks a syntax tree and adds to `found` the possible changes of each operator at each place."""

    def __init__(self, source: str, path: str) -> None:
        self.source = source
        self.path = path
        self.found: list[Mutant] = []
        self.function: list[str] = []
        self.first_line = 0
        lines = source.splitlines(keepends=True)
        self.ascii = source.isascii()
        self.starts = [0]
        for line in lines:
            self.starts.append(self.starts[-1] + len(line))
        self.lines = lines

    def _place(self, line: int, column: int) -> int:
        """Position in the text at which a node begins or ends; columns of the tree count bytes."""
        if not self.ascii:
            column = len(self.lines[line - 1].encode()[:column].decode())
        return self.starts[line - 1] + column

    def _note(self, node: ast.expr | ast.stmt, operator: str, new: str) -> None:
        assert node.end_lineno is not None and node.end_col_offset is not None
        begin = self._place(node.lineno, node.col_offset)
        end = self._place(node.end_lineno, node.end_col_offset)
        old = self.source[begin:end]
        if old != new:
            name = ".".join(self.function)
            self.found.append(Mutant(self.path, node.lineno, name, self.first_line, operator, old, new, begin, end))

    def _replaced(self, node: ast.expr, operator: str, by: ast.expr) -> None:
        self._note(node, operator, f"({ast.unparse(by)})")

    # --- what is left alone -----------------------------------------------------------------------------------

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Texts are not tested to the letter."""

    def visit_Raise(self, node: ast.Raise) -> None:
        """Only the raising is tested, not the message."""
        self._note(node, "removed statement", "pass")

    def visit_Assert(self, node: ast.Assert) -> None:
        """It is a test itself."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """The value without the annotation; fields of a class without either."""
        if node.value is not None and (self.first_line or not self.function):
            self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        """The condition, then the branches; nothing of `if not cython.compiled`."""
        if not self.function and "cython.compiled" in ast.unparse(node.test):
            return
        if "cython.compiled" not in ast.unparse(node.test):
            self._replaced(node.test, "boolean", ast.UnaryOp(ast.Not(), node.test))
            self.visit(node.test)
        for each in [*node.body, *node.orelse]:
            self.visit(each)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        """Nothing of a choice between compiled and interpreted."""
        if "cython.compiled" not in ast.unparse(node.test):
            self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Its body alone, without the doc string; the outermost function has the name."""
        outer = self.first_line
        self.function.append(node.name)
        if not outer:
            self.first_line = node.decorator_list[0].lineno if node.decorator_list else node.lineno
        for each in node.body:
            self.visit(each)
        self.first_line = outer
        self.function.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Its body."""
        self.function.append(node.name)
        for each in node.body:
            self.visit(each)
        self.function.pop()

    # --- operators --------------------------------------------------------------------------------------------

    def visit_Compare(self, node: ast.Compare) -> None:
        """Each comparison by its neighbour: < by <=, == by !=."""
        for place, each in enumerate(node.ops):
            other = COMPARISONS[type(each)]()
            ops = [*node.ops[:place], other, *node.ops[place + 1 :]]
            self._replaced(node, "comparison", ast.Compare(node.left, ops, node.comparators))
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Another operation; a difference also with the other sign."""
        if not isinstance(node.left, ast.Constant) or not isinstance(node.left.value, str | bytes):
            other = ARITHMETIC.get(type(node.op))
            if other is not None:
                self._replaced(node, "arithmetic", ast.BinOp(node.left, other(), node.right))
            if isinstance(node.op, ast.Sub):
                self._replaced(node, "sign", ast.BinOp(node.right, ast.Sub(), node.left))
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """Without its sign, without its `not`."""
        if isinstance(node.op, ast.USub):
            self._replaced(node, "sign", node.operand)
        if isinstance(node.op, ast.Not):
            if "cython.compiled" in ast.unparse(node):
                return
            self._replaced(node, "boolean", node.operand)
        if not isinstance(node.operand, ast.Constant):
            self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """`and` by `or`, and each by the other."""
        if "cython.compiled" in ast.unparse(node):
            return
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        self._replaced(node, "boolean", ast.BoolOp(other, node.values))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """A number by another one, True by False."""
        if isinstance(node.value, bool):
            self._note(node, "constant", str(not node.value))
        elif isinstance(node.value, int):
            self._note(node, "constant", f"({node.value + 1})")
        elif isinstance(node.value, float):
            self._note(node, "constant", f"({node.value * 2.0 if node.value else 1.0!r})")

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Left out; the other operation."""
        self._note(node, "removed statement", "pass")
        other = ARITHMETIC.get(type(node.op))
        if other is not None:
            self._note(node, "arithmetic", ast.unparse(ast.AugAssign(node.target, other(), node.value)))
        self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        """Left out, where something other than a local name is set."""
        if self.first_line and all(isinstance(each, ast.Attribute | ast.Subscript) for each in node.targets):
            self._note(node, "removed statement", "pass")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        """Calls made for their effect: left out."""
        if isinstance(node.value, ast.Constant):
            return  # a doc string
        if self.first_line:
            self._note(node, "removed statement", "pass")
        self.generic_visit(node)

    def visit_Break(self, node: ast.Break) -> None:
        """The loop goes on."""
        self._note(node, "removed statement", "pass")

    def visit_Continue(self, node: ast.Continue) -> None:
        """The rest of the loop's body runs as well."""
        self._note(node, "removed statement", "pass")

    def visit_Return(self, node: ast.Return) -> None:
        """A bare one is left out."""
        if node.value is None:
            self._note(node, "removed statement", "pass")
        self.generic_visit(node)
