"""Interpreted classes with the fields of the compiled ones: those that the .pxd beside the module declares.

An object then has a place for each declared field and no dictionary: a field is found faster (the robot runs an eighth
faster interpreted), and one that is not declared raises an AttributeError, as it does compiled.
"""

import builtins
import importlib.machinery
import pathlib
import re
from types import ModuleType
from typing import Any

CLASS = re.compile(r"cdef class (\w+)")
FIELDS = re.compile(r"\s+cdef (?:public |readonly )?(?:unsigned )?(?:long long|[\w.]+)(?:\[[^\]]*\]|\*)? ([\w ,]+)$")


def declared_fields(path: pathlib.Path) -> dict[str, tuple[str, ...]]:
    """Names of the fields of every class that the .pxd file at `path` declares; empty without the file."""
    classes: dict[str, tuple[str, ...]] = {}
    name = ""
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        if found := CLASS.match(line):
            name = found[1]
            classes[name] = ()
        elif found := FIELDS.match(line.partition("#")[0].rstrip()):
            classes[name] += tuple(field.strip() for field in found[1].split(","))
    return classes


class DeclaredFields:
    """Stands for the metaclass of one class while that is made: gives it its fields and then makes an ordinary one."""

    def __init__(self, fields: tuple[str, ...]) -> None:
        self.fields = fields

    def __prepare__(self, name: str, bases: tuple[type, ...]) -> dict[str, Any]:
        """The namespace in which the body of the class runs."""
        return {"__slots__": self.fields}

    def __call__(self, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> type:
        """The class."""
        return type(name, bases, namespace)


class DeclaredFieldsLoader(importlib.machinery.SourceFileLoader):
    """Runs a .py file; its classes that the .pxd beside it declares are made with the fields declared there."""

    def exec_module(self, module: ModuleType) -> None:
        """Run the file in the namespace of `module`, with a way of making classes that holds for this module alone."""
        fields = declared_fields(pathlib.Path(self.path).with_suffix(".pxd"))

        def make_class(body: Any, name: str, *bases: Any, **options: Any) -> Any:
            if name in fields and body.__qualname__ == name:
                options["metaclass"] = DeclaredFields(fields[name])
            return builtins.__build_class__(body, name, *bases, **options)

        if fields:
            module.__dict__["__builtins__"] = builtins.__dict__ | {"__build_class__": make_class}
        super().exec_module(module)
