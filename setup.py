"""Builds every module that has a .pxd beside it; without a C compiler the plain sources are used.

All of them go into one shared library, ranger_sim._compiled: Python's constants, entry points and numbers are then in
one place instead of one per module, and what runs lies together, apart from what does not (LAYOUT below). The whole
robot runs some 4 % faster than with a library of each module.

All or nothing: a compiled module reads the fields of another's classes at fixed places, so compiled and interpreted
modules must not be mixed. When anything fails, this is told, the reason is written to ranger_sim/build_record.json,
and the whole robot runs interpreted (ranger_sim/loading.py reads the record).

What Cython and the compiler print goes to build/setup.log; the terminal shows how far the build is.

RANGER_SIM_BUILD_JOBS: how many modules are translated and compiled at once (default: one per processor).
RANGER_SIM_BUILT=1: an editable install does not build again what `make` has just built in place.
"""

import contextlib
import importlib.util
import json
import os
import pathlib
import re
import shutil
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor

from setuptools import Command, Extension, find_namespace_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.modified import newer_group

HERE = pathlib.Path(__file__).resolve().parent


def rooms_of_the_house():
    """The module ranger_sim/rooms.py without its package, which would look for what is not yet built."""
    spec = importlib.util.spec_from_file_location("rooms", HERE / "ranger_sim" / "rooms.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


rooms = rooms_of_the_house()
ROOMS = rooms.ROOMS
DATA_FOLDERS = ("profiles",)  # shipped like a room, no Python in them
LIBRARY = "ranger_sim._compiled"
SHARED = "ranger_sim._shared"  # Cython's helpers (memoryviews above all), once instead of in every module
STUBS = HERE / "stubs"  # types of the compiled modules, in folders named like the rooms (tools/stubs.py)
LOG = HERE / "build" / "setup.log"
RECORD = "build_record.json"  # in the package ranger_sim
# no fused multiply-add, no fast-math: both change the last bit of a trajectory
COMPILE_ARGUMENTS = ["-g0", "-ffp-contract=off", "-fno-fast-math", "-w"]
# The compiler needs a third of the time for -Og. Each of these modules runs at least half a per cent of a walk's
# instructions (callgrind), together 87 %, or carries the messages of boards in processes of their own, at every turn of
# `up`. What runs less is not worth the waiting.
OPTIMISE, OPTIMISE_LITTLE = "-O2", "-Og"
OFTEN_RUN = (
    "ranger_sim.boards.can_router",
    "ranger_sim.boards.modules.can_link",
    "ranger_sim.boards.modules.current_control",
    "ranger_sim.boards.modules.encoder_capture",
    "ranger_sim.boards.modules.motor_limits",
    "ranger_sim.boards.modules.quadrature_decoder",
    "ranger_sim.boards.modules.routing",
    "ranger_sim.boards.modules.ssp_link",
    "ranger_sim.boards.motor_board",
    "ranger_sim.can_bus.bus",
    "ranger_sim.can_bus.frame",
    "ranger_sim.datatable.store",
    "ranger_sim.firmware_sim.alarm",
    "ranger_sim.firmware_sim.analog",
    "ranger_sim.firmware_sim.arm7.core",
    "ranger_sim.firmware_sim.chip",
    "ranger_sim.firmware_sim.edge_line",
    "ranger_sim.firmware_sim.lpc2194.address_map",
    "ranger_sim.firmware_sim.lpc2194.board",
    "ranger_sim.firmware_sim.lpc2194.can",
    "ranger_sim.firmware_sim.lpc2194.pins",
    "ranger_sim.firmware_sim.lpc2194.ssp",
    "ranger_sim.firmware_sim.lpc2194.timer",
    "ranger_sim.firmware_sim.lpc2194.vic",
    "ranger_sim.firmware_sim.microcontroller",
    "ranger_sim.firmware_sim.peripheral",
    "ranger_sim.firmware_sim.peripherals.adc_external",
    "ranger_sim.firmware_sim.peripherals.can_controller",
    "ranger_sim.firmware_sim.peripherals.timer_capture",
    "ranger_sim.firmware_sim.scheduler",
    "ranger_sim.firmware_sim.vic",
    "ranger_sim.foundation.events",
    "ranger_sim.harness.lockstep",
    "ranger_sim.harness.processes.channel",
    "ranger_sim.harness.processes.endpoint",
    "ranger_sim.harness.processes.remote_board",
    "ranger_sim.harness.processes.stage",
    "ranger_sim.harness.wiring.board_wires",
    "ranger_sim.harness.wiring.imu_wire",
    "ranger_sim.plant.electrics.drive",
    "ranger_sim.plant.electrics.electrics",
    "ranger_sim.plant.electrics.motor_unit",
    "ranger_sim.plant.mechanics.air",
    "ranger_sim.plant.mechanics.stance",
    "ranger_sim.plant.ranger",
    "ranger_sim.plant.sensors.absolute_encoder",
    "ranger_sim.plant.sensors.imu",
    "ranger_sim.plant.sensors.incremental_encoder",
)
DIRECTIVES = {
    "always_allow_keywords": False,  # no keywords for functions of no or one argument: called directly from tables
    "auto_pickle": False,  # nobody pickles a board: less C to compile
    "binding": False,  # bound methods in schedule tables are then called in about 10 ns
    "boundscheck": True,
    "wraparound": True,
    "cdivision": False,
    "initializedcheck": False,  # every array field is set in __init__
    "embedsignature": True,
    "embedsignature.format": "clinic",  # inspect.signature reads it
    "emit_code_comments": False,  # our lines as comments in the C code: half of its lines, and nobody reads them there
}
# Where code lies, for tool chains that know these arguments (a trial tells). Of 10 MB of code a walk runs 130 KB: first
# methods, then what tables call by address, last getters, setters, constructors and initialisation; fewer gaps between.
LAYOUT_COMPILING = [
    "-ffunction-sections",
    "-fno-align-jumps",
    "-fno-align-labels",
    "-fno-align-loops",
    "-fno-plt",
    "-fvisibility=hidden",
]
LAYOUT_SCRIPT = """\
SECTIONS
{
  .text.methods : { *(.text.__pyx_f_*) *(.text.__pyx_pw_* .text.__pyx_pf_*) }
}
INSERT BEFORE .text;
"""
# Python finds one module in a library by the last part of its name, and ours holds many: it gets a directory of them.
DIRECTORY = """\
#include <Python.h>

%(declarations)s

static const struct {
    const char *name;
    PyObject *(*definition)(void);
} modules[] = {
%(entries)s
    {NULL, NULL},
};

/* The module that a spec names, not yet executed (PEP 489). */
static PyObject *create(PyObject *self, PyObject *spec) {
    PyObject *name = PyObject_GetAttrString(spec, "name");
    if (!name)
        return NULL;
    int i = 0;
    while (modules[i].name && PyUnicode_CompareWithASCIIString(name, modules[i].name) != 0)
        i++;
    if (!modules[i].name)
        PyErr_Format(PyExc_ImportError, "no compiled module %%R", name);
    Py_DECREF(name);
    return modules[i].name ? PyModule_FromDefAndSpec((PyModuleDef *)modules[i].definition(), spec) : NULL;
}

static int add_names(PyObject *self) {
    return PyModule_AddStringConstant(self, "names", "%(names)s") < 0
                   || PyModule_AddStringConstant(self, "sources", "%(sources)s") < 0
               ? -1
               : 0;
}

static PyMethodDef functions[] = {{"create", create, METH_O, NULL}, {NULL}};
static PyModuleDef_Slot slots[] = {{Py_mod_exec, add_names}, {0}};
static PyModuleDef directory = {
    PyModuleDef_HEAD_INIT, .m_name = "%(library)s", .m_methods = functions, .m_slots = slots};

PyMODINIT_FUNC PyInit__compiled(void) { return PyModuleDef_Init(&directory); }
"""


class NotCompiledError(Exception):
    """Why there will be no compiled modules, in one line."""


class OptionalBuild(build_ext):
    """Translates and compiles; a failure is told, recorded and survived: the interpreted run needs no compiler."""

    def run(self):
        tree_of_types()
        if self.editable_mode and os.environ.get("RANGER_SIM_BUILT", "") not in ("", "0"):
            return
        in_place, reason = self.inplace, ""
        jobs = int(os.environ.get("RANGER_SIM_BUILD_JOBS", "0")) or os.cpu_count() or 1
        try:
            self.check_wish_and_compiler()
            with chatter_to_log() as self.progress:
                self.modules, self.jobs = self.translate(jobs), jobs
                super().run()
        except NotCompiledError as why:
            reason = str(why)
        except Exception as error:  # noqa: BLE001  (whatever the tool chain throws, we fall back)
            reason = one_line(error)
        finally:
            self.inplace = in_place
        if reason:
            print(
                f"\n*** ranger-sim: NOT COMPILED: {reason}\n"
                + (f"*** What the tools said is in {LOG}\n" if LOG.exists() else "")
                + "*** The interpreted sources will run: same results, many times slower.\n",
                file=sys.stderr,
            )
        self.write_record(reason)

    def check_wish_and_compiler(self):
        """NotCompiledError when compiling is not wanted, or when a one-line C program with Python's header fails."""
        if os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0"):
            raise NotCompiledError("RANGER_SIM_INTERPRETED was set when it was built")
        from distutils.ccompiler import new_compiler
        from distutils.sysconfig import customize_compiler, get_python_inc

        compiler = new_compiler()
        customize_compiler(compiler)
        compiler.add_include_dir(get_python_inc())
        try:
            try_out(compiler)
        except Exception as error:  # noqa: BLE001  (each tool chain has its own)
            tool = " ".join(getattr(compiler, "compiler_so", ["cc"])[:1])
            raise NotCompiledError(
                f"the C compiler {tool!r} cannot compile a file that includes Python.h "
                "(are a compiler and Python's development files installed?)"
            ) from error

    def translate(self, jobs):
        """Python to C, into build/cython; only what changed. Returns {name of a module: its C file}."""
        try:
            from Cython.Build import cythonize
        except ImportError as error:
            raise NotCompiledError(f"no Cython ({one_line(error)})") from error
        self.marks = rooms.marks_of_sources(HERE)
        try:
            os.chdir(tree_of_links())
            translated = cythonize(
                [
                    *(Extension(name, [name.replace(".", "/") + ".py"]) for name in rooms.declared_modules(HERE)),
                    Extension(SHARED, [SHARED.replace(".", "/") + ".c"]),
                ],
                build_dir="../cython",
                language_level=3,
                nthreads=jobs if jobs > 1 else 0,
                compiler_directives=DIRECTIVES,
                shared_utility_qualified_name=SHARED,
                force=not same_as_kept(pathlib.Path("../cython/directives.json"), json.dumps([SHARED, DIRECTIVES])),
            )
        except Exception as error:  # noqa: BLE001  (Cython has printed the place)
            raise NotCompiledError(f"Cython could not translate the sources ({one_line(error)})") from error
        finally:
            os.chdir(HERE)
        return {each.name: os.path.normpath(f"build/tree/{each.sources[0]}") for each in translated}

    def build_extension(self, library):
        """The library: an object file of each module, and the directory of them."""
        compiling, linking = self.layout()
        with ThreadPoolExecutor(self.jobs) as pool:
            objects = []
            for compiled in pool.map(lambda name: self.compile_module(name, compiling), self.modules):
                objects.append(compiled)
                self.progress.show("compiled", len(objects), len(self.modules))
        library.sources = [self.write_directory()]
        library.extra_objects = library.depends = objects
        library.extra_link_args = linking
        super().build_extension(library)

    def layout(self):
        """Further arguments (for the compiler, for the linker); none for a tool chain that does not know them."""
        script = pathlib.Path(self.build_temp, "layout.ld").absolute()
        script.parent.mkdir(parents=True, exist_ok=True)
        script.write_text(LAYOUT_SCRIPT, encoding="ascii")
        linking = [f"-Wl,-T,{script}"]
        try:
            try_out(self.compiler, LAYOUT_COMPILING, linking)
        except Exception:  # noqa: BLE001  (each tool chain has its own)
            return [], []
        return LAYOUT_COMPILING, linking

    def compile_module(self, name, layout):
        """The object file of one module; compiled only when its C file or this file is newer."""
        source = self.modules[name]
        [compiled] = self.compiler.object_filenames([source], output_dir=self.build_temp)
        if self.force or newer_group([source, __file__], compiled):
            self.compiler.compile(
                [source],
                output_dir=self.build_temp,
                # last parts of names are not unique, and nobody outside the library looks for them
                macros=[("CYTHON_NO_PYINIT_EXPORT", None), ("PyInit_" + name.rpartition(".")[2], entry(name))],
                extra_postargs=[OPTIMISE if name in OFTEN_RUN else OPTIMISE_LITTLE, *COMPILE_ARGUMENTS, *layout],
            )
        return compiled

    def write_directory(self):
        """The C file with the names of all modules and marks of their sources; left alone when it has them."""
        text = DIRECTORY % {
            "declarations": "\n".join(f"PyObject *{entry(name)}(void);" for name in self.modules),
            "entries": "\n".join(f'    {{"{name}", {entry(name)}}},' for name in self.modules),
            "names": " ".join(self.modules),
            "sources": " ".join(f"{path}={mark}" for path, mark in self.marks.items()),
            "library": LIBRARY,
        }
        path = pathlib.Path("build/cython/directory.c")
        same_as_kept(path, text)
        return path.as_posix()

    def write_record(self, reason):
        """Beside the modules it speaks of: in the source tree or in the folder that becomes the wheel."""
        folder = HERE / "ranger_sim" if self.inplace else pathlib.Path(self.build_lib) / "ranger_sim"
        folder.mkdir(parents=True, exist_ok=True)
        record = {"compiled": not reason, "reason": reason}
        (folder / RECORD).write_text(json.dumps(record) + "\n", encoding="utf-8")


class BuildWithStubs(build_py):
    """Lays the stub of each compiled module beside it."""

    def run(self):
        super().run()
        if not self.editable_mode:
            for stub in STUBS.rglob("*.pyi"):
                target = pathlib.Path(self.build_lib, "ranger_sim", stub.relative_to(STUBS))
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(stub, target)


class Progress:
    """How far the build is: on a terminal one line that is rewritten, elsewhere a few lines."""

    def __init__(self, out):
        self.out = out
        self.rewritten = out.isatty()
        self.shown = ""

    def show(self, what, done, of):
        """`done` of `of` modules are `what`; told at every one on a terminal, else at the last one."""
        if done < of and not self.rewritten and not wanted_by_set_up():
            return
        text = f"{what} {done} of {of} modules"
        if text != self.shown:
            self.shown = text
            self.out.write(f"\r{text:<40}" + ("\n" if done == of else "") if self.rewritten else f"{text}\n")
            self.out.flush()


def wanted_by_set_up():
    """True when set_up.py has started this and makes its own line of every one of ours."""
    return os.environ.get("RANGER_SIM_SETUP", "") not in ("", "0")


def open_log():
    """The log, new; set_up.py has made it already and writes there beside us."""
    return LOG.open("a" if wanted_by_set_up() else "w", encoding="utf-8")


@contextlib.contextmanager
def chatter_to_log():
    """Everything that this process and its children print goes to the log; gives what shows the progress instead."""
    LOG.parent.mkdir(exist_ok=True)
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    reading, writing = os.pipe()
    with os.fdopen(kept[0], "w", closefd=False) as terminal, open_log() as log:
        progress = Progress(terminal)

        def keep():
            with os.fdopen(reading, encoding="utf-8", errors="replace") as lines:
                for line in lines:
                    log.write(line)
                    log.flush()
                    if told := re.match(r"\[ *(\d+)/(\d+)\] Cythonizing", line):
                        progress.show("translated", int(told[1]), int(told[2]))

        keeper = threading.Thread(target=keep)
        keeper.start()
        for number in (1, 2):
            os.dup2(writing, number)
        os.close(writing)
        try:
            yield progress
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for number, was in zip((1, 2), kept, strict=True):
                os.dup2(was, number)
            keeper.join()
            for was in kept:
                os.close(was)


def same_as_kept(path, text):
    """True when the file holds this text already; otherwise it is written."""
    if path.exists() and path.read_text(encoding="utf-8") == text:
        return True
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return False


def one_line(error):
    """An exception as one line of text."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) < 300 else text[:300] + " ..."


def entry(name):
    """The C function that gives a module's definition."""
    return "PyInit_" + name.replace(".", "__")


def try_out(compiler, compiling=(), linking=None):
    """Compiles a C file that includes Python's header, and links it if there are arguments for that; or raises."""
    with tempfile.TemporaryDirectory() as folder:
        program = pathlib.Path(folder) / "trial.c"
        program.write_text("#include <Python.h>\nint ranger_sim_trial;\n", encoding="ascii")
        objects = compiler.compile([str(program)], output_dir=folder, extra_postargs=list(compiling))
        if linking is not None:
            compiler.link_shared_object(objects, str(program.with_suffix(".so")), extra_postargs=list(linking))


def tree_of_links():
    """The folder in which `ranger_sim` lies as it will be installed: by links to this package and to the rooms."""
    package = HERE / "build" / "tree" / "ranger_sim"
    package.mkdir(parents=True, exist_ok=True)
    for target in (*(HERE / "ranger_sim").glob("*.py"), *(HERE / room for room in ROOMS)):
        link = package / target.name
        if not link.is_symlink():
            link.symlink_to(os.path.relpath(target, package), target_is_directory=target.is_dir())
    return package.parent


def tree_of_types():
    """The folder in which mypy finds `ranger_sim` as it will be installed: links to modules, stubs of compiled ones."""
    tree = HERE / "build" / "typed" / "ranger_sim"
    wanted = {}
    for room in ("ranger_sim", *ROOMS):
        for path in (HERE / room).rglob("*.py"):
            inside = path.relative_to(HERE / "ranger_sim" if room == "ranger_sim" else HERE)
            wanted[tree / inside] = path
    wanted[tree / "py.typed"] = HERE / "ranger_sim" / "py.typed"
    for stub in STUBS.rglob("*.pyi"):
        wanted[tree / stub.relative_to(STUBS)] = stub
        wanted.pop(tree / stub.relative_to(STUBS).with_suffix(".py"), None)
    for there in list(tree.rglob("*")):
        if there.is_symlink() and there not in wanted:
            there.unlink()
    for link, target in wanted.items():
        if not link.is_symlink():
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(os.path.relpath(target, link.parent))


class LayTypes(Command):
    """`setup.py lay_types`: makes that folder anew, for what has been added or removed since the last build."""

    description = "lay modules and stubs where mypy reads them"
    user_options = []

    def initialize_options(self):
        """No options."""

    def finalize_options(self):
        """No options."""

    def run(self):
        tree_of_types()


def packages():
    """{package: its folder} of the wheel, whose only top level is `ranger_sim`; folders of data files are packages."""
    found = {"ranger_sim": "ranger_sim"}
    for room in (*ROOMS, *DATA_FOLDERS):
        for name in [
            room,
            *(f"{room}.{inside}" for inside in find_namespace_packages(room, exclude=["*__pycache__*"])),
        ]:
            found[f"ranger_sim.{name}"] = name.replace(".", "/")
    return found


if __name__ == "__main__":
    # named, libm gives its present functions; found through Python it gives those for programs linked long ago
    mathematics = ["m"] if os.name == "posix" else []
    setup(
        packages=list(packages()),
        package_dir=packages(),
        ext_modules=[Extension(LIBRARY, [], libraries=mathematics)],
        cmdclass={"build_ext": OptionalBuild, "build_py": BuildWithStubs, "lay_types": LayTypes},
    )
