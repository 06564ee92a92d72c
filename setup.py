"""Builds every module that has a .pxd beside it; without a C compiler the plain sources are used.

All or nothing: a compiled module reads the fields of another's classes at fixed places, so compiled and interpreted
modules must not be mixed. When anything fails, this is told, the reason is written to foundation/build_record.json,
and the whole robot runs interpreted (foundation/__init__.py reads the record).

RANGER_SIM_BUILD_JOBS: how many modules are translated and compiled at once (default: one per processor).
RANGER_SIM_BUILT=1: an editable install does not build again what `make` has just built in place.
"""

import json
import os
import pathlib
import sys
import tempfile

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = pathlib.Path(__file__).resolve().parent
PACKAGES = (
    "foundation",
    "datatable",
    "can_bus",
    "plant",
    "firmware_sim",
    "boards",
    "harness",
    "tools",
)
RECORD = "build_record.json"  # in the package foundation
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
            self.translate(jobs)
            self.parallel = jobs
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
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "trial.c"
            program.write_text("#include <Python.h>\nint ranger_sim_trial;\n", encoding="ascii")
            try:
                compiler.compile([str(program)], output_dir=folder, include_dirs=[get_python_inc()])
            except Exception as error:  # noqa: BLE001  (each tool chain has its own)
                tool = " ".join(getattr(compiler, "compiler_so", ["cc"])[:1])
                raise NotCompiledError(
                    f"the C compiler {tool!r} cannot compile a file that includes Python.h "
                    "(are a compiler and Python's development files installed?)"
                ) from error

    def translate(self, jobs):
        """Python to C, into build/cython; only what changed."""
        try:
            from Cython.Build import cythonize
        except ImportError as error:
            raise NotCompiledError(f"no Cython ({one_line(error)})") from error
        os.chdir(HERE)
        try:
            translated = cythonize(
                self.extensions,
                build_dir="build/cython",
                language_level=3,
                nthreads=jobs if jobs > 1 else 0,
                compiler_directives=DIRECTIVES,
            )
        except Exception as error:  # noqa: BLE001  (Cython has printed the place)
            raise NotCompiledError(f"Cython could not translate the sources ({one_line(error)})") from error
        by_name = {extension.name: extension for extension in translated}
        for extension in self.extensions:
            extension.sources = by_name[extension.name].sources
            extension.depends = by_name[extension.name].depends

    def write_record(self, reason):
        """Beside the modules it speaks of: in the source tree or in the folder that becomes the wheel."""
        folder = HERE / "foundation" if self.inplace else pathlib.Path(self.build_lib) / "foundation"
        folder.mkdir(parents=True, exist_ok=True)
        record = {"compiled": not reason, "reason": reason}
        (folder / RECORD).write_text(json.dumps(record) + "\n", encoding="utf-8")


def one_line(error):
    """An exception as one line of text."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) < 300 else text[:300] + " ..."


def extensions():
    """One extension per compiled module, as paths relative to this folder (setuptools wants them so)."""
    found = []
    for package in PACKAGES:
        for declaration in sorted((HERE / package).rglob("*.pxd")):
            source = declaration.with_suffix(".py").relative_to(HERE)
            name = ".".join(source.with_suffix("").parts)
            found.append(Extension(name, [source.as_posix()], extra_compile_args=COMPILE_ARGUMENTS))
    return found


if __name__ == "__main__":
    setup(ext_modules=extensions(), cmdclass={"build_ext": OptionalBuild})
