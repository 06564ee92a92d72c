"""Compiles every module that contains `import cython`; without a C compiler the sources run uncompiled.

All or nothing: a compiled module reads the fields of another's classes at fixed places, so compiled and interpreted
modules must not be mixed. When anything fails, a message reports it, the reason is written to the record next to the
libraries, and the whole robot runs interpreted (ranger_sim/loading.py reads the record).

Each module is a separate extension module. The output of Cython and the compiler goes to build/setup.log; the terminal
shows the progress of the build. In a checkout the libraries go to build/compiled, one folder per kind of Python. Where
there is ccache, and CC names no other compiler, it keeps what was compiled: a fresh clone then compiles nothing.

RANGER_SIM_BUILD_JOBS: how many modules are translated and compiled at once (default: one per processor).
RANGER_SIM_ADDRESS: of the project's repository, for links of a release (dev/publication.py).
RANGER_SIM_BUILT=1: an editable install does not build again what `make` has just built.
"""

import contextlib
import json
import os
import pathlib
import re
import shutil
import sys
import sysconfig
import tempfile
import threading

from setuptools import Extension, find_namespace_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.modified import newer_group

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
try:
    from dev import declarations, publication, stubs  # not in the package: an installation does not need them
    from ranger_sim import loading
except ImportError as error:
    sys.exit(f"ranger-sim cannot be built: {error}")

SHARED = "ranger_sim._shared"  # Cython's helpers (memoryviews above all), once instead of in every module
LOG = HERE / "build" / "setup.log"
TRANSLATED = HERE / "build" / "cython"
IN_PLACE = loading.COMPILED or HERE  # the folder of the libraries in a checkout; in other trees next to the sources
# no fused multiply-add, no fast-math: both change the last bit of a trajectory
COMPILE_ARGUMENTS = ["-g0", "-ffp-contract=off", "-fno-fast-math", "-w"]
MICROSOFTS = ["/fp:precise", "/w"]  # the same of its compiler, which contracts nothing by itself
TOGETHER = [
    "-fno-plt",
    "-fvisibility=hidden",
]  # direct calls of Python's functions, for compilers that support it
# The compiler needs a third of the time for -Og. Each of these modules runs at least half a per cent of a walk's
# instructions (callgrind), together 87 %, or is what `--trace` needs, or carries the messages of boards in separate
# processes, at every turn of `up`. For the others the time is not worth it.
# Loops begin with a line of the cache: that around all instructions of firmware_sim/arm7 is 10 % slower elsewhere, and
# where it happens to lie changes with every edit.
OPTIMISE, OPTIMISE_LITTLE = ["-O2", "-falign-loops=64"], ["-Og"]
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
    "ranger_sim.firmware_sim.activity",
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
    "ranger_sim.firmware_sim.native.functions",
    "ranger_sim.firmware_sim.native.header_calls",
    "ranger_sim.firmware_sim.native.native_board",
    "ranger_sim.firmware_sim.peripheral",
    "ranger_sim.firmware_sim.peripherals.adc_external",
    "ranger_sim.firmware_sim.peripherals.can_controller",
    "ranger_sim.firmware_sim.peripherals.timer_capture",
    "ranger_sim.firmware_sim.scheduler",
    "ranger_sim.firmware_sim.vic",
    "ranger_sim.foundation.events",
    "ranger_sim.foundation.row_stream",
    "ranger_sim.harness.lockstep",
    "ranger_sim.harness.processes.channel",
    "ranger_sim.harness.processes.endpoint",
    "ranger_sim.harness.processes.remote_board",
    "ranger_sim.harness.processes.stage",
    "ranger_sim.harness.records.sampler",
    "ranger_sim.harness.timeline.activity_parts",
    "ranger_sim.harness.timeline.packing",
    "ranger_sim.harness.wiring.board_wires",
    "ranger_sim.harness.wiring.imu_wire",
    "ranger_sim.plant.electrics.drive",
    "ranger_sim.plant.electrics.electrics",
    "ranger_sim.plant.electrics.motor_unit",
    "ranger_sim.plant.mechanics.air",
    "ranger_sim.plant.mechanics.leg_motion",
    "ranger_sim.plant.mechanics.stance",
    "ranger_sim.plant.mechanics.stance_equations",
    "ranger_sim.plant.ranger",
    "ranger_sim.plant.sensors.absolute_encoder",
    "ranger_sim.plant.sensors.imu",
    "ranger_sim.plant.sensors.incremental_encoder",
)
DIRECTIVES = {
    "always_allow_keywords": False,  # no keywords for functions of no or one argument: called directly from tables
    "auto_pickle": False,  # boards are not pickled: less C to compile
    "binding": False,  # bound methods in schedule tables are then called in about 10 ns
    "boundscheck": True,
    "wraparound": True,
    "cdivision": False,
    "initializedcheck": False,  # every array field is set in __init__
    "embedsignature": True,
    "embedsignature.format": "clinic",  # inspect.signature reads it
    "emit_code_comments": False,  # our lines as comments in the C code would be half of its lines
}


class NotCompiledError(Exception):
    """Reason for building no compiled modules, in one line."""


class OptionalBuild(build_ext):
    """Translates and compiles; a failure is reported, recorded and survived: the interpreted run needs no compiler."""

    def run(self):
        """Everything; in a checkout into build/compiled."""
        if self.editable_mode and os.environ.get("RANGER_SIM_BUILT", "") not in ("", "0"):
            return
        in_place = self.inplace or self.editable_mode
        kept = self.inplace, self.build_lib
        if in_place:
            self.inplace, self.build_lib = False, str(IN_PLACE)
        folder = (
            loading.COMPILED if in_place and loading.COMPILED else pathlib.Path(self.build_lib, declarations.PACKAGE)
        )
        sources, reason = {}, why_not_compiled()
        try:
            if not reason:
                with chatter_to_log() as self.progress:
                    sources, self.built = self.translate(), 0
                    super().run()
        except NotCompiledError as why:
            reason = str(why)
        except Exception as error:  # noqa: BLE001  (whatever the tool chain raises, the sources run)
            reason = one_line(error)
        finally:
            self.inplace, self.build_lib = kept
        if reason:
            report(reason)
        write_record(folder, reason, sources)

    def translate(self):
        """Python to C, in build/cython, only what changed. Returns the sources as they were (loading.py)."""
        try:
            import Cython
            from Cython.Build import cythonize
        except ImportError as error:
            raise NotCompiledError(f"no Cython ({one_line(error)})") from error
        self.parallel = jobs = int(os.environ.get("RANGER_SIM_BUILD_JOBS", "0")) or os.cpu_count() or 1
        found = loading.sources({})
        try:
            names = declarations.write_declarations(HERE, TRANSLATED)
        except declarations.DeclarationError as error:
            raise NotCompiledError(str(error)) from error
        helpers = pathlib.Path(SHARED.replace(".", "/") + ".c")
        try:
            os.chdir(TRANSLATED)
            directives = json.dumps([SHARED, DIRECTIVES, Cython.__version__])
            all_anew = not same_as_kept(TRANSLATED / "directives.json", directives)
            shared = [] if helpers.exists() and not all_anew else [Extension(SHARED, [helpers.as_posix()])]
            cythonize(
                [*(Extension(name, [name.replace(".", "/") + ".py"]) for name in names), *shared],
                language_level=3,
                nthreads=jobs if jobs > 1 else 0,
                compiler_directives=DIRECTIVES,
                shared_utility_qualified_name=SHARED,
                force=all_anew,
            )
        except Exception as error:  # noqa: BLE001  (Cython has printed the place)
            raise NotCompiledError(f"Cython could not translate the sources ({one_line(error)})") from error
        finally:
            os.chdir(HERE)
        return found

    def build_extensions(self):
        """All modules. A library is linked under another name: one that a killed linker left would look up to date."""
        if "CC" not in os.environ and compiler_type() == "unix" and shutil.which("ccache"):
            self.compiler.set_executable("compiler_so", ["ccache", *self.compiler.compiler_so])
        link = self.compiler.link_shared_object

        def link_whole(objects, library, *arguments, **more):
            unfinished = f"{library}.unfinished"
            link(objects, unfinished, *arguments, **more)
            os.replace(unfinished, library)

        self.compiler.link_shared_object = link_whole
        super().build_extensions()

    def build_extension(self, extension):
        """One module, or its library of this checkout if that is up to date; and how far the build is."""
        place = self.get_ext_filename(extension.name)
        ours, wanted = pathlib.Path(IN_PLACE, place), pathlib.Path(self.build_lib, place)
        if ours == wanted or newer_group([*extension.sources, *extension.depends], str(ours)):
            super().build_extension(extension)
        else:
            wanted.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ours, wanted)
        self.built += 1
        self.progress.show("compiled", self.built, len(self.extensions))


class BuildWithStubs(build_py):
    """Adds the type stub of each compiled module, and the record where nothing is compiled."""

    def run(self):
        """Everything in a wheel except the libraries."""
        super().run()
        if self.editable_mode:
            return
        for place, text in stubs.stubs(HERE).items():
            target = pathlib.Path(self.build_lib, place)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        if not self.distribution.has_ext_modules():
            reason = why_not_compiled()
            report(reason)
            write_record(pathlib.Path(self.build_lib, declarations.PACKAGE), reason, {})


def why_not_compiled():
    """Why nothing will be compiled here, in one line: it is not wanted, or the compiler does not work. Or empty."""
    if os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0"):
        return "RANGER_SIM_INTERPRETED was set when it was built"
    if not understood([]):
        tool = (os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc").split()[0]
        return (
            f"the C compiler {tool!r} cannot compile a file that includes Python.h "
            "(are a compiler and Python's development files installed?)"
        )
    return ""


def extensions():
    """The extension modules: those of the sources that are compiled, and the one that they share."""
    is_microsofts = compiler_type() == "msvc"
    often, seldom = (["/O2"], ["/O1"]) if is_microsofts else (OPTIMISE, OPTIMISE_LITTLE)
    arguments = MICROSOFTS if is_microsofts else [*COMPILE_ARGUMENTS, *(TOGETHER if understood(TOGETHER) else [])]
    return [
        Extension(
            name,
            [f"build/cython/{name.replace('.', '/')}.c"],
            depends=["setup.py"],
            # linked by name, libm provides its present functions; found through Python, those for old programs
            libraries=["m"] if os.name == "posix" else [],
            extra_compile_args=[*(often if name in OFTEN_RUN else seldom), *arguments],
        )
        for name in [*declarations.Sources(HERE).compiled_modules(), SHARED]
    ]


def compiler_type():
    """The kind of the compiler as setuptools names it: `unix` for gcc and clang, `msvc` for Microsoft's."""
    from distutils.ccompiler import get_default_compiler

    return get_default_compiler()


def understood(arguments):
    """Whether the compiler compiles a file that includes Python.h with these arguments."""
    from distutils.ccompiler import new_compiler
    from distutils.sysconfig import customize_compiler, get_python_inc

    compiler = new_compiler()
    customize_compiler(compiler)
    compiler.add_include_dir(get_python_inc())
    with tempfile.TemporaryDirectory() as folder, quiet():
        program = pathlib.Path(folder) / "trial.c"
        program.write_text("#include <Python.h>\nint ranger_sim_trial;\n", encoding="ascii")
        try:
            compiler.compile([str(program)], output_dir=folder, extra_postargs=list(arguments))
        except Exception:  # noqa: BLE001  (each tool chain has its own)
            return False
    return True


def report(reason):
    """Print on the terminal that the sources will run, and why."""
    print(
        f"\n*** ranger-sim: NOT COMPILED: {reason}\n"
        + (f"*** The output of the tools is in {LOG}\n" if LOG.exists() else "")
        + "*** The interpreted sources will run: same results, many times slower.\n",
        file=sys.stderr,
    )


def write_record(folder, reason, sources):
    """Write the record next to the libraries: whether they are complete, or why not, and their sources."""
    folder.mkdir(parents=True, exist_ok=True)
    record = {"compiled": not reason, "reason": reason, "sources": {} if reason else sources}
    (folder / loading.RECORD).write_text(json.dumps(record, indent=0) + "\n", encoding="utf-8")


class Progress:
    """Progress of the build: on a terminal one line that is rewritten, elsewhere a few lines."""

    def __init__(self, out):
        self.out = out
        self.rewritten = out.isatty()
        self.shown = ""

    def show(self, what, done, of):
        """`done` of `of` modules are `what`; printed at every one on a terminal, else at the last one."""
        if done < of and not self.rewritten and not wanted_by_set_up():
            return
        text = f"{what} {done} of {of} modules"
        if text != self.shown:
            self.shown = text
            self.out.write(f"\r{text:<40}" + ("\n" if done == of else "") if self.rewritten else f"{text}\n")
            self.out.flush()


def wanted_by_set_up():
    """True when set_up.py has started this and rewrites each of our lines as its own."""
    return os.environ.get("RANGER_SIM_SETUP", "") not in ("", "0")


def open_log():
    """Open a new log; set_up.py has created it already and writes to it as well."""
    return LOG.open("a" if wanted_by_set_up() else "w", encoding="utf-8")


@contextlib.contextmanager
def chatter_to_log():
    """Send all output of this process and its children to the log; returns the stream for the progress instead."""
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
                    if found := re.match(r"\[ *(\d+)/(\d+)\] Cythonizing", line):
                        progress.show("translated", int(found[1]), int(found[2]))

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


@contextlib.contextmanager
def quiet():
    """Hide the output of a compiler trial."""
    kept = os.dup(1), os.dup(2)
    nothing = os.open(os.devnull, os.O_WRONLY)
    sys.stdout.flush()
    sys.stderr.flush()
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        for number, was in zip((1, 2), kept, strict=True):
            os.dup2(was, number)
        for each in (*kept, nothing):
            os.close(each)


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


if __name__ == "__main__":
    import ranger_sim

    address = os.environ.get("RANGER_SIM_ADDRESS", "")
    setup(
        long_description=publication.readme(
            (HERE / "README.md").read_text(encoding="utf-8"), address, ranger_sim.__version__
        ),
        long_description_content_type="text/markdown",
        project_urls=publication.addresses(address, ranger_sim.__version__),
        packages=find_namespace_packages(include=["ranger_sim", "ranger_sim.*"], exclude=["*__pycache__*"]),
        package_dir={"ranger_sim": "ranger_sim"},
        ext_modules=[] if why_not_compiled() else extensions(),
        cmdclass={"build_ext": OptionalBuild, "build_py": BuildWithStubs},
    )
