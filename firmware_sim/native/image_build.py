"""Compiles a folder of firmware for the chip: an image for an LPC2194 as ELF and Intel HEX, kept in its folder `build`.

The header's other side is `chip/`: start-up code, linker script, the calls over the registers, the schedule on a timer.
"""

import dataclasses
import pathlib
import re
import shutil
import tempfile
from collections.abc import Sequence

from ranger_sim.firmware_sim.native.build import (
    INCLUDE,
    Addition,
    compile_ours,
    errors_in,
    headers_in,
    message_of,
    run_compiler,
    state_of,
)
from ranger_sim.firmware_sim.native.manifest import Manifest
from ranger_sim.foundation.user_error import FirmwareError

CHIP = pathlib.Path(__file__).resolve().parent / "chip"
TOOLS = "arm-none-eabi-"
PACKAGE = "gcc-arm-none-eabi"  # Debian's and Ubuntu's
# LPC2194 user manual, memory map; the last 8 KB of flash hold the boot loader
FLASH_BYTES = 248 * 1024
RAM_BYTES = 16 * 1024

# ARM state: its instructions do more each, and the flash gives them as fast. No C library, no fused or fast
# mathematics: floats are the compiler's own library's, rounded as IEEE 754 says.
OPTIONS = (
    "-mcpu=arm7tdmi", "-marm", "-std=c99", "-ffreestanding", "-O2", "-g",
    "-flto", "-ffunction-sections", "-fdata-sections", "-ffp-contract=off", "-fno-fast-math",
    "-Wall", "-Wextra", "-Wno-missing-field-initializers",
    "-Werror=implicit-function-declaration", "-Werror=incompatible-pointer-types", "-Werror=int-conversion",
)  # fmt: skip
# Without it, the functions in support.c would be compiled to calls of themselves.
SUPPORT_OPTIONS = ("-fno-tree-loop-distribute-patterns", "-fno-lto")
LINKING = ("-nostdlib", "-Wl,--gc-sections", "-Wl,--no-warn-rwx-segments", "-Wl,--build-id=none")
SIZES = re.compile(r"^\s*(?P<text>\d+)\s+(?P<data>\d+)\s+(?P<bss>\d+)\s", re.MULTILINE)
TOO_LARGE = re.compile(r"region `(?P<region>flash|ram)' overflowed by (?P<bytes>\d+) bytes?")
NO_STACK = "leave less than 1024 bytes of RAM"


@dataclasses.dataclass(frozen=True)
class Image:
    """An image that is up to date, as ELF and as Intel HEX. Sizes in bytes; `ram_bytes` without the program's stack."""

    path: pathlib.Path
    hex_path: pathlib.Path
    flash_bytes: int
    ram_bytes: int
    warnings: tuple[str, ...] = ()
    was_made: bool = True


def tool(name: str) -> str:
    """A program of the cross compiler; UserError when it is not installed."""
    found = shutil.which(TOOLS + name)
    if found is None:
        raise FirmwareError(
            f"no {TOOLS}{name} is installed here; firmware for the chip needs it "
            f"(Debian, Ubuntu: apt install {PACKAGE})"
        )
    return found


def build_image(manifest: Manifest, addition: Addition | None = None) -> Image:
    """Compile unless it is up to date; UserError with a line for each error of the compiler."""
    addition = addition if addition is not None else Addition()
    if manifest.hardware is not None and manifest.hardware.can == "fd":
        raise FirmwareError(
            f"{manifest.folder}: hardware.can is 'fd', and an image is for an LPC2194, whose controllers are classic"
        )
    gcc, objcopy, size = tool("gcc"), tool("objcopy"), tool("size")
    options = [
        *OPTIONS,
        *manifest.options,
        *(f"-D{name}={value}" for name, value in manifest.defines),
        *(f"-I{folder}" for folder in (*manifest.include, *addition.include, INCLUDE)),
    ]
    folder = manifest.folder / "build"
    path = folder / f"{manifest.name}.elf"
    hex_path = path.with_suffix(".hex")
    stamp = folder / f"{manifest.name}-elf.stamp"
    sources = [*manifest.sources, *addition.sources]
    headers = headers_in((*manifest.include, *addition.include, INCLUDE))
    own = sorted(each for each in CHIP.iterdir() if each.suffix in (".c", ".h", ".S", ".ld"))
    state = state_of([gcc, *options], [*sources, *headers, *own])
    if path.is_file() and hex_path.is_file() and stamp.is_file() and stamp.read_text(encoding="utf-8") == state:
        return Image(path, hex_path, *_sizes(size, path), was_made=False)
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".making-", dir=folder) as making:
            place = pathlib.Path(making)
            warnings = _compile(gcc, options, sources, place, manifest)
            made, made_hex = place / "image.elf", place / "image.hex"
            code, text = run_compiler([objcopy, "-O", "ihex", str(made), str(made_hex)])
            if code:
                raise FirmwareError(f"{manifest.folder}: {objcopy} could not write Intel HEX:", *text[:20])
            stamp.unlink(missing_ok=True)
            made.replace(path)
            made_hex.replace(hex_path)
            stamp.write_text(state, encoding="utf-8")
    except OSError as error:
        raise FirmwareError(f"{error.filename or folder}: {error.strerror}: nothing can be built there") from None
    return Image(path, hex_path, *_sizes(size, path), warnings)


def _compile(
    gcc: str, options: Sequence[str], sources: Sequence[pathlib.Path], making: pathlib.Path, manifest: Manifest
) -> tuple[str, ...]:
    """Compile and link in the folder `making`; returns the warnings."""
    output: list[str] = []
    objects: list[str] = []
    headers = [*headers_in((INCLUDE,)), *sorted(CHIP.glob("*.h"))]
    for name, more in (("startup.S", ()), ("firmware.c", ()), ("scheduler.c", ()), ("support.c", SUPPORT_OPTIONS)):
        place = making / f"own-{name}.o"
        compile_ours([gcc, *OPTIONS, f"-I{INCLUDE}", *more], CHIP / name, headers, place)
        objects.append(str(place))
    failed = False
    for number, source in enumerate(sources):
        place = making / f"{number}-{source.stem}.o"
        code, text = run_compiler([gcc, *options, "-c", str(source), "-o", str(place)])
        objects.append(str(place))
        failed |= code != 0
        output += text
    if not failed:
        image = making / "image.elf"
        script = ["-T", str(CHIP / "lpc2194.ld")]
        code, text = run_compiler([gcc, *OPTIONS, *LINKING, *script, *objects, "-lgcc", "-o", str(image)])
        failed = code != 0
        output += text
    if failed:
        raise FirmwareError(*(_too_large(manifest, output) or errors_in(manifest, output)))
    return tuple(line for line in map(message_of, output) if line and " warning: " in line)


def _too_large(manifest: Manifest, output: Sequence[str]) -> list[str]:
    """The linker's message about a program that does not fit, in a line."""
    for line in output:
        found = TOO_LARGE.search(line)
        if found:
            size = FLASH_BYTES if found["region"] == "flash" else RAM_BYTES
            what = f"{found['bytes']} bytes too large for the chip's {found['region']} of {size} bytes"
            return [f"{manifest.folder}: {manifest.name} is {what}"]
        if NO_STACK in line:
            return [
                f"{manifest.folder}: {manifest.name}: the variables {NO_STACK} ({RAM_BYTES}) for the program's stack"
            ]
    return []


def _sizes(size: str, path: pathlib.Path) -> tuple[int, int]:
    """Bytes of flash and RAM that an image takes."""
    code, text = run_compiler([size, str(path)])
    found = SIZES.search("\n".join(text))
    if code or found is None:
        raise FirmwareError(f"{path}: {size} does not report its size")
    return int(found["text"]) + int(found["data"]), int(found["data"]) + int(found["bss"])
