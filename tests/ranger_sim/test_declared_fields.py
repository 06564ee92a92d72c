"""Interpreted objects have the fields that their .pxd declares, and no others, as compiled ones do."""

import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.declared_fields import FIELDS, declared_fields

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
DECLARATIONS = """\
cdef class First:
    cdef public double[4] near, far  # of what
    cdef readonly long long[::1] kept
    cdef long long* packed
    cdef public unsigned long long state
    cdef public object a, b
    cpdef int step(self) except -1
    cdef void _step(
        self, double h,
    ) noexcept

cdef class Second(First):
    cdef public bint on
"""
LOOK = """\
from ranger_sim.plant.electrics.drive import Drive

class OfAUser:
    pass

OfAUser().anything = 1
drive = Drive()
drive.duty = 0.25
try:
    drive.dutty = 0.5
except AttributeError:
    print(drive.duty, hasattr(drive, "__dict__"))
"""


def test_fields_of_every_kind_are_found(tmp_path):
    (tmp_path / "some.pxd").write_text(DECLARATIONS, encoding="utf-8")
    assert declared_fields(tmp_path / "some.pxd") == {
        "First": ("near", "far", "kept", "packed", "state", "a", "b"),
        "Second": ("on",),
    }
    assert declared_fields(tmp_path / "none.pxd") == {}


@pytest.mark.parametrize("package", ["foundation", "can_bus", "plant", "firmware_sim", "boards", "harness"])
def test_no_declared_field_is_missed(package):
    for path in (ROOT / package).rglob("*.pxd"):
        for line in path.read_text(encoding="utf-8").splitlines():
            text = line.partition("#")[0].rstrip()
            if text.startswith("    cdef ") and "(" not in text:
                assert FIELDS.match(text), f"{path}: {line}"


@pytest.mark.parametrize("interpreted", ["1", "0"])
def test_an_undeclared_field_is_an_error_interpreted_and_compiled_but_not_in_other_modules(interpreted):
    environment = os.environ | {"RANGER_SIM_INTERPRETED": interpreted}
    seen = subprocess.run([sys.executable, "-c", LOOK], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert seen.stdout == "0.25 False\n", seen.stderr
