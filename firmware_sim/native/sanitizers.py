"""Running a program with the compiler's sanitizers: what their runtime needs of a process, and what it found.

The runtime of the address sanitizer must be in a process before anything else, so a run with it is a process of its
own, started with LD_PRELOAD. What is found goes to files, and the run goes on.
"""

import contextlib
import ctypes
import os
import pathlib
import re
import subprocess
from collections.abc import Iterable

from ranger_sim.firmware_sim.native.build import compiler
from ranger_sim.firmware_sim.native.crash import lines_of
from ranger_sim.foundation.user_error import UserError

# Findings are told once for each place. Leaks are not looked for: the program allocates nothing, Python does. What a
# signal ends is told by crash.py.
OPTIONS = "detect_leaks=0:halt_on_error=0:handle_segv=0:handle_sigbus=0:handle_sigfpe=0:handle_abort=0:handle_sigill=0"
PLACE = "RANGER_SIM_FINDINGS"  # beginning of the files' names
UNDEFINED_RUNTIMES = ("libubsan.so.1", "libubsan.so.2")
UNDEFINED = re.compile(r"^(?P<file>[^\s:]+):(?P<line>\d+)(?::\d+)?: runtime error: (?P<text>.*)$", re.MULTILINE)
ADDRESS = re.compile(r"ERROR: AddressSanitizer: (?P<what>[\w-]+) on .*?(?=^=====|\Z)", re.DOTALL | re.MULTILINE)
ACCESS = re.compile(r"^(?P<access>READ|WRITE) of size (?P<size>\d+)", re.MULTILINE)
# of the copy that was loaded: its name is the library's with eight characters behind it (library.py)
FRAME = re.compile(r"^\s*#\d+ .*/(?P<name>[^/]+)-[^/-]{8}\.so\+0x(?P<offset>[0-9a-f]+)\)", re.MULTILINE)


def is_ready() -> bool:
    """True in a process that has the runtime of the address sanitizer."""
    return hasattr(ctypes.CDLL(None), "__asan_init")


def environment(logs: pathlib.Path) -> dict[str, str]:
    """Of a process that can run a program with sanitizers; findings go to files in the folder `logs`."""
    program = compiler()
    asked = subprocess.run([program, "-print-file-name=libasan.so"], capture_output=True, check=False, text=True)
    runtime = pathlib.Path(asked.stdout.strip())
    if not runtime.is_file():
        raise UserError(f"{program} has no runtime of the address sanitizer (libasan.so): --sanitize needs it")
    place = str(logs / "findings")
    options = f"{OPTIONS}:log_path={place}"
    return {**os.environ, "LD_PRELOAD": str(runtime), "ASAN_OPTIONS": options, "UBSAN_OPTIONS": options, PLACE: place}


def lead_findings() -> None:
    """After a library was loaded: what its undefined-behaviour sanitizer finds goes to the same place.

    Beside the address sanitizer that runtime reads no options of its own.
    """
    place = os.environ.get(PLACE)
    if place is None:
        return
    os.environ.pop("LD_PRELOAD", None)  # it was for this process, not for those it starts
    for name in UNDEFINED_RUNTIMES:
        with contextlib.suppress(OSError):  # not loaded: nothing here was compiled with it
            runtime = ctypes.CDLL(name, mode=os.RTLD_NOW | os.RTLD_NOLOAD)
            runtime.__sanitizer_set_report_path(f"{place}-undefined".encode())


def findings(logs: pathlib.Path, folders: Iterable[pathlib.Path]) -> list[str]:
    """What was found, a line each with file and line, each once; files relative to the firmware's folder."""
    places = [folder.resolve() for folder in folders]
    found = []
    for log in logs.glob("findings*"):
        text = log.read_text(encoding="utf-8", errors="replace")
        found += [_undefined(each, places) for each in UNDEFINED.finditer(text)]
        found += [_address(each[0], each["what"], places) for each in ADDRESS.finditer(text)]
    return sorted(set(found))


def _undefined(found: re.Match[str], folders: list[pathlib.Path]) -> str:
    path = pathlib.Path(found["file"]).resolve()
    inside = [path.relative_to(folder) for folder in folders if path.is_relative_to(folder)]
    text = re.sub(r"address 0x[0-9a-f]+", "an address", found["text"])  # another one in every run
    return f"{inside[0] if inside else path.name}:{found['line']}: {text}"


def _address(text: str, what: str, folders: list[pathlib.Path]) -> str:
    if access := ACCESS.search(text):
        what = f"{what}: {access['access'].lower()} of {access['size']} bytes"
    for frame in FRAME.finditer(text):
        for folder in folders:
            library = folder / "build" / f"{frame['name']}.so"
            if library.is_file():
                (line,) = lines_of(library, folder, [int(frame["offset"], 16)])
                function, at, place = line.partition(" at ")
                return f"{place}: {what} in {function}" if at else f"{line}: {what}"
    return f"{what}, outside of the program's code"
