"""The plan of the packages: which may import which, and what compiled modules declare."""

import ast
import contextlib
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
    "harness": {"foundation", "datatable", "can_bus", "plant", "firmware_sim", "boards"},
    "sysid": {"foundation", "datatable", "can_bus", "plant"},
    "tools": {"foundation", "datatable", "can_bus", "plant", "firmware_sim", "boards", "harness", "sysid"},
}
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
    "pytest": ("harness/testing/",),
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


def imported_modules(path):
    """(dotted name, line) of what a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            if node.module == "ranger_sim":
                for alias in node.names:
                    yield f"ranger_sim.{alias.name}", node.lineno
            else:
                yield node.module, node.lineno


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_a_package_imports_only_what_the_table_allows(package):
    faults = []
    for path in (ROOT / package).rglob("*.py"):
        for name, line in imported_packages(path):
            if (name in MAY_IMPORT or name == "tests") and name != package and name not in MAY_IMPORT[package]:
                faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("inside", INSIDE)
def test_arrows_between_rooms_of_a_room_run_one_way(inside):
    room, _, own = inside.partition("/")
    others = {name.partition("/")[2] for name in INSIDE if name.startswith(f"{room}/")} - {own}
    faults = []
    for path in (ROOT / inside).rglob("*.py"):
        for name, line in imported_modules(path):
            if name.startswith(f"ranger_sim.{room}.") and name.split(".")[2] in others - INSIDE[inside]:
                faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("library", ONLY_IN)
def test_a_library_with_one_place_stays_there(library):
    faults = []
    for path in sources():
        relative = path.relative_to(ROOT).as_posix()
        for name, line in imported_packages(path):
            if name == library and not relative.startswith(ONLY_IN[library]):
                faults.append(f"{relative}:{line} imports {library}")
    assert not faults, "\n".join(faults)


def test_nobody_draws_from_a_global_random_generator():
    pattern = re.compile(r"\b(?:np|numpy)\.random\b|\bdefault_rng\b")
    faults = [str(p.relative_to(ROOT)) for p in sources() if pattern.search(p.read_text(encoding="utf-8"))]
    assert faults == ["foundation/random_arrays.py"]  # makes generators of their own, from seed and name


def test_the_table_has_every_package():
    assert set(loading.packages()) == set(MAY_IMPORT)


def test_packages_are_imported_through_ranger_sim_alone():
    """`import boards` would find a folder of the checkout, and a second copy of each of its modules."""
    faults = []
    for folder in (*MAY_IMPORT, "tests", "docs", "examples", "benchmarks"):
        for path in (ROOT / folder).rglob("*.py"):
            for name, line in imported_modules(path):
                if name.partition(".")[0] in MAY_IMPORT:
                    faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


SOURCES = declarations.Sources(ROOT)
COMPILED = SOURCES.compiled_modules()


class Names(dict):
    """A namespace in which a name without a known value stands for itself."""

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


def test_what_is_long_or_wide_says_why():
    """A function above 150 lines, a class above 40 fields: its docstring tells why it is better so."""
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


# What of the harness is any machine's: loaded in a fresh process, it brings nothing that only Ranger has.
OF_ANY_MACHINE = (
    "faults.buses", "faults.catalogue", "faults.edges", "faults.error_rows", "faults.evidence", "faults.frames",
    "faults.network_places", "faults.proof", "faults.twin", "faults.voltages", "firmware.native_firmware",
    "firmware.table_board", "lockstep", "machine", "names", "normal_errors", "outside.machine", "records.logbook",
    "records.vital_signs", "testing.frames", "testing.health", "testing.making", "testing.plugin", "testing.wire",
    "timing.machine_slots", "timing.slots", "waiting", "wiring.wires",
)  # fmt: skip
ONLY_RANGERS = (
    "ranger_sim.boards",
    "ranger_sim.datatable.generated",
    "ranger_sim.harness.conditions",
    "ranger_sim.harness.faults.places",
    "ranger_sim.harness.faults.ranger_",
    "ranger_sim.harness.ranger",
    "ranger_sim.harness.scenario",
    "ranger_sim.harness.wiring.ranger",
    "ranger_sim.plant.electrics",
    "ranger_sim.plant.mechanics",
    "ranger_sim.plant.ranger",
    "ranger_sim.plant.walking",
)


def test_what_is_any_machines_brings_nothing_of_ranger():
    program = (
        "import importlib, sys\n"
        f"for name in {OF_ANY_MACHINE!r}:\n"
        "    importlib.import_module('ranger_sim.harness.' + name)\n"
        f"    found = [each for each in sys.modules if each.startswith({ONLY_RANGERS!r})]\n"
        "    assert not found, (name, found)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr.splitlines()[-1]
