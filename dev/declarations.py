"""Files for Cython and type checkers, generated from the one annotated source of a compiled module.

A module of `ranger_sim` that contains `import cython` is compiled. Its source declares everything itself:

    WORDS: Final = 3                       a C constant (a whole number, or an expression of earlier ones)
    MASK: cython.longlong = 0xFFFFFFFF     a C variable of the module, not visible from Python
    @cython.cclass                         a class whose fields are declared in its body:
    field: cython.longlong                     visible from Python
    field: Annotated[list, "readonly"]         Python may read it; a pointer (cython.p_double) it does not see
    @cython.ccall, @cython.cfunc           a function or method of C, visible from Python or not;
    @cython.exceptval(-1, check=False)         where its clause is not the usual one of its return type
    def f(...) -> None                         a C int that is -1 after an exception; -> cython.void raises nothing

Three texts are generated from it: the `.pxd` that other modules cimport; a copy of the source with the same line
numbers for Cython, without the declarations of the `.pxd`; and the `.pyi` for type checkers (stubs.py). Unknown
constructs are refused with file and line, as is an assignment to `self.x` where no field `x` is declared.

A `.pxd` in the tree next to a source is written by hand: C twins of the functions of that source, which
compiled modules use in their place.
"""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeGuard

PACKAGE = "ranger_sim"
COMPILED = re.compile(r"^import cython\b", re.MULTILINE)
C_TYPES = {
    "bint": "bint",
    "char": "char",
    "double": "double",
    "float": "float",
    "int": "int",
    "longlong": "long long",
    "schar": "signed char",
    "short": "short",
    "uchar": "unsigned char",
    "uint": "unsigned int",
    "ulonglong": "unsigned long long",
    "ushort": "unsigned short",
    "void": "void",
}
TYPE = re.compile(  # as ast writes it: cython.const[cython.uchar][::1], cython.p_double, cython.longlong[64]
    r"cython\.(?P<const>const\[cython\.)?(?P<pointer>p_)?(?P<name>\w+)(?(const)\])(?P<array>.*)"
)
BUILTIN = {"bytearray", "bytes", "dict", "list", "object", "set", "str", "tuple"}
OF_FUNCTIONS = {"ccall", "cfunc", "inline", "exceptval", "locals"}  # decorators that the .pxd carries
KEPT_IN_COPY = {"final", "boundscheck", "wraparound", "cdivision", "initializedcheck"}
# of a result by its type; `int` is that of a function without a result. Stated explicitly, because Cython's default for
# a function whose body is in a .py is `except *`, which checks for an exception after every call. Without the cast
# Cython 3.3 writes -1LLLL into the C file of another module.
USUAL_CLAUSE = {
    "int": " except -1",
    "void": " noexcept",
    "long long": " except? <long long>-1",
    **dict.fromkeys(["bint", "double", "float", "short", "unsigned long long"], " except? -1"),
}
C_FUNCTION = re.compile(r"^cdef inline .*?(\w+)\(", re.MULTILINE)
SMALLEST, LARGEST = -(2**31), 2**31 - 1  # of an enum


class Placed(Protocol):
    """A node with a position in a source."""

    lineno: int
    end_lineno: int | None


class DeclarationError(Exception):
    """A source contains something that cannot be declared; the text has file and line."""


def is_compiled(text: str) -> bool:
    """Whether the module with this source is compiled."""
    return COMPILED.search(text) is not None


def decorators(node: ast.FunctionDef | ast.ClassDef) -> dict[str, ast.expr]:
    """{name: decorator}, `cython.ccall` as "cython.ccall", arguments left out of the name."""
    return {ast.unparse(each).partition("(")[0]: each for each in node.decorator_list}


def is_c_function(node: ast.stmt) -> TypeGuard[ast.FunctionDef]:
    """Whether this is a function or method of C."""
    return isinstance(node, ast.FunctionDef) and not decorators(node).keys().isdisjoint(
        {"cython.ccall", "cython.cfunc"}
    )


@dataclass
class Field:
    """A field of a compiled class; `annotation`: its type alone."""

    node: ast.AnnAssign
    name: str
    annotation: ast.expr
    access: str  # public, readonly; empty: of C alone


class Source:
    """One annotated source: its declarations, by kind and name."""

    def __init__(self, path: Path, name: str) -> None:
        self.path, self.name = path, name
        self.text = path.read_text(encoding="utf-8")
        self.tree = ast.parse(self.text, str(path))
        self.compiled = is_compiled(self.text)
        self.constants: dict[str, ast.AnnAssign] = {}
        self.variables: dict[str, ast.AnnAssign] = {}
        self.functions: dict[str, ast.FunctionDef] = {}
        self.classes: dict[str, ast.ClassDef] = {}
        for node in self.tree.body if self.compiled else ():
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                kind = ast.unparse(node.annotation)
                if kind == "Final":
                    self.constants[node.target.id] = node
                elif kind.startswith("cython."):
                    self.variables[node.target.id] = node
            elif is_c_function(node):
                self.functions[node.name] = node
            elif isinstance(node, ast.ClassDef) and "cython.cclass" in decorators(node):
                self.classes[node.name] = node
        by_hand = path.with_suffix(".pxd")
        self.by_hand = set(C_FUNCTION.findall(by_hand.read_text(encoding="utf-8"))) if by_hand.exists() else set()

    @property
    def c_names(self) -> set[str]:
        """Names that compiled modules find in C and not in Python, classes aside."""
        return {*self.constants, *self.variables, *self.functions, *self.by_hand}

    @property
    def only_in_c(self) -> set[str]:
        """Names at the top of the module that Python does not see when it is compiled."""
        functions = {name for name, node in self.functions.items() if "cython.cfunc" in decorators(node)}
        return functions | set(self.variables)

    def fields(self, owner: ast.ClassDef) -> Iterator[Field]:
        """The declared fields of a class, in their order; a name with a value is an attribute of the class itself."""
        for node in owner.body:
            if isinstance(node, ast.AnnAssign) and node.value is not None and "cython." in ast.unparse(node.annotation):
                raise self.refusal(node, "a field of a compiled class has no value in the class body")
            if isinstance(node, ast.AnnAssign) and node.value is None and isinstance(node.target, ast.Name):
                annotation, access = node.annotation, "public"
                if isinstance(annotation, ast.Subscript) and ast.unparse(annotation.value) == "Annotated":
                    annotation, word = getattr(annotation.slice, "elts", [annotation, annotation])
                    access = ast.unparse(word)
                    if access != "'readonly'":
                        raise self.refusal(node, f"a field can be annotated as readonly, not as {access}")
                    access = "readonly"
                yield Field(node, node.target.id, annotation, "" if is_pointer(annotation) else access)

    def imports(self) -> Iterator[ast.ImportFrom]:
        """`from ... import` at the top of the module and under TYPE_CHECKING."""

        def inside(body: list[ast.stmt]) -> Iterator[ast.ImportFrom]:
            for node in body:
                if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                    yield from inside(node.body)
                elif isinstance(node, ast.ImportFrom):
                    yield node

        return inside(self.tree.body)

    def refusal(self, node: Placed, why: str) -> DeclarationError:
        """The error to raise for a node of this source."""
        return DeclarationError(f"{self.path}:{node.lineno}: {why}")


def is_pointer(annotation: ast.expr) -> bool:
    """Whether a type is a C pointer."""
    return ast.unparse(annotation).startswith("cython.p_")


class Sources:
    """All modules below a folder that holds the package, read on first use."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.read: dict[str, Source | None] = {}

    def compiled_modules(self) -> list[str]:
        """Names of the modules that are compiled, sorted."""
        found = []
        for path in sorted(Path(self.root, PACKAGE).glob("*/")):
            for each in path.rglob("*.py"):
                if is_compiled(each.read_text(encoding="utf-8")):
                    found.append(".".join(each.relative_to(self.root).with_suffix("").parts))
        return sorted(found)

    def __getitem__(self, name: str) -> Source:
        """The source of an existing module."""
        source = self.module(name)
        if source is None:
            raise KeyError(name)
        return source

    def module(self, name: str) -> Source | None:
        """The source of a module of the package; None for a package and any other name."""
        if name not in self.read:
            path = self.root.joinpath(*name.split(".")).with_suffix(".py")
            known = name.startswith(f"{PACKAGE}.") and path.is_file()
            self.read[name] = Source(path, name) if known else None
        return self.read[name]


@dataclass
class Declarations:
    """The texts generated from one source."""

    sources: Sources
    source: Source
    lines: list[str] = field(default_factory=lambda: ["cimport cython"])  # of the .pxd
    edits: list[tuple[int, int, str]] = field(default_factory=list)  # (first line, last line, text) of the copy
    classes: set[str] = field(default_factory=set)  # compiled classes by the names that they have here

    def __post_init__(self) -> None:
        self.classes |= set(self.source.classes)
        self._imports()
        self._constants()
        for name, node in self.source.variables.items():
            self._variable(name, node)
        for function in self.source.functions.values():
            self._function(function, "")
        for owner in self.source.classes.values():
            self._class(owner)

    def pxd(self) -> str:
        """The declarations that other modules cimport."""
        return "\n".join(self.lines) + "\n"

    def copy(self) -> str:
        """The source for Cython, with the same line numbers."""
        lines = self.source.text.splitlines()
        for first, last, text in self.edits:
            lines[first - 1 : last] = [text] + [""] * (last - first)
        return "\n".join(lines) + "\n"

    def _drop(self, node: Placed, text: str = "") -> None:
        self.edits.append((node.lineno, node.end_lineno or node.lineno, text))

    def _imports(self) -> None:
        cimports: dict[str, set[str]] = {}
        for node in self.source.imports():
            module = node.module or ""
            if module.startswith("cython.cimports."):
                cimports.setdefault(module.removeprefix("cython.cimports."), set()).update(map(spelt, node.names))
                self._drop(node)
                continue
            other = self.sources.module(module)
            if other is None:
                continue
            # `import X as X` exports the name to Python, so it is not a C name here
            in_c = {each.name for each in node.names if each.name in other.c_names and each.asname != each.name}
            self.classes |= {each.asname or each.name for each in node.names if each.name in other.classes}
            wanted = {spelt(each) for each in node.names if each.name in in_c or each.name in other.classes}
            if wanted:
                cimports.setdefault(module, set()).update(wanted)
            if in_c:
                left = ", ".join(spelt(each) for each in node.names if each.name not in in_c)
                indent = " " * node.col_offset
                empty = "pass" if indent else ""
                self._drop(node, indent + (f"from {module} import {left}" if left else empty))
        for module, names in sorted(cimports.items()):
            self.lines.append(f"from {module} cimport {', '.join(sorted(names))}")

    def _constants(self) -> None:
        values: dict[str, int] = {}
        small: list[str] = []
        large: list[str] = []
        for name, node in self.source.constants.items():
            try:
                value = eval(compile(ast.unparse(node.value or node), "", "eval"), {"__builtins__": {}}, dict(values))
            except Exception as error:  # noqa: BLE001  (whatever an expression can raise)
                raise self.source.refusal(
                    node, f"{name}: a constant is made of numbers and earlier constants ({error})"
                ) from None
            if type(value) is not int:
                raise self.source.refusal(node, f"{name}: a C constant is a whole number, not {value!r}")
            values[name] = value
            (small if SMALLEST <= value <= LARGEST else large).append(name)
        for name in large:  # too long for an enum: a macro in C, and Python gets its own
            self.lines += [
                "cdef extern from *:",
                '    """',
                f"    #define RANGER_SIM_{name} {values[name]:#x}LL",
                '    """',
            ]
            self.lines.append(f'    const long long {name} "RANGER_SIM_{name}"')
        if small:
            self.lines += ["cpdef enum:", *(f"    {name} = {values[name]}" for name in small)]
        for name, node in self.source.constants.items():
            self._drop(node, f"globals()[{name!r}] = {values[name]}" if name in large else "")

    def _variable(self, name: str, node: ast.AnnAssign) -> None:
        kind, bracket, size = self.c_type(node.annotation, node).partition("[")
        array = bool(bracket) and "::" not in size
        self.lines.append(f"cdef {kind} {name}[{size}" if array else f"cdef {kind}{bracket}{size} {name}")
        self._drop(node, "" if array or node.value is None else f"{name} = {ast.unparse(node.value)}")

    def _function(self, node: ast.FunctionDef, indent: str) -> None:
        have = decorators(node)
        unknown = [name for name in have if name.removeprefix("cython.") not in OF_FUNCTIONS | KEPT_IN_COPY]
        if unknown:
            raise self.source.refusal(node, f"{node.name}: unknown decorator {unknown[0]}")
        if node.args.vararg or node.args.kwonlyargs or node.args.kwarg or node.args.posonlyargs:
            raise self.source.refusal(node, f"{node.name}: a C function has neither stars nor keywords")
        required = len(node.args.args) - len(node.args.defaults)
        arguments = [
            ("" if each.arg == "self" and indent else self.c_type(each.annotation, each) + " ")
            + each.arg
            + ("=*" if number >= required else "")
            for number, each in enumerate(node.args.args)
        ]
        returns = self.c_type(node.returns, node)
        clause = self._clause(have.get("cython.exceptval"), returns)
        if returns == "None":
            returns, clause = "int", clause or USUAL_CLAUSE["int"]
        clause = clause or USUAL_CLAUSE.get(returns, "")
        if "cython.final" in have:
            self.lines.append(f"{indent}@cython.final")
        if "cython.locals" in have:
            self.lines.append(f"{indent}@{ast.unparse(have['cython.locals'])}")
        kind = "cpdef" if "cython.ccall" in have else "cdef"
        inline = " inline" if "cython.inline" in have else ""
        self.lines.append(f"{indent}{kind}{inline} {returns} {node.name}({', '.join(arguments)}){clause}")
        for name, each in have.items():
            if name.removeprefix("cython.") in OF_FUNCTIONS:
                self._drop(each)

    @staticmethod
    def _clause(decorator: ast.expr | None, returns: str) -> str:
        """The exception clause of a decorator; empty without one."""
        if not isinstance(decorator, ast.Call):
            return ""
        check = not any(each.arg == "check" and ast.unparse(each.value) == "False" for each in decorator.keywords)
        if not decorator.args:
            return " except *" if check else " noexcept"
        cast = "<long long>" if returns == "long long" else ""
        return f" except{'?' if check else ''} {cast}{ast.unparse(decorator.args[0])}"

    def _class(self, node: ast.ClassDef) -> None:
        bases = [ast.unparse(each) for each in node.bases if ast.unparse(each) in self.classes]
        if len(bases) > 1:
            raise self.source.refusal(node, f"{node.name}: a compiled class has one compiled base")
        if "cython.final" in decorators(node):
            self.lines.append("@cython.final")
        self.lines.append(f"cdef class {node.name}" + (f"({bases[0]})" if bases else "") + ":")
        before = len(self.lines)
        for field_ in self.source.fields(node):
            access = field_.access and f"{field_.access} "
            self.lines.append(f"    cdef {access}{self.c_type(field_.annotation, field_.node)} {field_.name}")
            self._drop(field_.node)
        for statement in node.body:
            if is_c_function(statement):
                self._function(statement, "    ")
        if len(self.lines) == before:
            self.lines.append("    pass")
        for name, decorator in decorators(node).items():
            if name in ("cython.cclass", "cython.final"):
                self._drop(decorator)
        self._check_assignments(node)

    def c_type(self, annotation: ast.expr | None, place: Placed) -> str:
        """The C type of an annotation; "None" for a function without a result."""
        if annotation is None:
            return "object"
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            annotation = ast.parse(annotation.value, mode="eval").body
        text = ast.unparse(annotation)
        if text == "None":
            return text
        if isinstance(annotation, ast.BinOp):  # A | None
            parts = [each for each in text.split(" | ") if each != "None"]
            return parts[0] if len(parts) == 1 and parts[0] in self.classes | BUILTIN else "object"
        if text.startswith("cython."):
            found = TYPE.fullmatch(text)
            if found is None or found["name"] not in C_TYPES:
                raise self.source.refusal(place, f"unknown type {text}")
            constant = "const " if found["const"] else ""
            return constant + C_TYPES[found["name"]] + ("*" if found["pointer"] else "") + found["array"]
        name = ast.unparse(annotation.value) if isinstance(annotation, ast.Subscript) else text
        return name if name in self.classes | BUILTIN else "object"

    def _check_assignments(self, owner: ast.ClassDef) -> None:
        """DeclarationError for an assignment to `self.x` where neither the class nor a base declares `x`."""
        known = assignable(self.sources, self.source, owner)
        if known is None:
            return
        for node in ast.walk(owner):
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.ctx, ast.Store)
                and ast.unparse(node.value) == "self"
            ):
                if node.attr not in known:
                    raise self.source.refusal(node, f"{owner.name} declares no field {node.attr!r}")


def assignable(sources: Sources, source: Source, owner: ast.ClassDef) -> set[str] | None:
    """Names of fields and properties of a class and its bases; None when a base is not a class of ours."""
    known = {each.name for each in source.fields(owner)}
    known |= {each.name for each in owner.body if isinstance(each, ast.FunctionDef) and each.decorator_list}
    for base in map(ast.unparse, owner.bases):
        if base in source.classes:
            more = assignable(sources, source, source.classes[base])
        else:
            origin = next((n for n in source.imports() for a in n.names if (a.asname or a.name) == base), None)
            other = sources.module(origin.module or "") if origin is not None else None
            if other is None or base not in other.classes:
                return None
            more = assignable(sources, other, other.classes[base])
        if more is None:
            return None
        known |= more
    return known


def spelt(each: ast.alias) -> str:
    """A name of an import as written."""
    return each.name + (f" as {each.asname}" if each.asname else "")


def write_declarations(root: Path, folder: Path) -> list[str]:
    """Write the `.pxd` and the copy of every compiled module below `folder`; returns the modules' names.

    Up-to-date files are not written, so that their dependants are not rebuilt; files of removed modules are deleted.
    DeclarationError for a source that cannot be processed.
    """
    sources = Sources(root)
    names = sources.compiled_modules()
    texts: dict[Path, str] = {}
    for name in names:
        made = Declarations(sources, sources[name])
        path = folder.joinpath(*name.split("."))
        texts[path.with_suffix(".pxd")] = made.pxd()
        texts[path.with_suffix(".py")] = made.copy()
    for by_hand in Path(root, PACKAGE).glob("*/**/*.pxd"):
        texts[folder / by_hand.relative_to(root)] = by_hand.read_text(encoding="utf-8")
    for path in list(texts):
        for above in path.relative_to(folder).parents:
            if above.parts:
                texts[folder / above / "__init__.pxd"] = ""
    for old in folder.rglob("*"):
        if (
            old.suffix in (".pxd", ".py", ".c")
            and not {old, old.with_suffix(".py")} & texts.keys()
            and old.stem != "_shared"
        ):
            old.unlink()
    for path, text in texts.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    return names
