"""Type stubs of the compiled modules, for type checkers: `python -m ranger_sim.tools.stubs [--check]`.

A compiled module's types stand in two places: the C types of its .pxd, and the annotations of its .py, of which some
are names of C types as well (`cython.longlong`). Type checkers read neither. From both this writes one .pyi per module
into `stubs/`, in folders named like the rooms. They are checked in; setup.py lays each beside its module in the wheel.

What a stub says is what holds compiled: C functions, C variables and fields that are not public are left out, and a
field that is `readonly` is a property. A type that neither file tells is found where a simple expression gives it (a
literal, a field, arithmetic with these); otherwise it is Any.
"""

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeGuard

from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import HOUSE, declared_modules

STUBS = HOUSE / "stubs"
REGENERATE = "python -m ranger_sim.tools.stubs"

INTEGERS = ("long long", "unsigned long long", "int", "unsigned char", "unsigned int", "short", "long", "char")
PLAIN = {**dict.fromkeys(INTEGERS, "int"), "double": "float", "float": "float", "bint": "bool", "void": "None"}
OF_CYTHON = {
    **dict.fromkeys(("longlong", "ulonglong", "int", "uint", "long", "short", "char", "uchar", "Py_ssize_t"), "int"),
    **dict.fromkeys(("double", "float"), "float"),
    "bint": "bool",
    "void": "None",
    "p_double": "MutableSequence[float]",
    "p_longlong": "MutableSequence[int]",
}
BARE = {
    "object": "Any",
    "list": "list[Any]",
    "dict": "dict[Any, Any]",
    "set": "set[Any]",
    "tuple": "tuple[Any, ...]",
    "type": "type[Any]",
}
KNOWN_CALLS = {"len": "int", "int": "int", "float": "float", "str": "str", "repr": "str", "bool": "bool", "hex": "str"}
HELPERS = {"Any": "typing", "final": "typing", "MutableSequence": "collections.abc"}


# --- what a .pxd declares ---------------------------------------------------------------------------------


@dataclass
class DeclaredFunction:
    """A C or Python-visible function or method: its type, the types of its parameters by name."""

    returns: str
    parameters: dict[str, str]
    visible: bool


@dataclass
class DeclaredClass:
    """An extension type: fields that Python sees (name: (type, read-only)), methods."""

    fields: dict[str, tuple[str, bool]] = field(default_factory=dict)
    methods: dict[str, DeclaredFunction] = field(default_factory=dict)
    final: bool = False


@dataclass
class Declaration:
    """What one .pxd declares."""

    constants: list[str] = field(default_factory=list)
    hidden: set[str] = field(default_factory=set)  # C variables
    functions: dict[str, DeclaredFunction] = field(default_factory=dict)
    classes: dict[str, DeclaredClass] = field(default_factory=dict)
    imports: dict[str, str] = field(default_factory=dict)  # name: module


def type_of_c(text: str) -> str:
    """The Python type of a C type as a .pxd writes it."""
    text = text.strip()
    view = re.fullmatch(r"([\w ]+?)\s*(?:\[[^\]]*\]|\*)", text)
    if view:
        inside = type_of_c(view[1])
        return f"MutableSequence[{inside}]" if inside in ("int", "float") else "Any"
    return PLAIN.get(text) or BARE.get(text) or text


def split_declaration(text: str) -> tuple[str, str]:
    """("long long", "a=*") of "long long a=*"; ("", "a") of a parameter without a type."""
    found = re.fullmatch(r"(?:(.+?[\s*\]]))?\s*(\w+)\s*(=.*)?", text.strip())
    if not found:
        raise UserError(f"cannot read the declaration {text!r}")
    return (found[1] or "").strip(), found[2]


def read_function(text: str) -> tuple[str, DeclaredFunction] | None:
    """The function that a line of a .pxd declares; None for a line that declares something else."""
    found = re.match(r"(cpdef|cdef)\s+(?:inline\s+)?(.*?)\b(\w+)\s*\((.*?)\)\s*(?:$|:|noexcept|except|nogil)", text)
    if not found:
        return None
    parameters = {}
    for part in found[4].split(","):
        if part.strip():
            c_type, name = split_declaration(part)
            if c_type:
                parameters[name] = type_of_c(c_type)
    return found[3], DeclaredFunction(type_of_c(found[2] or "object"), parameters, found[1] == "cpdef")


def logical_lines(text: str) -> Iterator[str]:
    """The lines of a .pxd without comments and texts in quotes; what stands in parentheses is on one line."""
    text = re.sub(r'"""(?:.|\n)*?"""', "", text)
    text = re.sub(r"#.*", "", text)
    text = re.sub(r"\(([^()]*)\)", lambda inside: "(" + " ".join(inside[1].split()) + ")", text)
    return (line.rstrip() for line in text.splitlines() if line.strip())


def read_declaration(text: str) -> Declaration:
    """What the text of a .pxd declares, in the style of this project."""
    known = Declaration()
    block, final = "", False  # block: "", "enum", "other" or the name of a class
    for line in logical_lines(text):
        bare = line.strip()
        if bare.startswith("@"):
            final = final or bare == "@cython.final"
            continue
        if not line.startswith(" "):
            block = ""
            if found := re.match(r"cdef class (\w+)", line):
                block = found[1]
                known.classes[block] = DeclaredClass(final=final)
            elif bare == "cpdef enum:":
                block = "enum"
            elif found := re.match(r"from (\S+) cimport \(?([^)]*)\)?", bare):
                known.imports.update({name.strip(): found[1] for name in found[2].split(",") if name.strip()})
            elif bare.startswith(("cdef extern", "cimport")):
                block = "other"
            elif function := read_function(bare):
                known.functions[function[0]] = function[1]
                block = "other"
            elif bare.startswith("cdef "):
                known.hidden.update(re.findall(r"(\w+)\s*(?:\[[^\]]*\])?\s*(?:,|$)", bare))
        elif block == "enum":
            known.constants.append(bare.split()[0])
        elif block not in ("", "other"):
            inside = known.classes[block]
            if function := read_function(bare):
                inside.methods[function[0]] = function[1]
            elif found := re.match(r"cdef (public|readonly) (.+)", bare):
                first, *more = found[2].split(",")
                c_type, name = split_declaration(first)
                for each in (name, *(other.strip() for other in more)):
                    inside.fields[each] = (type_of_c(c_type), found[1] == "readonly")
        final = False
    return known


# --- a module's stub --------------------------------------------------------------------------------------


def is_cython(node: ast.expr, name: str = "") -> bool:
    """True for `cython.<name>`, or for any attribute of cython."""
    return (
        isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "cython"
        and (not name or node.attr == name)
    )


def flat(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements of a module that run interpreted, those inside of `if` and `try` too."""
    for node in body:
        match node:
            case ast.If(test=test) if is_cython(test, "compiled"):
                yield from flat(node.orelse)
            case ast.If(test=ast.UnaryOp(op=ast.Not(), operand=test)) if is_cython(test, "compiled"):
                yield from flat(node.body)
            case ast.If():
                yield from flat([*node.body, *node.orelse])
            case ast.Try():
                yield from flat(node.body)
            case _:
                yield node


def interpreted_only(tree: ast.Module) -> set[str]:
    """Names that a module sets only where it runs interpreted, and not by `globals()[name]` where it runs compiled."""
    where: dict[bool, set[str]] = {True: set(), False: set()}
    for node in tree.body:
        match node:
            case ast.If(test=ast.UnaryOp(op=ast.Not(), operand=test)) if is_cython(test, "compiled"):
                inside = True
            case _:
                inside = False
        for each in flat([node]):
            if isinstance(each, ast.Assign):
                where[inside].update(part.id for part in ast.walk(each) if is_stored(part))
        for each in node.orelse if inside and isinstance(node, ast.If) else ():
            match each:
                case ast.Assign(targets=[ast.Subscript(value=ast.Call(func=ast.Name(id="globals")), slice=name)]):
                    where[False].add(ast.literal_eval(name))
    return where[True] - where[False]


def is_stored(node: ast.AST) -> TypeGuard[ast.Name]:
    """True for a name that is set."""
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)


def own_nodes(function: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a function, without those of functions inside it."""
    for node in ast.iter_child_nodes(function):
        if not isinstance(node, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            yield node
            yield from own_nodes(node)


def joined(types: list[str]) -> str:
    """One type for values of these; "" when there is none but Any."""
    kinds = set(types)
    if len(kinds) == 1:
        return types[0]
    if kinds == {"int", "float"}:
        return "float"
    if kinds == {"bool", "int"}:
        return "int"
    return ""


def or_none(kind: str) -> str:
    """The type, or None."""
    return kind if kind in ("Any", "None") or "None" in kind.split(" | ") else f"{kind} | None"


@dataclass
class Class:
    """A class as its stub has it: bases, fields, methods with their types."""

    node: ast.ClassDef
    declared: DeclaredClass | None
    attributes: dict[str, str] = field(default_factory=dict)  # fields and properties
    returns: dict[str, str] = field(default_factory=dict)  # of methods


class Module:
    """A compiled module: its source and its declaration; `text` is its stub."""

    def __init__(self, house: Path, name: str, others: dict[str, "Module"]) -> None:
        self.name = name
        self.others = others  # those read so far, by name
        others[name] = self
        self.house = house
        path = house.joinpath(*name.split(".")[1:])
        self.place = path.relative_to(house).as_posix()
        self.declaration = read_declaration(path.with_suffix(".pxd").read_text(encoding="utf-8"))
        tree = ast.parse(path.with_suffix(".py").read_text(encoding="utf-8"))
        self.top_level = tree.body
        self.body = list(flat(tree.body))
        self.declaration.hidden |= interpreted_only(tree) - {*self.declaration.constants}
        self.imports: dict[str, str] = {}  # name: the line that imports it
        self.origins: dict[str, str] = {}  # name: the module it comes from
        self.used: set[str] = set()  # of names to import
        self.constants: dict[str, str] = {}
        self.functions: dict[str, str] = {}  # what they return
        self.classes: dict[str, Class] = {}
        self.read_imports()
        self.read_names()

    # -- reading

    def read_imports(self) -> None:
        """What names of other modules mean here."""
        for name, origin in self.declaration.imports.items():
            self.imports[name], self.origins[name] = f"from {origin} import {name}", origin
        for node in self.body:
            if isinstance(node, ast.Import):
                for each in node.names:
                    shown = each.asname or each.name.partition(".")[0]
                    self.imports[shown] = f"import {each.name}" + (f" as {each.asname}" if each.asname else "")
            elif isinstance(node, ast.ImportFrom):
                for each in node.names:
                    shown = each.asname or each.name
                    alias = f" as {each.asname}" if each.asname else ""
                    self.imports[shown] = f"from {node.module} import {each.name}{alias}"
                    if each.asname == each.name and node in self.top_level:  # a name that is given on
                        self.used.add(shown)
                    self.origins[shown] = node.module or ""

    def read_names(self) -> None:
        """Types of constants, fields and functions, before the text is written."""
        for node in self.body:
            if isinstance(node, ast.ClassDef):
                self.classes[node.name] = Class(node, self.declaration.classes.get(node.name))
        for node in self.body:
            if isinstance(node, ast.FunctionDef):
                self.functions[node.name] = self.stated_return(node, self.declaration.functions.get(node.name))
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                self.read_constant(node)
        for each in self.classes.values():
            self.read_class(each)
        for name, returns in self.functions.items():
            if not returns:
                [node] = [n for n in self.body if isinstance(n, ast.FunctionDef) and n.name == name][:1]
                self.functions[name] = self.found_return(node, None)

    def read_constant(self, node: ast.Assign | ast.AnnAssign) -> None:
        """Names that a statement of the module sets."""
        if isinstance(node, ast.AnnAssign):
            if isinstance(node.target, ast.Name):
                self.constants[node.target.id] = self.annotation(node.annotation)
            return
        for target in node.targets:
            if isinstance(target, ast.Name):
                self.constants.setdefault(target.id, self.kind(node.value, None, {}) or "Any")
            elif isinstance(target, ast.Tuple):
                values = node.value.elts if isinstance(node.value, ast.Tuple) else [None] * len(target.elts)
                for name, value in zip(target.elts, values, strict=False):
                    if isinstance(name, ast.Name):
                        self.constants.setdefault(name.id, (value and self.kind(value, None, {})) or "Any")

    def read_class(self, each: Class) -> None:
        """Types of the fields, properties and methods of a class."""
        declared = each.declared
        if declared:
            each.attributes.update({name: kind for name, (kind, _) in declared.fields.items()})
            for name in fields_held_against_none(each.node) & declared.fields.keys():
                each.attributes[name] = or_none(each.attributes[name])
        methods = [node for node in each.node.body if isinstance(node, ast.FunctionDef)]
        for node in methods:
            stated = self.stated_return(node, declared.methods.get(node.name) if declared else None)
            if is_property(node):
                each.attributes[node.name] = stated
            elif not is_setter(node):
                each.returns[node.name] = stated
        for statement in each.node.body:
            match statement:
                case ast.AnnAssign(target=ast.Name(id=name)):
                    each.attributes[name] = self.annotation(statement.annotation)
                case ast.Assign(targets=[ast.Name(id=name)]):
                    each.attributes.setdefault(name, self.kind(statement.value, each, {}) or "Any")
        if not declared:
            for node in methods:
                self.read_assigned(each, node)
        for _ in range(2):  # a property may stand on one that is written below it
            for node in methods:
                if is_property(node) and not each.attributes[node.name]:
                    each.attributes[node.name] = self.found_return(node, each)
                elif node.name in each.returns and not each.returns[node.name]:
                    each.returns[node.name] = self.found_return(node, each)

    def read_assigned(self, each: Class, method: ast.FunctionDef) -> None:
        """Fields of a plain class, which are those that its methods set."""
        known = {
            argument.arg: self.annotation(argument.annotation)
            for argument in [*method.args.args, *method.args.kwonlyargs]
            if argument.annotation
        }
        for node in own_nodes(method):
            match node:
                case ast.AnnAssign(target=ast.Attribute(value=ast.Name(id="self"), attr=name)):
                    each.attributes[name] = self.annotation(node.annotation)
                case ast.Assign():
                    for target in node.targets:
                        match target:
                            case ast.Attribute(value=ast.Name(id="self"), attr=name):
                                found = self.kind(node.value, each, known)
                                each.attributes.setdefault(name, "Any" if found in ("", "None") else found)

    # -- types

    def annotation(self, node: ast.expr) -> str:
        """A type as the source writes it, in names of Python."""
        match node:
            case ast.Constant(value=str(text)):
                return self.annotation(ast.parse(text, mode="eval").body)
            case ast.Attribute(attr=name) if is_cython(node):
                return OF_CYTHON.get(name, "Any")
            case ast.Subscript(value=value) if is_cython(value):
                return f"MutableSequence[{self.annotation(value)}]"
            case ast.Name(id=name):
                return BARE.get(name, name)
            case ast.Subscript(value=ast.Name(id=name), slice=inside):
                return f"{name}[{self.inside(inside)}]"
            case ast.Subscript(value=value, slice=inside):
                return f"{ast.unparse(value)}[{self.inside(inside)}]"
            case ast.BinOp(left=left, op=ast.BitOr(), right=right):
                sides = self.annotation(left), self.annotation(right)
                return "Any" if "Any" in sides else " | ".join(sides)
        return ast.unparse(node)

    def inside(self, node: ast.expr) -> str:
        """The types in the brackets of another."""
        match node:
            case ast.Tuple(elts=parts):
                return ", ".join(self.inside(part) for part in parts)
            case ast.List(elts=parts):
                return "[" + ", ".join(self.inside(part) for part in parts) + "]"
        return self.annotation(node)

    def stated_return(self, node: ast.FunctionDef, declared: DeclaredFunction | None) -> str:
        """What a function returns as far as it is written somewhere; else ""."""
        if node.returns:
            return self.annotation(node.returns)
        if not any(isinstance(each, ast.Return | ast.Yield | ast.YieldFrom) for each in own_nodes(node)):
            return "None"
        return declared.returns if declared and declared.returns != "Any" else ""

    def found_return(self, node: ast.FunctionDef, owner: Class | None) -> str:
        """What a function returns, where its `return` statements tell."""
        values = []
        for each in own_nodes(node):
            if isinstance(each, ast.Yield | ast.YieldFrom):
                return "Any"
            if isinstance(each, ast.Return):
                values.append((self.kind(each.value, owner, {}) if each.value else "None") or "Any")
        return joined(values) or "Any"

    def attribute(self, owner: Class | None, name: str, methods: bool = False) -> str:
        """The type of a field (or what a method returns) of a class or of its bases; "" when unknown."""
        if owner is None:
            return ""
        found = (owner.returns if methods else owner.attributes).get(name)
        if found:
            return "" if found == "Any" else found
        for base in owner.node.bases:
            home, above = self.class_named(ast.unparse(base))
            if home and (kind := home.attribute(above, name, methods)):
                return kind
        return ""

    def class_named(self, name: str) -> tuple["Module | None", Class | None]:
        """A class that has this name here, and the module in which it is; (None, None) for one that is not compiled."""
        if name in self.classes:
            return self, self.classes[name]
        origin = self.origins.get(name, "")
        if origin.startswith("ranger_sim.") and (
            self.house.joinpath(*origin.split(".")[1:]).with_suffix(".pxd").exists()
        ):
            home = self.others.get(origin) or Module(self.house, origin, self.others)
            return home, home.classes.get(name)
        return None, None

    def kind(self, node: ast.expr, owner: Class | None, known: dict[str, str]) -> str:
        """The type of a simple expression; "" when it is not simple. `known`: types of local names."""

        def of(part: ast.expr) -> str:
            return self.kind(part, owner, known)

        def of_all(parts: list[ast.expr]) -> str:
            return joined([of(part) or "Any" for part in parts]) or "Any"

        match node:
            case ast.Constant(value=value):
                return "None" if value is None else type(value).__name__
            case ast.JoinedStr():
                return "str"
            case ast.Name(id=name):
                return known.get(name) or self.constants.get(name, "").replace("Any", "")
            case ast.Attribute(value=ast.Name(id="math")):
                return "float"
            case ast.Attribute(value=ast.Name(id="self"), attr=name):
                return self.attribute(owner, name)
            case ast.Tuple(elts=parts):
                return f"tuple[{of_all(parts)}, ...]" if parts else "tuple[()]"
            case ast.List(elts=parts):
                return f"list[{of_all(parts)}]" if parts else "list[Any]"
            case ast.Dict(keys=keys, values=values):
                return f"dict[{of_all([key for key in keys if key])}, {of_all(values)}]" if keys else "dict[Any, Any]"
            case ast.Compare(ops=[ast.Is() | ast.IsNot() | ast.In() | ast.NotIn(), *_]) | ast.UnaryOp(op=ast.Not()):
                return "bool"
            case ast.Compare(left=left, comparators=[*others]):
                simple = all(of(part) in ("int", "float", "str", "bool") for part in (left, *others))
                return "bool" if simple else ""
            case ast.UnaryOp(operand=operand):
                found = of(operand)
                return "int" if found == "bool" else found if found in ("int", "float") else ""
            case ast.BoolOp(values=values):
                return joined([of(value) for value in values])
            case ast.IfExp(body=one, orelse=other):
                return joined([of(one), of(other)])
            case ast.BinOp(left=left, op=operator, right=right):
                sides = {of(left), of(right)}
                if sides <= {"int", "bool"}:
                    return "float" if isinstance(operator, ast.Div) else "" if isinstance(operator, ast.Pow) else "int"
                return "float" if sides <= {"int", "float", "bool"} else ""
            case ast.Call(func=ast.Name(id="max" | "min"), args=[_, _, *_], keywords=[]):
                return joined([of(part) for part in node.args])
            case ast.Call(func=ast.Name(id=name)):
                if name in self.classes:
                    return name
                return self.functions.get(name, "").replace("Any", "") or KNOWN_CALLS.get(name, "")
            case ast.Call(func=ast.Attribute(value=ast.Name(id="self"), attr=name)):
                return self.attribute(owner, name, methods=True)
        return ""

    # -- writing

    def say(self, kind: str) -> str:
        """The type, whose names the stub will import."""
        kind = kind or "Any"
        self.used.update(re.findall(r"(?<![\w.])[A-Za-z_]\w*", kind))
        return kind

    def text(self) -> str:
        """The stub."""
        parts = [*self.constants_text(), ""]
        for node in self.body:
            if isinstance(node, ast.FunctionDef) and not self.is_hidden(node.name):
                parts += self.function_text(node, "", None, self.declaration.functions.get(node.name))
            elif isinstance(node, ast.ClassDef):
                parts += ["", *self.class_text(self.classes[node.name]), ""]
        head = [f"# Generated from {self.place}.py and {self.place}.pxd ({REGENERATE}); do not edit.", ""]
        lines = [f"from {HELPERS[name]} import {name}" for name in HELPERS if name in self.used]
        lines += [self.imports[name] for name in self.used if name in self.imports and name not in HELPERS]
        text = "\n".join([*head, *sorted(set(lines)), "", *parts])
        return re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n"

    def is_hidden(self, name: str) -> bool:
        """True for a name that is of C only."""
        function = self.declaration.functions.get(name)
        return name in self.declaration.hidden or (function is not None and not function.visible)

    def constants_text(self) -> Iterator[str]:
        """Names of numbers, tables and other classes' names."""
        for name in self.declaration.constants:
            yield f"{name}: int"
        for name, kind in self.constants.items():
            if name not in self.declaration.constants and not self.is_hidden(name):
                yield f"{name}: {self.say(kind)}"

    def class_text(self, each: Class) -> Iterator[str]:
        """A class: its head, fields, and methods."""
        declared, node = each.declared, each.node
        if declared and declared.final:
            yield f"@{self.say('final')}"
        for decorator in node.decorator_list:
            if not is_cython(decorator):
                yield f"@{self.say(ast.unparse(decorator))}"
        bases = [ast.unparse(base) for base in node.bases]
        given = ", ".join(self.say(base) for base in bases)
        yield f"class {node.name}({given}):" if given else f"class {node.name}:"
        properties = {part.name for part in node.body if isinstance(part, ast.FunctionDef) and is_property(part)}
        valued = {  # what a dataclass may leave out, and members of an enum
            part.target.id
            for part in node.body
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name) and part.value
        }
        count = 0
        for name, kind in each.attributes.items():
            if name in properties:
                continue
            count += 1
            if declared and declared.fields.get(name, ("", False))[1]:
                yield "    @property"
                yield f"    def {name}(self) -> {self.say(kind)}: ..."
            else:
                yield f"    {name}: {self.say(kind)}" + (" = ..." if name in valued else "")
        for part in node.body:
            if isinstance(part, ast.FunctionDef):
                method = declared.methods.get(part.name) if declared else None
                known = self.declared_method(node, part.name)
                if known is None or known.visible:
                    count += 1
                    yield from self.function_text(part, "    ", each, method)
        if not count:
            yield "    pass"

    def declared_method(self, node: ast.ClassDef, name: str) -> DeclaredFunction | None:
        """How a method is declared: here, or where a base says it first and this class only overrides it."""
        declared = self.declaration.classes.get(node.name)
        if declared and name in declared.methods:
            return declared.methods[name]
        for base in node.bases:
            home, above = self.class_named(ast.unparse(base))
            if home and above and (found := home.declared_method(above.node, name)):
                return found
        return None

    def function_text(
        self, node: ast.FunctionDef, indent: str, owner: Class | None, declared: DeclaredFunction | None
    ) -> Iterator[str]:
        """A function or a method."""
        for decorator in node.decorator_list:
            if not is_cython(decorator) and not (isinstance(decorator, ast.Call) and is_cython(decorator.func)):
                yield f"{indent}@{self.say(ast.unparse(decorator))}"
        returns = (owner.returns.get(node.name) if owner else self.functions.get(node.name)) or ""
        if owner and is_property(node):
            returns = owner.attributes[node.name]
        if is_setter(node):
            returns = "None"
        yield f"{indent}def {node.name}({self.parameters_text(node, owner, declared)}) -> {self.say(returns)}: ..."

    def parameters_text(self, node: ast.FunctionDef, owner: Class | None, declared: DeclaredFunction | None) -> str:
        """What stands between the parentheses."""
        given = node.args
        static = any(isinstance(each, ast.Name) and each.id == "staticmethod" for each in node.decorator_list)
        kept = self.kept_in_fields(node, owner)
        places = [*given.posonlyargs, *given.args]
        defaults: list[ast.expr | None] = [None] * (len(places) - len(given.defaults))
        shown = []
        for number, (argument, default) in enumerate(zip(places, [*defaults, *given.defaults], strict=True)):
            if number == 0 and owner and not static:
                shown.append(argument.arg)
                continue
            shown.append(self.parameter_text(node, argument, default, owner, declared, kept))
            if given.posonlyargs and number == len(given.posonlyargs) - 1:
                shown.append("/")
        if given.vararg:
            shown.append(f"*{given.vararg.arg}: {self.stated(given.vararg)}")
        elif given.kwonlyargs:
            shown.append("*")
        for argument, default in zip(given.kwonlyargs, given.kw_defaults, strict=True):
            shown.append(self.parameter_text(node, argument, default, owner, declared, kept))
        if given.kwarg:
            shown.append(f"**{given.kwarg.arg}: {self.stated(given.kwarg)}")
        return ", ".join(shown)

    def stated(self, argument: ast.arg) -> str:
        """The annotation of a parameter, or Any."""
        return self.say(self.annotation(argument.annotation) if argument.annotation else "Any")

    def parameter_text(
        self,
        node: ast.FunctionDef,
        argument: ast.arg,
        default: ast.expr | None,
        owner: Class | None,
        declared: DeclaredFunction | None,
        kept: dict[str, str],
    ) -> str:
        """One parameter with its type."""
        name = argument.arg
        if argument.annotation:
            kind = self.annotation(argument.annotation)
        elif declared and name in declared.parameters:
            kind = declared.parameters[name]
        elif owner and is_setter(node):
            kind = owner.attributes.get(node.name, "")
        else:
            kind = kept.get(name, "")
        kind = kind or "Any"
        if view := re.fullmatch(r"MutableSequence\[(\w+)\]", kind):
            kind = f"{kind} | memoryview[{view[1]}]"
        if default is None:
            return f"{name}: {self.say(kind)}"
        if isinstance(default, ast.Constant) and default.value is None:
            kind = or_none(kind)
        elif isinstance(default, ast.Constant) and self.kind(default, None, {}) == "float" and kind == "int":
            kind = "float"
        value = ast.unparse(default) if isinstance(default, ast.Constant) else "..."
        return f"{name}: {self.say(kind)} = {value}"

    def kept_in_fields(self, node: ast.FunctionDef, owner: Class | None) -> dict[str, str]:
        """{parameter: type of the declared field} of those that a constructor puts into a field as they come."""
        if owner is None or not owner.declared or node.name != "__init__":
            return {}
        changed = {each.id for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)}
        kept: dict[str, str] = {}
        for statement in node.body:
            match statement:
                case ast.Assign(
                    targets=[ast.Attribute(value=ast.Name(id="self"), attr=attribute)], value=ast.Name(id=name)
                ) if name not in changed:
                    if kind := self.attribute(owner, attribute):
                        kept.setdefault(name, kind)
        return kept


def fields_held_against_none(node: ast.ClassDef) -> set[str]:
    """Names of fields of which the methods of a class ask whether they are None."""
    return {
        each.left.attr
        for each in ast.walk(node)
        if isinstance(each, ast.Compare)
        and isinstance(each.left, ast.Attribute)
        and ast.unparse(each.left.value) == "self"
        and ast.unparse(each.comparators[0]) == "None"
    }


def is_property(node: ast.FunctionDef) -> bool:
    """True for the getter of a property."""
    return any(isinstance(each, ast.Name) and each.id == "property" for each in node.decorator_list)


def is_setter(node: ast.FunctionDef) -> bool:
    """True for the setter of a property."""
    return any(isinstance(each, ast.Attribute) and each.attr == "setter" for each in node.decorator_list)


# --- the folder -------------------------------------------------------------------------------------------


def stubs(house: Path = HOUSE) -> dict[str, str]:
    """{path below the folder of stubs: text} of every compiled module."""
    modules: dict[str, Module] = {}
    return {
        name.partition(".")[2].replace(".", "/") + ".pyi": (modules.get(name) or Module(house, name, modules)).text()
        for name in declared_modules()
    }


def kept(folder: Path) -> dict[str, str]:
    """{path below the folder: text} of the stubs that are there."""
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in folder.rglob("*.pyi")}


def main(arguments: list[str] | None = None) -> int:
    """Write the stubs, or check them; 1 when some are stale."""
    parser = argparse.ArgumentParser(prog=REGENERATE, description="Type stubs of the compiled modules.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 when stubs are stale")
    options = parser.parse_args(arguments)
    if not STUBS.is_dir():
        print(f"{REGENERATE}: stubs are made in a checkout, and {HOUSE} is none", file=sys.stderr)
        return 2
    fresh, old = stubs(), kept(STUBS)
    stale = sorted(name for name in {*fresh, *old} if fresh.get(name) != old.get(name))
    for name in stale:
        print(f"{'stale' if options.check else 'written' if name in fresh else 'removed'}: stubs/{name}")
        if not options.check:
            path = STUBS / name
            if name in fresh:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(fresh[name], encoding="utf-8")
            else:
                path.unlink()
    if options.check and stale:
        print(f"run `{REGENERATE}` and check the files in", file=sys.stderr)
    return 1 if options.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
