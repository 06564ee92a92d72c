"""The command line starts without the libraries that a walk does not need."""

import subprocess
import sys

LARGE = "cantools cffi h11 perfetto plotly elftools vcd scipy shtab starlette uvicorn websockets".split()

PROGRAM = """
import sys
from ranger_sim.tools.cli import parser
parser()
print(sorted({name.partition(".")[0] for name in sys.modules} & set(sys.argv[1:])))
"""


def test_the_options_are_known_before_any_large_library_is_loaded():
    done = subprocess.run([sys.executable, "-c", PROGRAM, *LARGE], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
