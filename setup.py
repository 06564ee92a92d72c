"""Builds every module that has a .pxd beside it; without a C compiler the plain sources are used."""

import os
import pathlib
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = pathlib.Path(__file__).parent
PACKAGES = (
    "foundation",
    "datatable",
    "can_bus",
    "plant",
    "firmware_sim",
    "boards",
    "harness",
    "sysid",
    "tools",
)


class OptionalBuild(build_ext):
    """A failed compilation is told and survived: the interpreted run needs no compiler."""

    def run(self):
        try:
            super().run()
        except Exception as error:  # noqa: BLE001  (whatever the tool chain throws, we fall back)
            self.told(error)

    def build_extension(self, extension):
        try:
            super().build_extension(extension)
        except Exception as error:  # noqa: BLE001
            self.told(error)

    @staticmethod
    def told(error):
        print(f"ranger-sim: not compiled ({error}); the interpreted sources will run", file=sys.stderr)


def extensions():
    """One extension per compiled module, as paths relative to this folder (setuptools wants them so)."""
    if os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0"):
        return []
    try:
        from Cython.Build import cythonize
    except ImportError:
        return []
    found = []
    for package in PACKAGES:
        for declaration in sorted((HERE / package).rglob("*.pxd")):
            source = declaration.with_suffix(".py").relative_to(HERE)
            found.append(
                Extension(
                    ".".join(source.with_suffix("").parts),
                    [str(source)],
                    # no fused multiply-add, no fast-math: both change the last bit of a trajectory
                    extra_compile_args=["-O2", "-ffp-contract=off", "-fno-fast-math", "-w"],
                )
            )
    return cythonize(
        found,
        language_level=3,
        nthreads=int(os.environ.get("RANGER_SIM_BUILD_JOBS", "0")),
        compiler_directives={
            "binding": False,  # bound methods in schedule tables are then called in about 10 ns
            "boundscheck": True,
            "wraparound": True,
            "cdivision": False,
            "embedsignature": True,
        },
    )


setup(ext_modules=extensions(), cmdclass={"build_ext": OptionalBuild})
