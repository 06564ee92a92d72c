"""The plan of the packages: which may import which, and what compiled modules declare."""

import ast
import contextlib
import functools
import json
import os
import pathlib
import re
import subprocess
import sys

import pytest

from dev import declarations
from ranger_sim import loading

ROOT = pathlib.Path(__file__).resolve().parent.parent

# A package may import the packages listed for it, itself, and what is installed. The order is the house from the
# ground up. `foundation` is ours: numbers, events, seeded randomness and the wall clock, which every room needs.
MAY_IMPORT = {
    "foundation": set(),
    "datatable": {"foundation"},
    "can_bus": {"foundation"},
    "plant": {"foundation"},
    "firmware_sim": {"foundation", "can_bus"},
    "boards": {"foundation", "firmware_sim", "datatable"},
    "harness": {"foundation", "datatable", "can_bus", "plant", "firmware_sim"},
    "ranger": {"foundation", "datatable", "can_bus", "plant", "firmware_sim", "boards", "harness"},
    "sysid": {"foundation", "datatable", "can_bus", "plant"},
    "tools": {"foundation", "datatable", "can_bus", "plant", "firmware_sim", "boards", "harness", "ranger", "sysid"},
}
# Folders that import any package and that no package imports.
NOT_IN_THE_WHEEL = {"dev", "studies", "tests"}
# The same inside a room, for those of its rooms that stand above one another.
INSIDE = {
    "plant/sensors": set(),
    "plant/mechanics": set(),
    "plant/electrics": {"sensors", "mechanics"},
    "plant/walking": {"mechanics"},
}
# Libraries that belong to one place of the house.
ONLY_IN = {
    "can": ("can_bus/edge/",),
    "cffi": ("firmware_sim/native/",),
    "serial": ("harness/", "tools/"),
    "asammdf": ("tools/", "harness/", "sysid/readers/"),
    "plotly": ("tools/",),
    "pytest": ("harness/testing/", "ranger/testing/"),
    "_pytest": ("harness/testing/forking.py",),
    "rich": ("tools/", "datatable/cli.py"),
    "time": ("foundation/wallclock.py",),
    "tomllib": ("foundation/toml_file.py",),
    "random": (),
    "datetime": ("foundation/wallclock.py",),
}


def sources():
    for package in MAY_IMPORT:
        yield from sorted((ROOT / package).rglob("*.py"))


def imported_packages(path):
    """What a file imports: libraries, and packages of ours by name."""
    for names, line in imported_modules(path):
        package, _, rest = names.partition(".")
        yield (rest.partition(".")[0] or package) if package == "ranger_sim" else package, line


@functools.cache
def imported_modules(path):
    """(dotted name, line) of what a file imports; a file is read once, though many tests ask."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            if node.module == "ranger_sim":
                found += [(f"ranger_sim.{alias.name}", node.lineno) for alias in node.names]
            else:
                found.append((node.module, node.lineno))
    return tuple(found)


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_a_package_imports_only_what_the_table_allows(package):
    faults = []
    for path in (ROOT / package).rglob("*.py"):
        for name, line in imported_packages(path):
            if (name in MAY_IMPORT or name in NOT_IN_THE_WHEEL) and name != package and name not in MAY_IMPORT[package]:
                faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("inside", INSIDE)
def test_imports_between_folders_of_a_package_run_one_way(inside):
    room, _, own = inside.partition("/")
    others = {name.partition("/")[2] for name in INSIDE if name.startswith(f"{room}/")} - {own}
    faults = []
    for path in (ROOT / inside).rglob("*.py"):
        for name, line in imported_modules(path):
            if name.startswith(f"ranger_sim.{room}.") and name.split(".")[2] in others - INSIDE[inside]:
                faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


def imported_by_module():
    """{module: modules of ours that it imports, wherever in the file and also for type checkers alone}."""
    files = {}
    for path in [*sources(), *(ROOT / "ranger_sim").glob("*.py")]:
        relative = path.relative_to(ROOT).with_suffix("")
        parts = relative.parts if relative.parts[0] == "ranger_sim" else ("ranger_sim", *relative.parts)
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    found = {}
    for module, path in files.items():
        names = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inside = {f"{node.module}.{alias.name}" for alias in node.names}
                names |= {name if name in files else node.module for name in inside}
        found[module] = {name for name in names if name in files and name != module}
    return found


def circles(imports):
    """Groups of modules that import each other, directly or not."""
    reached = {}
    for module in imports:
        reached[module], waiting = set(), list(imports[module])
        while waiting:
            name = waiting.pop()
            if name not in reached[module]:
                reached[module].add(name)
                waiting += imports[name]
    groups = {frozenset(b for b in reached[a] if a in reached[b]) for a in imports if a in reached[a]}
    return sorted(map(sorted, groups))


def test_no_modules_import_each_other_in_a_circle():
    imports = imported_by_module()
    assert len(imports) > 500 and "ranger_sim.foundation.user_error" in imports["ranger_sim.tools.cli"]
    assert circles(imports) == []


def test_circles_of_two_and_three_modules_are_found():
    imports = {"a": {"b"}, "b": {"a", "c"}, "c": {"d"}, "d": {"e"}, "e": {"c"}, "f": {"a"}}
    assert circles(imports) == [["a", "b"], ["c", "d", "e"]]
    assert circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


@pytest.mark.parametrize("library", ONLY_IN)
def test_a_library_with_one_place_stays_there(library):
    faults = []
    for path in sources():
        relative = path.relative_to(ROOT).as_posix()
        for name, line in imported_packages(path):
            if name == library and not relative.startswith(ONLY_IN[library]):
                faults.append(f"{relative}:{line} imports {library}")
    assert not faults, "\n".join(faults)


def test_the_global_random_generator_is_not_used():
    pattern = re.compile(r"\b(?:np|numpy)\.random\b|\bdefault_rng\b")
    faults = [str(p.relative_to(ROOT)) for p in sources() if pattern.search(p.read_text(encoding="utf-8"))]
    assert faults == ["foundation/random_arrays.py"]  # makes generators of their own, from seed and name


def test_the_table_has_every_package():
    assert set(loading.packages()) == set(MAY_IMPORT)


def test_packages_are_imported_through_ranger_sim_alone():
    """`import boards` would find a folder of the checkout, and a second copy of each of its modules."""
    faults = []
    for folder in (*MAY_IMPORT, *NOT_IN_THE_WHEEL, "docs", "examples", "benchmarks"):
        for path in (ROOT / folder).rglob("*.py"):
            for name, line in imported_modules(path):
                if name.partition(".")[0] in MAY_IMPORT:
                    faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


SOURCES = declarations.Sources(ROOT)
COMPILED = SOURCES.compiled_modules()


class Names(dict):
    """A namespace in which a name without a known value represents itself."""

    def __missing__(self, name):
        return name


def set_by_name(tree, class_node):
    """Fields set in `for name in NAMES: setattr(self, name, ...)`: NAMES from the literals of the module."""
    literals = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            with contextlib.suppress(ValueError):
                literals[node.targets[0].id] = ast.literal_eval(node.value)

    def value(expression, **names):
        return eval(
            compile(ast.Expression(expression), "<names>", "eval"), {"__builtins__": {}}, Names(literals | names)
        )

    found, understood = set(), 0
    calls = [node for node in ast.walk(class_node) if isinstance(node, ast.Call) and calls_setattr(node)]
    for loop in ast.walk(class_node):
        if isinstance(loop, ast.For):
            target = loop.target.elts if isinstance(loop.target, ast.Tuple) else [loop.target]
            for call in (node for part in loop.body for node in ast.walk(part)):
                if isinstance(call, ast.Call) and calls_setattr(call):
                    understood += 1
                    for each in value(loop.iter):
                        bound = each if len(target) > 1 else [each]
                        names = {node.id: item for node, item in zip(target, bound, strict=True)}
                        found.add(value(call.args[1], **names))
    assert understood == len(calls), f"{class_node.name} sets fields by names that this test cannot follow"
    return found


def calls_setattr(call):
    """True for setattr(self, ...)."""
    return isinstance(call.func, ast.Name) and call.func.id == "setattr" and ast.unparse(call.args[0]) == "self"


@pytest.mark.parametrize("name", COMPILED)
def test_every_declared_field_is_set(name):
    source = SOURCES[name]
    faults = []
    for owner in source.classes.values():
        assigned = fields_set(owner) | set_by_name(source.tree, owner)
        faults += [f"{owner.name}.{f.name}" for f in source.fields(owner) if f.name not in assigned]
    assert not faults, f"{source.path}: never set: {', '.join(faults)}"


@pytest.mark.parametrize("name", COMPILED)
def test_numbers_in_compiled_fields_have_64_bits(name):
    """Narrower ones wrap and round, and only when compiled. Bytes seen through a view are bytes in both modes."""
    source = SOURCES[name]
    narrow = re.compile(r"cython\.(?:short|u?int|u?char|ushort|schar|float)\b(?!\[::1\])")
    fields = [ast.unparse(each.annotation) for owner in source.classes.values() for each in source.fields(owner)]
    assert [each for each in fields if narrow.match(each)] == []


def test_constants_are_the_same_numbers_interpreted_and_compiled():
    """Compiled modules have them as numbers of C; what Python sees of either kind of run is the value in the source."""
    wanted = {}
    for name in COMPILED:
        nodes = SOURCES[name].constants
        if nodes:
            numbers = {}
            for constant, node in nodes.items():
                numbers[constant] = eval(ast.unparse(node.value), {"__builtins__": {}}, numbers)
            wanted[name] = numbers
    assert wanted["ranger_sim.foundation.events"]["PIN_OUTPUT"] == 36
    program = (
        "import importlib, json, sys\n"
        "wanted = json.load(sys.stdin)\n"
        "print(json.dumps({m: {n: getattr(importlib.import_module(m), n) for n in wanted[m]} for m in wanted}))"
    )
    for interpreted in ("", "1"):
        done = subprocess.run(
            [sys.executable, "-c", program],
            input=json.dumps(wanted),
            cwd=ROOT,
            env=os.environ | {"RANGER_SIM_INTERPRETED": interpreted},
            capture_output=True,
            text=True,
            check=True,
        )
        assert json.loads(done.stdout) == wanted


def test_long_or_wide_parts_give_the_reason():
    """A function above 150 lines, a class above 40 fields: its docstring has the reason."""
    silent = []
    for path in sources():
        if "generated" in path.parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                size, limit = node.end_lineno - node.lineno + 1, 150
            elif isinstance(node, ast.ClassDef):
                size, limit = len(fields_set(node)), 40
            else:
                continue
            if size > limit and "because" not in (ast.get_docstring(node) or ""):
                silent.append(f"{path.relative_to(ROOT)}: {node.name}, {size}")
    assert not silent, "\n".join(silent)


def fields_set(node):
    """Names of the fields that the methods of a class set on `self`."""
    return {
        each.attr
        for each in ast.walk(node)
        if isinstance(each, ast.Attribute)
        and isinstance(each.ctx, ast.Store)
        and isinstance(each.value, ast.Name)
        and each.value.id == "self"
    }


# What only the robot has, in packages that the harness may import. All of boards/ and ranger/ it may not (MAY_IMPORT).
ONLY_THE_ROBOTS = tuple(
    f"ranger_sim.{name}"
    for name in (
        "boards",
        "datatable.generated",
        "plant.electrics",
        "plant.mechanics",
        "plant.ranger",
        "plant.walking",
        "ranger",
    )
)


def is_only_the_robots(name):
    """Whether a module, or a name in one, is of those that only the robot has."""
    return f"{name}.".startswith(tuple(f"{each}." for each in ONLY_THE_ROBOTS))


def imported_names(nodes):
    """Dotted names that imports among `nodes` of a syntax tree bring: modules, and names in them."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def at_import(node):
    """The nodes that run when a module is imported: not those in functions, nor those for type checkers."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield child
            yield from at_import(child)


def module_files():
    """{name: path} of every module of the packages."""
    found = {}
    for path in sources():
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(("ranger_sim", *(parts[:-1] if parts[-1] == "__init__" else parts)))] = path
    return found


def test_the_harness_names_nothing_that_only_the_robot_has():
    faults = []
    for path in (ROOT / "harness").rglob("*.py"):
        names = imported_names(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        faults += [f"{path.relative_to(ROOT)} imports {name}" for name in names if is_only_the_robots(name)]
    assert not faults, "\n".join(faults)


def test_the_harness_brings_nothing_that_only_the_robot_has():
    """Importing it, with all that its modules import in turn."""
    files = module_files()
    came_by = {name: "" for name in files if name.startswith("ranger_sim.harness")}
    assert len(came_by) > 100
    ahead = list(came_by)
    while ahead:
        importer = ahead.pop()
        for name in imported_names(at_import(ast.parse(files[importer].read_text(encoding="utf-8")))):
            module = name if name in files else name.rpartition(".")[0]
            if module in files and module not in came_by:
                came_by[module] = importer
                ahead.append(module)
    faults = [f"{importer} imports {name}" for name, importer in came_by.items() if is_only_the_robots(name)]
    assert not faults, "\n".join(faults)
