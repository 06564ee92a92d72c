"""The `.pyi` of a compiled module, for type checkers, made from its one annotated source (declarations.py)."""

import ast
import copy
from pathlib import Path

from dev.declarations import TYPE, Source, Sources, decorators

REALS = {"double", "float"}
HELPERS = {"Any": "typing", "MutableSequence": "collections.abc", "final": "typing"}
LITERALS: dict[type, str] = {bool: "bool", int: "int", float: "float", str: "str", bytes: "bytes"}


class Stub:
    """The `.pyi` of one source as compiled, so without C functions and C variables."""

    def __init__(self, sources: Sources, source: Source) -> None:
        self.sources, self.source = sources, source
        self.helpers: set[str] = set()
        self.lines: list[str] = []
        for node in source.tree.body:
            self._statement(node)

    def text(self) -> str:
        """The stub."""
        head = [f"from {HELPERS[name]} import {name}" for name in sorted(self.helpers)]
        return "\n".join([f"# Generated from {self.source.path.name}.", *head, *self.lines]) + "\n"

    def _any(self) -> str:
        self.helpers.add("Any")
        return "Any"

    def _statement(self, node: ast.stmt) -> None:
        if isinstance(node, ast.Import | ast.ImportFrom):
            module = getattr(node, "module", None) or node.names[0].name
            other = self.sources.module(module)
            names = [each for each in node.names if other is None or each.name not in other.only_in_c]
            if names and module.partition(".")[0] != "cython":
                self.lines.append(ast.unparse(type(node)(**{**vars(node), "names": names})))
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for each in node.body:
                self._statement(each)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            if node.target.id in self.source.constants:
                self.lines.append(f"{node.target.id}: int")
            elif node.target.id not in self.source.variables:
                self.lines.append(f"{node.target.id}: {self.python_type(node.annotation)}")
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                for name in [target] if isinstance(target, ast.Name) else getattr(target, "elts", []):
                    if isinstance(name, ast.Name):
                        self.lines.append(f"{name.id}: {self._kind_of(node.value if name is target else None)}")
        elif isinstance(node, ast.FunctionDef):
            self._function(node, "")
        elif isinstance(node, ast.ClassDef):
            self._class(node)

    def _kind_of(self, value: ast.expr | None) -> str:
        """The type of a literal; Any for everything else."""
        if isinstance(value, ast.UnaryOp):
            value = value.operand
        return LITERALS.get(type(value.value), self._any()) if isinstance(value, ast.Constant) else self._any()

    def _function(self, node: ast.FunctionDef, indent: str) -> None:
        have = decorators(node)
        if "cython.cfunc" in have:
            return
        for name, each in have.items():
            if not name.startswith("cython."):
                self.lines.append(f"{indent}@{ast.unparse(each)}")
        copied = copy.deepcopy(node.args)
        everything = [*copied.posonlyargs, *copied.args, *copied.kwonlyargs, copied.vararg, copied.kwarg]
        for number, argument in enumerate(each for each in everything if each is not None):
            if not (indent and number == 0 and argument.arg in ("self", "cls")):
                argument.annotation = ast.Name(self.python_type(argument.annotation))
        copied.defaults = [short(value) for value in copied.defaults]
        copied.kw_defaults = [value and short(value) for value in copied.kw_defaults]
        returns = "None" if node.name == "__init__" else self.python_type(node.returns)
        self.lines.append(f"{indent}def {node.name}({ast.unparse(copied)}) -> {returns}: ...")

    def _class(self, node: ast.ClassDef) -> None:
        compiled = node.name in self.source.classes
        have = decorators(node)
        if "cython.final" in have:
            self.helpers.add("final")
            self.lines.append("@final")
        self.lines += [f"@{ast.unparse(each)}" for name, each in have.items() if not name.startswith("cython.")]
        bases = ", ".join(map(ast.unparse, [*node.bases]))
        self.lines.append(f"class {node.name}" + (f"({bases})" if bases else "") + ":")
        before = len(self.lines)
        if compiled:
            for field in self.source.fields(node):
                kind = self.python_type(field.annotation)
                if field.access == "public":
                    self.lines.append(f"    {field.name}: {kind}")
                elif field.access == "readonly":
                    self.lines += ["    @property", f"    def {field.name}(self) -> {kind}: ..."]
        self._attributes(node, compiled)
        for each in node.body:
            if isinstance(each, ast.FunctionDef):
                self._function(each, "    ")
        if len(self.lines) == before:
            self.lines.append("    pass")

    def _attributes(self, node: ast.ClassDef, compiled: bool) -> None:
        """Attributes of the class; of an ordinary class the fields too, declared in its body or set in its methods."""
        names: set[str] = set()
        for each in node.body:
            if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name):
                if compiled and each.value is None:
                    continue
                names.add(each.target.id)
                value = "" if each.value is None else " = ..."
                self.lines.append(f"    {each.target.id}: {self.python_type(each.annotation)}{value}")
            elif isinstance(each, ast.Assign):
                for target in each.targets:
                    if isinstance(target, ast.Name):
                        names.add(target.id)
                        self.lines.append(f"    {target.id}: {self._kind_of(each.value)}")
        if compiled:
            return
        names |= {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
        for inside in ast.walk(node):
            if isinstance(inside, ast.Attribute) and isinstance(inside.ctx, ast.Store):
                if ast.unparse(inside.value) == "self" and inside.attr not in names:
                    names.add(inside.attr)
                    self.lines.append(f"    {inside.attr}: {self._any()}")

    def python_type(self, annotation: ast.expr | None) -> str:
        """The type that Python sees."""
        if annotation is None:
            return self._any()
        text = ast.unparse(annotation)
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            text = annotation.value
        if text == "object":
            return self._any()
        if not text.startswith("cython."):
            return text
        found = TYPE.fullmatch(text)
        if found is None:
            return self._any()
        kind = "float" if found["name"] in REALS else {"bint": "bool", "void": "None"}.get(found["name"], "int")
        if found["pointer"] or found["array"]:
            self.helpers.add("MutableSequence")
            return f"MutableSequence[{kind}]"
        return kind


def short(default: ast.expr) -> ast.expr:
    """A default in a stub: literals, and dots for everything else."""
    plain = (
        isinstance(default, ast.Constant)
        or isinstance(default, ast.UnaryOp)
        and isinstance(default.operand, ast.Constant)
    )
    return default if plain else ast.Constant(...)


def stubs(root: Path) -> dict[str, str]:
    """{place of the `.pyi` below the root: its text} of every compiled module."""
    sources = Sources(root)
    return {name.replace(".", "/") + ".pyi": Stub(sources, sources[name]).text() for name in sources.compiled_modules()}
