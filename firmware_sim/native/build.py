"""Compiles a folder of firmware for this computer: one library, kept in its folder `build`."""

import dataclasses
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence

from ranger_sim.firmware_sim.native.compiler import compiler
from ranger_sim.firmware_sim.native.manifest import Manifest
from ranger_sim.firmware_sim.native.trial import tried
from ranger_sim.foundation.user_error import FirmwareError

HERE = pathlib.Path(__file__).resolve().parent
INCLUDE = HERE / "include"
RUNTIME = HERE / "runtime" / "runtime.c"
LONGEST_S = 600.0  # a compiler that takes longer than this hangs
WORD_BITS = sys.maxsize.bit_length() + 1  # of pointers, and of long in the data models of Unix

# -std=c99: as for the chip's compiler. No fused multiply-add and no fast mathematics, so that floats have the same
# results as on the chip and in the emulated boards. Fields left out of a structure are 0, as firmware.h says.
OPTIONS = (
    "-std=c99", "-O2", "-g", "-fPIC", "-fno-omit-frame-pointer", "-ffp-contract=off", "-fno-fast-math",
    "-Wall", "-Wextra", "-Wno-missing-field-initializers",
    "-Werror=implicit-function-declaration", "-Werror=incompatible-pointer-types", "-Werror=int-conversion",
    f"-DFW_LONG_BITS={WORD_BITS}", f"-DFW_POINTER_BITS={WORD_BITS}",
)  # fmt: skip
# The library's own functions come first, whatever else is loaded; missing ones are reported at linking, not at loading.
LINKING = ("-shared", "-Wl,-Bsymbolic", "-Wl,--no-undefined")
# A call of these ends the process as a failure that reports the place of the call (runtime.c).
ENDING = ("exit", "_exit", "_Exit", "quick_exit")
# -O1 and functions kept as written keep lines and variables true; findings are reported, and the program goes on.
SANITIZING = (
    "-O1",
    "-fno-inline",
    "-fsanitize=address,undefined",
    "-fsanitize-recover=address,undefined",
    "-fno-sanitize=vptr",
)
COVERING = ("-O0", "--coverage")
# Objects of our own sources by command, source and state: four fifths of a small firmware's compilation, and the same
# for every firmware that this process builds.
_OURS: dict[tuple[str, ...], bytes] = {}

MESSAGE = re.compile(
    r"^(?P<file>[^:\s][^:]*):(?P<line>\d+)(?::\d+)?: (?P<kind>fatal error|error|warning): (?P<text>.*)$"
)
UNDEFINED = re.compile(r"(?P<place>[^\s:]+\.c:\d+): undefined reference to `(?P<name>[^']+)'")


@dataclasses.dataclass(frozen=True)
class Built:
    """An up-to-date library. `warnings` of the compiler, a line each; none when nothing had to be compiled."""

    path: pathlib.Path
    warnings: tuple[str, ...] = ()
    was_made: bool = True


@dataclasses.dataclass(frozen=True)
class Addition:
    """What the caller adds to the compilation: folders of headers, sources."""

    include: tuple[pathlib.Path, ...] = ()
    sources: tuple[pathlib.Path, ...] = ()


def build(
    manifest: Manifest, sanitize: bool = False, coverage: bool = False, addition: Addition | None = None
) -> Built:
    """Compile unless up to date; UserError with a line for each error of the compiler.

    sanitize: report out-of-bounds accesses and undefined behaviour at run time. coverage: count the lines that ran.
    """
    addition = addition if addition is not None else Addition()
    program = compiler()
    sources = [*manifest.sources, *addition.sources]
    watching = [*(SANITIZING if sanitize else ()), *(COVERING if coverage else ())]
    options = [
        *OPTIONS,
        *watching,
        *manifest.options,
        *(f"-D{name}={value}" for name, value in manifest.defines),
        *(f"-I{folder}" for folder in (*manifest.include, *addition.include, INCLUDE)),
    ]
    kind = f"{'-sanitize' if sanitize else ''}{'-coverage' if coverage else ''}"
    folder = manifest.folder / "build"
    path = folder / f"{manifest.name}{kind}.so"
    stamp = path.with_suffix(".stamp")
    state = state_of(
        [program, *options], [*sources, RUNTIME, *headers_in((*manifest.include, *addition.include, INCLUDE))]
    )
    if path.is_file() and stamp.is_file() and stamp.read_text(encoding="utf-8") == state:
        return Built(path, was_made=False)
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".making-", dir=folder) as making:
            warnings = _compile(program, options, watching, sources, pathlib.Path(making), manifest)
            made = pathlib.Path(making) / "library.so"
            tried(f"{path}", path, manifest.folder, made=made)
            stamp.unlink(missing_ok=True)
            made.replace(path)
            if coverage:
                _keep_notes(pathlib.Path(making), path.with_suffix(".notes"))
            stamp.write_text(state, encoding="utf-8")
    except OSError as error:
        raise FirmwareError(f"{error.filename or folder}: {error.strerror}: nothing can be built there") from None
    return Built(path, warnings)


def _keep_notes(making: pathlib.Path, place: pathlib.Path) -> None:
    """Keep the compiler's notes on its counts, for the reader of the counts (coverage.py)."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    for note in making.glob("*.gcno"):
        note.replace(place / note.name)


def _compile(
    program: str,
    options: Sequence[str],
    watching: Sequence[str],
    sources: Sequence[pathlib.Path],
    making: pathlib.Path,
    manifest: Manifest,
) -> tuple[str, ...]:
    """Compile and link in the folder `making`; returns the warnings. The runtime itself is not instrumented."""
    output: list[str] = []
    objects = [str(making / "runtime.o")]
    counting = ["-DFW_COVERAGE"] if "--coverage" in watching else []
    compile_ours([program, *OPTIONS, *counting, f"-I{INCLUDE}"], RUNTIME, headers_in((INCLUDE,)), making / "runtime.o")
    failed = False
    for number, source in enumerate(sources):
        place = making / f"{number}-{source.stem}.o"
        code, text = run_compiler([program, *options, "-c", str(source), "-o", str(place)])
        objects.append(str(place))
        failed |= code != 0
        output += text
    if not failed:
        wrapped = [f"-Wl,--wrap={name}" for name in ENDING]
        code, text = run_compiler(
            [program, *watching, *objects, *LINKING, *wrapped, "-lm", "-o", str(making / "library.so")]
        )
        failed = code != 0
        output += text
    if failed:
        raise FirmwareError(*errors_in(manifest, output))
    return tuple(line for line in map(message_of, output) if line and " warning: " in line)


def compile_ours(
    command: Sequence[str], source: pathlib.Path, headers: Sequence[pathlib.Path], place: pathlib.Path
) -> None:
    """Compile a source of this package to `place`, or write there what this process has compiled of it before."""
    key = (*command, state_of((), [source, *headers]))
    if key in _OURS:
        place.write_bytes(_OURS[key])
        return
    code, text = run_compiler([*command, "-c", str(source), "-o", str(place)])
    if code:
        raise FirmwareError(f"{source} does not compile with {command[0]}:", *text[:20])
    _OURS[key] = place.read_bytes()


def run_compiler(command: list[str]) -> tuple[int, list[str]]:
    """Exit code and output lines of a compiler, in English."""
    setting = {**os.environ, "LC_ALL": "C"}
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=LONGEST_S, env=setting)
    except subprocess.TimeoutExpired:
        raise FirmwareError(f"{command[0]}: has not finished after {LONGEST_S:g} s") from None
    return done.returncode, (done.stderr + done.stdout).decode(errors="replace").splitlines()


def message_of(line: str) -> str | None:
    """A compiler's line in our format; None for lines that only explain."""
    found = MESSAGE.match(line)
    return f"{found['file']}:{found['line']}: {found['kind']}: {found['text']}" if found else None


def errors_in(manifest: Manifest, output: list[str]) -> list[str]:
    """The errors: the compiler's, or the linker's missing names, or, where neither format matches, the whole output."""
    errors = [line for line in map(message_of, output) if line and "error: " in line]
    for line in output:
        found = UNDEFINED.search(line)
        if found:
            errors.append(f"{found['place']}: error: {found['name']} is used, but no source defines it")
    errors = list(dict.fromkeys(errors)) or output[:20] or ["the compiler failed without a message"]
    return [f"{manifest.folder}: {manifest.name} does not compile:", *errors]


def headers_in(folders: Sequence[pathlib.Path]) -> list[pathlib.Path]:
    return sorted({path for folder in folders for path in folder.rglob("*.h")})


def state_of(words: Sequence[str], files: Sequence[pathlib.Path]) -> str:
    """A digest of everything that the library depends on."""
    digest = hashlib.blake2b(digest_size=16)
    for word in words:
        digest.update(word.encode() + b"\0")
    for path in files:
        digest.update(str(path).encode() + b"\0" + hashlib.blake2b(path.read_bytes()).digest())
    return digest.hexdigest() + "\n"
