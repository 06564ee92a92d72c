"""The command line starts without the libraries that a walk does not need."""

import subprocess
import sys

import set_up

MODULES = {"pyvcd": "vcd"}  # where it is not called as its package

PROGRAM = """
import sys
from ranger_sim.tools.cli import parser
parser()
print(sorted({name.partition(".")[0] for name in sys.modules} & set(sys.argv[1:])))
"""


def test_the_options_are_known_before_any_large_library_is_loaded():
    """What a walk's set-up leaves for later (set_up.py) must not be needed to walk, and nobody waits for it."""
    names = [MODULES.get(name, name) for name in sorted(set_up.LATER)]
    done = subprocess.run([sys.executable, "-c", PROGRAM, *names], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
