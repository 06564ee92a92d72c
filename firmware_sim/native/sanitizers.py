"""Running a program with the compiler's sanitizers: the needs of their runtime, and their findings.

The runtime of the address sanitizer must be in a process before anything else, so a run with it is a separate process,
started with LD_PRELOAD. Findings go to files, and the run goes on.
"""

import collections
import contextlib
import ctypes
import dataclasses
import functools
import os
import pathlib
import re
import shutil
import subprocess
from collections.abc import Collection, Iterable

from ranger_sim.firmware_sim.native.compiler import compiler
from ranger_sim.firmware_sim.native.crash import lines_of
from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import FirmwareError

# Each place is reported once. Leaks are not checked: the program allocates nothing, Python does. crash.py reports
# programs that a signal ended.
OPTIONS = "detect_leaks=0:halt_on_error=0:handle_segv=0:handle_sigbus=0:handle_sigfpe=0:handle_abort=0:handle_sigill=0"
PLACE = "RANGER_SIM_FINDINGS"  # beginning of the files' names
UNDEFINED_RUNTIMES = ("libubsan.so.1", "libubsan.so.2")
UNDEFINED = re.compile(r"^(?P<file>[^\s:]+):(?P<line>\d+)(?::\d+)?: runtime error: (?P<text>.*)$", re.MULTILINE)
ADDRESS = re.compile(r"ERROR: AddressSanitizer: (?P<what>[\w-]+) on .*?(?=^=====|\Z)", re.DOTALL | re.MULTILINE)
ACCESS = re.compile(r"^(?P<access>READ|WRITE) of size (?P<size>\d+)", re.MULTILINE)
# of the library, or of the copy that was loaded: its name has eight characters behind it (library.py); the kernel adds
# that it is deleted
FRAME = re.compile(r"^\s*#\d+ .*/(?P<name>[^/]+)\.so(?: \(deleted\))?\+0x(?P<offset>[0-9a-f]+)\)", re.MULTILINE)
COPY = re.compile(r"-[^/-]{8}$")


def is_ready() -> bool:
    """True in a process that has the runtime of the address sanitizer."""
    systems.require_linux("sanitizers of firmware in C", "personality, prctl")
    return hasattr(ctypes.CDLL(None), "__asan_init")


def environment(logs: pathlib.Path) -> dict[str, str]:
    """Environment of a process that can run a program with sanitizers; findings go to files in the folder `logs`."""
    program = compiler()
    asked = subprocess.run([program, "-print-file-name=libasan.so"], capture_output=True, check=False, text=True)
    runtime = pathlib.Path(asked.stdout.strip())
    if not runtime.is_file():
        raise FirmwareError(f"{program} has no runtime of the address sanitizer (libasan.so): --sanitize needs it")
    place = str(logs / "findings")
    options = f"{OPTIONS}:log_path={place}"
    return {**os.environ, "LD_PRELOAD": str(runtime), "ASAN_OPTIONS": options, "UBSAN_OPTIONS": options, PLACE: place}


def lead_findings() -> None:
    """After a library was loaded: what its undefined-behaviour sanitizer finds goes to the same place.

    With the address sanitizer, that runtime does not read its own options.
    """
    place = os.environ.get(PLACE)
    if place is None:
        return
    os.environ.pop("LD_PRELOAD", None)  # it was for this process, not for those it starts
    for name in UNDEFINED_RUNTIMES:
        with contextlib.suppress(OSError):  # not loaded: nothing here was compiled with it
            runtime = ctypes.CDLL(name, mode=os.RTLD_NOW | os.RTLD_NOLOAD)
            runtime.__sanitizer_set_report_path(f"{place}-undefined".encode())


@dataclasses.dataclass(frozen=True)
class Finding:
    """One place at which something is wrong. `function`: empty where it is not known.

    count: how often it was reported; each process reports a place once, however often it runs through it.
    """

    file: str
    line: int
    function: str
    text: str
    count: int = 1

    def describe(self) -> str:
        """`hip.c:42: signed integer overflow: ... in control()`."""
        place = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        return f"{place}{self.text}{f' in {self.function}()' if self.function else ''}"


@dataclasses.dataclass(frozen=True)
class Program:
    """The program whose findings are wanted: a library, and the folder of its sources."""

    library: pathlib.Path
    folder: pathlib.Path


def place_of_findings() -> pathlib.Path | None:
    """The folder to which this process and those it forks write what is found; None without sanitizers."""
    place = os.environ.get(PLACE)
    return pathlib.Path(place).parent if place is not None else None


def findings(
    logs: pathlib.Path, programs: Iterable[Program], processes: Collection[int] | None = None
) -> list[Finding]:
    """What was found so far, by file and line; files relative to the firmware's folder.

    processes: only what was found in these.
    """
    programs = [dataclasses.replace(each, folder=each.folder.resolve()) for each in programs]
    found: list[Finding] = []
    for log in sorted(logs.glob("findings*")):
        if processes is not None and log.suffix not in {f".{process}" for process in processes}:
            continue
        text = log.read_text(encoding="utf-8", errors="replace")
        found += [_undefined(each, programs) for each in UNDEFINED.finditer(text)]
        found += [_address(each[0], each["what"], programs) for each in ADDRESS.finditer(text)]
    times = collections.Counter(found)
    order = sorted(times, key=lambda each: (each.file, each.line, each.text))
    return [dataclasses.replace(each, count=times[each]) for each in order]


def _undefined(found: re.Match[str], programs: list[Program]) -> Finding:
    path, line = pathlib.Path(found["file"]).resolve(), int(found["line"])
    text = re.sub(r"address 0x[0-9a-f]+", "an address", found["text"])  # another one in every run
    for program in programs:
        if path.is_relative_to(program.folder):
            function = _function_at(program.library, path, line)
            return Finding(str(path.relative_to(program.folder)), line, function, text)
    return Finding(path.name, line, "", text)


def _address(text: str, what: str, programs: list[Program]) -> Finding:
    if access := ACCESS.search(text):
        what = f"{what}: {access['access'].lower()} of {access['size']} bytes"
    for frame in FRAME.finditer(text):
        for program in programs:
            if program.library.stem in (frame["name"], COPY.sub("", frame["name"])) and program.library.is_file():
                (line_text,) = lines_of(program.library, program.folder, [int(frame["offset"], 16)])
                function, at, place = line_text.partition("() at ")
                file, _, line = place.rpartition(":")
                return (
                    Finding(file, int(line), function, what)
                    if at and line.isdecimal()
                    else Finding(line_text, 0, "", what)
                )
    return Finding("", 0, "", f"{what}, outside of the program's code")


@functools.cache
def _functions(library: pathlib.Path) -> tuple[tuple[str, int, str], ...]:
    """(file, first line, name) of every function of a library, by nm of the binutils; none without nm."""
    program = shutil.which("nm")
    if program is None or not library.is_file():
        return ()
    done = subprocess.run([program, "-l", "--defined-only", str(library)], capture_output=True, check=False, text=True)
    found = []
    for row in done.stdout.splitlines():
        symbol, _, place = row.partition("\t")
        file, _, line = place.rpartition(":")
        words = symbol.split()
        if len(words) == 3 and words[1] in "tT" and line.isdecimal():
            found.append((file, int(line), words[2]))
    return tuple(sorted(found))


def _function_at(library: pathlib.Path, path: pathlib.Path, line: int) -> str:
    """The function that begins last before a line of a file."""
    before = [
        name for file, first, name in _functions(library) if pathlib.Path(file).resolve() == path and first <= line
    ]
    return before[-1] if before else ""
