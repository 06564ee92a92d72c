"""Firmware images: what a linker or a programmer's file puts into flash and RAM, and the names of its addresses.

ELF (also Keil's .axf) and Intel HEX. The file's first bytes say which.
"""

import bisect
import dataclasses
import io
import os
import pathlib
import re
from typing import Any

from ranger_sim.foundation.user_error import FirmwareError

# LPC2194 user manual, memory map
FLASH = (0x00000000, 0x40000)
RAM = (0x40000000, 0x4000)
LARGEST_FILE = 256 << 20  # bytes; debug information of a program for 16 KB of RAM takes a few megabytes. Chosen by us

# Addenda to the ABI for the Arm architecture 2023Q3, 3.3.5.2: Tag_CPU_arch, from 0 on
ARCHITECTURES = (
    "before ARMv4", "ARMv4", "ARMv4T", "ARMv5T", "ARMv5TE", "ARMv5TEJ", "ARMv6", "ARMv6KZ", "ARMv6T2", "ARMv6K",
    "ARMv7", "ARMv6-M", "ARMv6S-M", "ARMv7E-M", "ARMv8-A", "ARMv8-R", "ARMv8-M baseline", "ARMv8-M mainline",
)  # fmt: skip
ARMV4T = 2
PROFILES = {"A": "-A", "R": "-R", "M": "-M"}  # Tag_CPU_arch_profile, of ARMv7

HEX_DATA, HEX_END, HEX_SEGMENT, HEX_SEGMENT_START, HEX_LINEAR, HEX_LINEAR_START = range(6)
# record type -> (what its bytes mean, how many they are)
HEX_FIXED = {HEX_END: 0, HEX_SEGMENT: 2, HEX_SEGMENT_START: 4, HEX_LINEAR: 2, HEX_LINEAR_START: 4}


@dataclasses.dataclass(frozen=True)
class Symbol:
    """A name of the program: address, size in bytes (0: unknown)."""

    address: int
    size: int
    name: str


@dataclasses.dataclass(frozen=True)
class Image:
    """A program as it is in memory before reset. `segments`: (address, bytes), sorted, none over another.

    `symbols`, sorted by address, are empty where the file has none (HEX).
    """

    path: pathlib.Path
    segments: tuple[tuple[int, bytes], ...]
    symbols: tuple[Symbol, ...] = ()

    def place_of(self, address: int) -> str:
        """`name+0x10` of the function or variable that holds an address; empty when the file names none before it."""
        found = bisect.bisect_right([each.address for each in self.symbols], address)
        if not found:
            return ""
        symbol = self.symbols[found - 1]
        behind = address - symbol.address
        if symbol.size and behind >= symbol.size and behind > 0x1000:
            return ""
        return f"{symbol.name}+{behind:#x}" if behind else symbol.name

    def address_of(self, name: str) -> int:
        """Where a symbol is. UserError when the file does not have it."""
        for symbol in self.symbols:
            if symbol.name == name:
                return symbol.address
        raise FirmwareError(f"{self.path}: there is no symbol {name!r}")


def read(path: str | os.PathLike) -> Image:
    """The image in a file. UserError, one line, for a file that is not an image for this chip."""
    path = pathlib.Path(path)
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise FirmwareError(f"{path}: the file has {size} bytes, at most {LARGEST_FILE} are read")
        content = path.read_bytes()
    except OSError as error:
        raise FirmwareError(f"{path}: {error.strerror or error}") from None
    if not content:
        raise FirmwareError(f"{path}: the file is empty")
    if content.startswith(b"\x7fELF"):
        image = _from_elf(path, content)
    elif content.lstrip().startswith(b":"):
        image = _from_hex(path, content)
    else:
        raise FirmwareError(f"{path}: {_other_kind(path, content)}")
    if not image.segments:
        raise FirmwareError(f"{path}: it has no data for flash or RAM")
    first = image.segments[0][0]
    if first >= RAM[0]:
        raise FirmwareError(
            f"{path}: linked into RAM ({first:#010x}), where a debugger loads it; the processor starts in flash, at "
            f"{FLASH[0]:#010x}: link it for that"
        )
    return image


def _other_kind(path: pathlib.Path, content: bytes) -> str:
    """Description of a file that is neither ELF nor HEX, and how to convert it."""
    target = path.with_suffix(".hex").name
    if re.match(rb"\s*S[0-9][0-9A-Fa-f]{2}", content):
        return f"Motorola S-records, not ELF or Intel HEX: arm-none-eabi-objcopy -I srec -O ihex {path.name} {target}"
    return (
        f"neither an ELF file nor Intel HEX: it begins with {content[:4]!r}. A plain binary does not say where it "
        f"belongs; one for the beginning of the flash: arm-none-eabi-objcopy -I binary -O ihex {path.name} {target}"
    )


def _checked(path: pathlib.Path, pieces: list[tuple[int, bytes]]) -> tuple[tuple[int, bytes], ...]:
    """The pieces sorted and joined; UserError for one outside memory or over another."""
    joined: list[tuple[int, bytes]] = []
    for address, content in sorted(pieces):
        end = address + len(content)
        if not any(base <= address and end <= base + size for base, size in (FLASH, RAM)):
            raise FirmwareError(
                f"{path}: {len(content)} bytes at {address:#010x} are outside the chip's flash "
                f"({FLASH[0]:#010x}, {FLASH[1]} bytes) and RAM ({RAM[0]:#010x}, {RAM[1]} bytes)"
            )
        if joined and address < joined[-1][0] + len(joined[-1][1]):
            raise FirmwareError(f"{path}: two segments overlap at {address:#010x}")
        if joined and address == joined[-1][0] + len(joined[-1][1]):
            joined[-1] = (joined[-1][0], joined[-1][1] + content)
        else:
            joined.append((address, content))
    return tuple(joined)


def _from_elf(path: pathlib.Path, content: bytes) -> Image:
    """Segments are loaded where their physical address says: initialised data lie in flash behind the code."""
    from elftools.elf import elffile  # only here: files of Intel HEX need none of it

    try:
        elf = elffile.ELFFile(io.BytesIO(content))
        machine = elf["e_machine"]
        if elf.elfclass != 32 or not elf.little_endian or machine != "EM_ARM":
            order = "little" if elf.little_endian else "big"
            machine = machine if isinstance(machine, str) else f"machine {machine}"
            raise FirmwareError(
                f"{path}: an ELF file for {elf.elfclass} bit, {order}-endian {machine.removeprefix('EM_')}; "
                "the LPC2194 is a 32 bit, little-endian ARM"
            )
        if elf["e_shoff"] + elf["e_shnum"] * elf["e_shentsize"] > len(content):
            raise FirmwareError(
                f"{path}: truncated: the file has {len(content)} bytes, its section table ends beyond them"
            )
        for number, section in enumerate(elf.iter_sections()):
            end = section["sh_offset"] + section["sh_size"]
            if section["sh_type"] != "SHT_NOBITS" and end > len(content):
                raise FirmwareError(
                    f"{path}: truncated: section {number} of {section['sh_size']} bytes ends at byte {end}, the file "
                    f"has {len(content)}"
                )
        if built_for := _newer_architecture(elf):
            raise FirmwareError(
                f"{path}: built for {built_for}, by its build attributes; the LPC2194 is an ARM7TDMI-S, "
                f"{ARCHITECTURES[ARMV4T]} (-mcpu=arm7tdmi)"
            )
        if elf["e_type"] != "ET_EXEC":
            raise FirmwareError(f"{path}: an ELF file that is not linked into an image ({elf['e_type']}, not ET_EXEC)")
        pieces = []
        for segment in elf.iter_segments("PT_LOAD"):
            start, size = segment["p_offset"], segment["p_filesz"]
            if start + size > len(content):
                raise FirmwareError(
                    f"{path}: truncated: a segment of {size} bytes begins at byte {start}, the file has {len(content)}"
                )
            in_memory, address = segment["p_memsz"], segment["p_vaddr"]
            if not any(base <= address and address + in_memory <= base + length for base, length in (FLASH, RAM)):
                raise FirmwareError(
                    f"{path}: a segment takes {in_memory} bytes at {address:#010x}, outside the chip's flash "
                    f"({FLASH[0]:#010x}, {FLASH[1]} bytes) and RAM ({RAM[0]:#010x}, {RAM[1]} bytes)"
                )
            if size:
                pieces.append((segment["p_paddr"], content[start : start + size]))
        symbols = _symbols(elf)
    except FirmwareError:
        raise
    except Exception as error:  # noqa: BLE001  (of a damaged file the library raises exceptions of any kind)
        reason = str(error) or type(error).__name__
        raise FirmwareError(f"{path}: a damaged or truncated ELF file: {reason}") from None
    return Image(path, _checked(path, pieces), symbols)


def _newer_architecture(elf: Any) -> str:
    """The requirements of an ELFFile's build attributes beyond ARMv4T; empty for none, or without attributes."""
    from elftools.elf.sections import ARMAttributesSection  # only here: a walk without images does without

    found: dict[str, Any] = {}
    for section in elf.iter_sections():
        if isinstance(section, ARMAttributesSection):
            for part in section.iter_subsections():
                for of_file in part.iter_subsubsections("TAG_FILE"):
                    found |= {each.tag: each.value for each in of_file.iter_attributes()}
    number = found.get("TAG_CPU_ARCH", 0)
    if number <= ARMV4T:
        return ""
    name = ARCHITECTURES[number] if number < len(ARCHITECTURES) else f"a newer ARM (Tag_CPU_arch {number})"
    profile = found.get("TAG_CPU_ARCH_PROFILE", 0)
    if name == "ARMv7":
        name += PROFILES.get(chr(profile), "")
    processor = found.get("TAG_CPU_NAME", "")
    # gas repeats the architecture's name where no processor is given: "7-M" of ARMv7-M
    return f"{name} ({processor})" if processor and not name.endswith(processor) else name


def _symbols(elf: Any) -> tuple[Symbol, ...]:
    """Functions and variables of an ELFFile, without the mapping symbols ($a, $t, $d) and sections' own."""
    from elftools.elf.sections import SymbolTableSection

    found = []
    for section in elf.iter_sections():
        if not isinstance(section, SymbolTableSection):
            continue
        for symbol in section.iter_symbols():
            kind = symbol["st_info"]["type"]
            named = symbol.name and not symbol.name.startswith("$") and isinstance(symbol["st_shndx"], int)
            if named and kind in ("STT_FUNC", "STT_OBJECT", "STT_NOTYPE"):
                address = symbol["st_value"] & ~1 if kind == "STT_FUNC" else symbol["st_value"]  # bit 0: Thumb
                found.append(Symbol(address, symbol["st_size"], symbol.name))
    return tuple(sorted(found, key=lambda each: (each.address, each.size, each.name)))


def _from_hex(path: pathlib.Path, content: bytes) -> Image:
    """Intel HEX: data records, with the upper half of their addresses in separate records."""
    pieces: list[tuple[int, bytes]] = []
    upper = 0
    ended = False
    for number, line in enumerate(content.splitlines(), start=1):
        line = line.strip()
        if not line:
            continue
        where = f"{path}:{number}"
        if ended:
            raise FirmwareError(f"{where}: more lines after the end record")
        try:
            record = bytes.fromhex(line[1:].decode("ascii")) if line.startswith(b":") else b""
        except (ValueError, UnicodeDecodeError):
            record = b""
        if len(record) < 5 or len(record) != record[0] + 5:
            raise FirmwareError(f"{where}: not a complete record of Intel HEX")
        if sum(record) & 0xFF:
            right = -sum(record[:-1]) & 0xFF
            raise FirmwareError(
                f"{where}: checksum {record[-1]:#04x} is wrong: the record's bytes ask for {right:#04x}"
            )
        offset, kind, data = record[1] << 8 | record[2], record[3], record[4:-1]
        if kind in HEX_FIXED and len(data) != HEX_FIXED[kind]:
            raise FirmwareError(f"{where}: a record of type {kind} has {HEX_FIXED[kind]} bytes, this one {len(data)}")
        if kind == HEX_DATA:
            if data:
                pieces.append((upper + offset, data))
        elif kind == HEX_END:
            ended = True
        elif kind == HEX_SEGMENT:
            upper = int.from_bytes(data, "big") << 4
        elif kind == HEX_LINEAR:
            upper = int.from_bytes(data, "big") << 16
        elif kind not in HEX_FIXED:
            raise FirmwareError(f"{where}: record type {kind} is none of Intel HEX (0 ... 5)")
    if not ended:
        raise FirmwareError(f"{path}: truncated: there is no end record")
    return Image(path, _checked(path, pieces))
