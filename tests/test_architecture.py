"""The house keeps its plan: which room may import which, and what the compiled declarations promise."""

import ast
import contextlib
import json
import os
import pathlib
import re
import subprocess
import sys

import pytest

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
    "sysid": {"foundation", "plant"},
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
    "pytest": ("harness/testing/", "tools/mutate/serve.py"),
    "_pytest": ("harness/testing/forking.py", "tools/mutate/serve.py"),
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
    """What a file imports, in .py by its syntax tree, in .pxd by its cimport lines: libraries, and rooms by name."""
    for names, line in imported_modules(path):
        package, _, rest = names.partition(".")
        yield (rest.partition(".")[0] or package) if package == "ranger_sim" else package, line


def imported_modules(path):
    """(dotted name, line) of what a file imports."""
    if path.suffix == ".pxd":
        text = path.read_text(encoding="utf-8")
        for match in re.finditer(r"^\s*(?:from\s+([\w.]+)\s+cimport|cimport\s+([\w.]+))", text, re.MULTILINE):
            name = match.group(1) or match.group(2)
            if not name.startswith("."):
                yield name, text[: match.start()].count("\n") + 1
        return
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
    for path in [*(ROOT / package).rglob("*.py"), *(ROOT / package).rglob("*.pxd")]:
        for name, line in imported_packages(path):
            if (name in MAY_IMPORT or name == "tests") and name != package and name not in MAY_IMPORT[package]:
                faults.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("inside", INSIDE)
def test_arrows_between_rooms_of_a_room_run_one_way(inside):
    room, _, own = inside.partition("/")
    others = {name.partition("/")[2] for name in INSIDE if name.startswith(f"{room}/")} - {own}
    faults = []
    for path in [*(ROOT / inside).rglob("*.py"), *(ROOT / inside).rglob("*.pxd")]:
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


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_a_room_imported_by_its_bare_name_is_refused_with_the_right_one(room):
    program = f"import {room}"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == f"ImportError: {room} is a room of ranger_sim: import ranger_sim.{room}"


def test_the_finder_knows_every_room():
    assert set(loading.ROOMS) == set(MAY_IMPORT)


def declarations():
    return sorted(path.relative_to(ROOT) for package in MAY_IMPORT for path in (ROOT / package).rglob("*.pxd"))


def declared_classes(text):
    """{class: (base, fields, methods)} of a .pxd in the style of this project."""
    classes = {}
    current = None
    text = re.sub(r"#.*", "", text)
    text = re.sub(r"\(([^()]*)\)", lambda m: "(" + m.group(1).replace("\n", " ") + ")", text)
    for line in text.splitlines():
        head = re.match(r"cdef\s+class\s+(\w+)(?:\((\w+)\))?\s*:", line)
        if head:
            current = classes.setdefault(head.group(1), (head.group(2), set(), set()))
            continue
        if not line.startswith((" ", "\t")):
            if line.strip():
                current = None
            continue
        if current is None:
            continue
        line = line.strip()
        method = re.match(r"(?:cpdef|cdef)\s+(?:inline\s+)?.*?\b(\w+)\s*\(", line)
        if method:
            current[2].add(method.group(1))
            continue
        field = re.match(r"cdef\s+(?:public\s+|readonly\s+)?(.*)$", line)
        if field:
            without_type = re.sub(r"^(?:unsigned\s+)?(?:long\s+long|[\w.]+)(?:\*|\[[^\]]*\])?\s+", "", field.group(1))
            current[1].update(name.strip() for name in without_type.split(",") if name.strip())
    return classes


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


@pytest.mark.parametrize("declaration", declarations(), ids=str)
def test_a_compiled_declaration_agrees_with_its_source(declaration):
    """Fields and methods of the .pxd and of the .py are the same: what one mode has, the other has."""
    source = (ROOT / declaration).with_suffix(".py")
    assert source.exists(), f"{declaration} has no source"
    tree = ast.parse(source.read_text(encoding="utf-8"))
    in_source = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    declared = declared_classes((ROOT / declaration).read_text(encoding="utf-8"))
    faults = []

    def all_fields(name):
        if name not in declared:
            return None  # a base from another file: its fields are checked there
        base, fields, _ = declared[name]
        above = all_fields(base) if base else set()
        return None if above is None else fields | above

    for name, (_, fields, methods) in declared.items():
        if name not in in_source:
            faults.append(f"{declaration}: class {name} is not in {source.name}")
            continue
        defined = {n.name for n in ast.walk(in_source[name]) if isinstance(n, ast.FunctionDef)}
        assigned = {
            target.attr
            for node in ast.walk(in_source[name])
            for target in ast.walk(node)
            if isinstance(target, ast.Attribute)
            and isinstance(target.ctx, ast.Store)
            and isinstance(target.value, ast.Name)
            and target.value.id == "self"
        } | set_by_name(tree, in_source[name])
        faults += [f"{declaration}: {name}.{m}() is not in {source.name}" for m in sorted(methods - defined)]
        known = all_fields(name)
        if known is not None:
            faults += [f"{source.name}: {name}.{f} is not declared" for f in sorted(assigned - known)]
        faults += [f"{declaration}: {name}.{f} is never set" for f in sorted(fields - assigned)]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("declaration", declarations(), ids=str)
def test_numbers_in_compiled_fields_have_64_bits(declaration):
    """Narrower ones wrap and round, and only when compiled. Bytes seen through a view are bytes in both modes."""
    text = re.sub(r"#.*", "", (ROOT / declaration).read_text(encoding="utf-8"))
    fields = re.findall(r"^ +cdef (?:public |readonly )?([^(\n]+)$", text, re.MULTILINE)
    narrow = r"(?:(?:un)?signed )?(?:short|int|char|long(?! long)|float|Py_UCS4)\b"
    found = [field for field in fields if re.match(narrow, field) and not field.startswith("unsigned char[::1] ")]
    assert not found, f"{declaration}: {found}"


def declared_constants(text):
    """{name: number} of the enums of a .pxd that Python sees."""
    numbers, inside = {}, False
    for line in re.sub(r"#.*", "", text).splitlines():
        if line.strip() and not line.startswith(" "):
            inside = line.strip() == "cpdef enum:"
        elif inside and line.strip():
            name, _, value = line.partition("=")
            numbers[name.strip()] = int(value, 0)
    return numbers


def test_constants_are_the_same_numbers_interpreted_and_compiled():
    """An enum of a .pxd is what the compiler uses; what stands under the same name in the source, the interpreter."""
    wanted = {}
    for declaration in declarations():
        numbers = declared_constants((ROOT / declaration).read_text(encoding="utf-8"))
        if numbers:
            wanted[".".join(("ranger_sim", *declaration.with_suffix("").parts))] = numbers
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
