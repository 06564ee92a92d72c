"""Builds every module that has a .pxd beside it; without a C compiler the plain sources are used.

All of them go into one shared library, ranger_sim._compiled: Python's constants, entry points and numbers are then in
one place instead of one per module, and what runs lies together, apart from what does not (LAYOUT below). The whole
robot runs some 4 % faster than with a library of each module.

All or nothing: a compiled module reads the fields of another's classes at fixed places, so compiled and interpreted
modules must not be mixed. When anything fails, this is told, the reason is written to ranger_sim/build_record.json,
and the whole robot runs interpreted (ranger_sim/loading.py reads the record).

RANGER_SIM_BUILD_JOBS: how many modules are translated and compiled at once (default: one per processor).
RANGER_SIM_BUILT=1: an editable install does not build again what `make` has just built in place.
"""

import json
import os
import pathlib
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

from setuptools import Extension, find_namespace_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.modified import newer_group

HERE = pathlib.Path(__file__).resolve().parent
ROOMS = (
    "foundation",
    "datatable",
    "can_bus",
    "plant",
    "firmware_sim",
    "boards",
    "harness",
    "tools",
)
DATA_FOLDERS = ("profiles",)  # shipped like a room, no Python in them
LIBRARY = "ranger_sim._compiled"
RECORD = "build_record.json"  # in the package ranger_sim
# no fused multiply-add, no fast-math: both change the last bit of a trajectory
COMPILE_ARGUMENTS = ["-O2", "-g0", "-ffp-contract=off", "-fno-fast-math", "-w"]
DIRECTIVES = {
    "always_allow_keywords": False,  # no keywords for functions of no or one argument: called directly from tables
    "auto_pickle": False,  # nobody pickles a board: less C to compile
    "binding": False,  # bound methods in schedule tables are then called in about 10 ns
    "boundscheck": True,
    "wraparound": True,
    "cdivision": False,
    "initializedcheck": False,  # every array field is set in __init__
    "embedsignature": True,
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
    return PyModule_AddStringConstant(self, "names", "%(names)s");
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
        if self.editable_mode and os.environ.get("RANGER_SIM_BUILT", "") not in ("", "0"):
            return
        in_place, reason = self.inplace, ""
        jobs = int(os.environ.get("RANGER_SIM_BUILD_JOBS", "0")) or os.cpu_count() or 1
        try:
            self.check_wish_and_compiler()
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
                "*** The interpreted sources will run: same results, many times slower.\n",
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
        try:
            os.chdir(tree_of_links())
            translated = cythonize(
                [Extension(name, [name.replace(".", "/") + ".py"]) for name in declared_modules()],
                build_dir="../cython",
                language_level=3,
                nthreads=jobs if jobs > 1 else 0,
                compiler_directives=DIRECTIVES,
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
            objects = list(pool.map(lambda name: self.compile_module(name, compiling), self.modules))
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
                extra_postargs=COMPILE_ARGUMENTS + layout,
            )
        return compiled

    def write_directory(self):
        """The C file with the names of all modules; left alone when it holds them already."""
        text = DIRECTORY % {
            "declarations": "\n".join(f"PyObject *{entry(name)}(void);" for name in self.modules),
            "entries": "\n".join(f'    {{"{name}", {entry(name)}}},' for name in self.modules),
            "names": " ".join(self.modules),
            "library": LIBRARY,
        }
        path = pathlib.Path("build/cython/directory.c")
        if not path.exists() or path.read_text(encoding="ascii") != text:
            path.write_text(text, encoding="ascii")
        return path.as_posix()

    def write_record(self, reason):
        """Beside the modules it speaks of: in the source tree or in the folder that becomes the wheel."""
        folder = HERE / "ranger_sim" if self.inplace else pathlib.Path(self.build_lib) / "ranger_sim"
        folder.mkdir(parents=True, exist_ok=True)
        record = {"compiled": not reason, "reason": reason}
        (folder / RECORD).write_text(json.dumps(record) + "\n", encoding="utf-8")


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


def declared_modules():
    """Names of the modules to compile."""
    for room in ROOMS:
        for declaration in sorted((HERE / room).rglob("*.pxd")):
            yield ".".join(("ranger_sim", *declaration.relative_to(HERE).with_suffix("").parts))


def tree_of_links():
    """The folder in which `ranger_sim` lies as it will be installed: by links to this package and to the rooms."""
    package = HERE / "build" / "tree" / "ranger_sim"
    package.mkdir(parents=True, exist_ok=True)
    for target in (*(HERE / "ranger_sim").glob("*.py"), *(HERE / room for room in ROOMS)):
        link = package / target.name
        if not link.is_symlink():
            link.symlink_to(os.path.relpath(target, package), target_is_directory=target.is_dir())
    return package.parent


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
        cmdclass={"build_ext": OptionalBuild},
    )
