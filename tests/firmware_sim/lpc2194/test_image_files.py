"""Image files: what is read out of ELF and Intel HEX, and one line for each that is none for this chip."""

import shutil
import struct
import subprocess

import pytest

from ranger_sim.firmware_sim.lpc2194.image import read
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.lpc2194.programs import content

LITTLE, BIG = 1, 2
ARM, X86 = 40, 62
CODE = bytes(range(16))


def elf(segments=((0x100, 0x100, CODE),), machine=ARM, wide=1, order=LITTLE, kind=2, names=()):
    """An ELF file by the standard's tables: header, program headers (virtual, physical address, bytes), symbols."""
    e = "<" if order == LITTLE else ">"
    head, entry = 52, 32
    place = head + entry * len(segments)
    programs, body = b"", b""
    for virtual, physical, piece in segments:
        programs += struct.pack(e + "8I", 1, place + len(body), virtual, physical, len(piece), len(piece), 5, 4)
        body += piece
    text = b"\0" + b"".join(name.encode() + b"\0" for name, *_ in names)
    symbols = bytes(16)
    at = 1
    for name, address, size, what in names:
        symbols += struct.pack(e + "3IBBH", at, address, size, 0x10 | what, 0, 1)
        at += len(name) + 1
    sections = bytes(40)
    base = place + len(body)
    sections += struct.pack(e + "10I", 0, 2, 0, 0, base, len(symbols), 2, 1, 4, 16)
    sections += struct.pack(e + "10I", 0, 3, 0, 0, base + len(symbols), len(text), 0, 0, 1, 0)
    table = base + len(symbols) + len(text)
    ident = b"\x7fELF" + bytes([wide, order, 1]) + bytes(9)
    header = ident + struct.pack(
        e + "HHIIIIIHHHHHH", kind, machine, 1, 0x100, head, table, 0, head, entry, len(segments), 40, 3, 2
    )
    return header + programs + body + symbols + text + sections


def record(kind, address, data):
    whole = bytes([len(data), address >> 8, address & 255, kind]) + data
    return ":" + (whole + bytes([-sum(whole) & 255])).hex().upper() + "\n"


END = record(1, 0, b"")


def changed(place, word):
    """The ELF file above with another word at a byte."""
    data = bytearray(elf())
    data[place : place + 4] = struct.pack("<I", word)
    return bytes(data)


def written(folder, data, name="program"):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


needs_cross_compiler = pytest.mark.skipif(
    shutil.which("arm-none-eabi-gcc") is None, reason="no cross compiler (apt-get install gcc-arm-none-eabi)"
)


def linked(folder, processor):
    """A program of a loop, linked for a processor."""
    source, path = written(folder, "void start(void) { for (;;) ; }\n", "loop.c"), folder / "loop.elf"
    command = ["arm-none-eabi-gcc", f"-mcpu={processor}", "-nostdlib", "-Wl,-Ttext=0,-estart", source, "-o", path]
    subprocess.run(command, check=True)
    return path


def test_an_elf_file_is_loaded_where_its_segments_are_stored_not_where_they_run(tmp_path):
    data = elf(((0x0, 0x0, CODE), (0x40000000, 0x40, b"ABCD")))
    image = read(written(tmp_path, data))
    assert image.segments == ((0x0, CODE), (0x40, b"ABCD"))


def test_names_of_addresses_are_shown_with_the_distance_to_them(tmp_path):
    names = [("main", 0x101, 8, 2), ("$a", 0x100, 0, 0), ("count", 0x40000010, 4, 1), ("tail", 0x108, 8, 2)]
    image = read(written(tmp_path, elf(names=names)))
    assert image.place_of(0x100) == "main"  # bit 0 only says Thumb
    assert image.place_of(0x104) == "main+0x4"
    assert image.place_of(0x10C) == "tail+0x4"
    assert image.place_of(0xFF) == ""
    assert image.place_of(0x9000) == ""  # far behind the last function
    assert image.address_of("count") == 0x40000010
    with pytest.raises(UserError, match="no symbol 'nowhere'"):
        image.address_of("nowhere")


def test_intel_hex_is_read_record_by_record(tmp_path):
    text = record(4, 0, b"\x00\x00") + record(0, 0x10, CODE) + record(0, 0x20, b"more")
    text += record(2, 0, b"\x10\x00") + record(0, 0, b"seg") + record(4, 0, b"\x40\x00") + record(0, 4, b"ram!")
    image = read(written(tmp_path, text + record(5, 0, bytes(4)) + END))
    assert image.segments == ((0x10, CODE + b"more"), (0x10000, b"seg"), (0x40000004, b"ram!"))


def test_words_of_a_program_in_an_elf_file_are_in_the_processors_memory(tmp_path):
    from ranger_sim.firmware_sim.lpc2194.board import ImageBoard

    words = [0xE3A00001, 0xEAFFFFFE]  # mov r0, #1; b .
    board = ImageBoard("BOARD", read(written(tmp_path, elf(((0, 0, content(words)),)))))
    board.advance(10_000)
    assert board.core.r[0] == 1
    assert board.core.pc == 4


WRONG = {
    "empty": (b"", "the file is empty"),
    "text": (b"hello", "neither an ELF file nor Intel HEX: it begins with b'hell'"),
    "wide": (elf(wide=2), "damaged or truncated ELF file|an ELF file for 64 bit"),
    "big": (elf(order=BIG), "an ELF file for 32 bit, big-endian ARM; the LPC2194 is a 32 bit, little-endian ARM"),
    "x86": (elf(machine=X86), "an ELF file for 32 bit, little-endian X86_64; the LPC2194 is"),
    "object": (elf(kind=1), "an ELF file that is not linked into an image"),
    "cut": (elf()[:100], "damaged or truncated ELF file|truncated: "),
    "no sections": (elf()[:-60], "damaged or truncated ELF file|truncated: "),
    "header only": (elf()[:20], "damaged or truncated ELF file"),
    "high": (elf(((0, 0x00080000, CODE),)), "16 bytes at 0x00080000 are outside the chip's flash"),
    "edge": (elf(((0, 0x0003FFF8, CODE),)), "16 bytes at 0x0003fff8 are outside the chip's flash"),
    "twice": (elf(((0, 0x100, CODE), (0, 0x108, CODE))), "two segments overlap at 0x00000108"),
    "nothing": (elf(()), "it has no data for flash or RAM"),
    "segment in memory": (changed(72, 0xFFFFFFFF), "a segment takes 4294967295 bytes at 0x00000100, outside"),
    "segment in the file": (changed(68, 0xFFFFFFFF), "truncated: a segment of 4294967295 bytes"),
    "symbols": (changed(len(elf()) - 60, 0xFFFFFFF0), "truncated: section 1 of 4294967280 bytes ends at byte"),
    "no size of a symbol": (changed(len(elf()) - 44, 0), "damaged or truncated ELF file"),
    "checksum": (":0400000001020304F3\n" + END, r"program:1: checksum 0xf3 is wrong: the record's bytes ask for 0xf2"),
    "short": (":0400000001020304\n" + END, "program:1: not a complete record"),
    "letters": (":04000000010203ZZF2\n" + END, "program:1: not a complete record"),
    "no end": (record(0, 0, CODE), "truncated: there is no end record"),
    "behind": (END + record(0, 0, CODE), "program:2: more lines after the end record"),
    "kind": (record(7, 0, CODE) + END, r"program:1: record type 7 is none of Intel HEX"),
    "long address": (record(4, 0, b"\x00\x00\x00") + END, "program:1: a record of type 4 has 2 bytes, this one 3"),
    "S-records": (
        "S00600004844521B\nS1130000000102030405060708090A0B0C0D0E0F74\n",
        "Motorola S-records, .*: arm-none-eabi-objcopy -I srec -O ihex program program.hex$",
    ),
    "a plain binary": (CODE, "begins with .*: arm-none-eabi-objcopy -I binary -O ihex program program.hex$"),
    "in RAM": (elf(((0x40000000, 0x40000000, CODE),)), r"linked into RAM \(0x40000000\), where a debugger loads it"),
    "HEX in RAM": (record(4, 0, b"\x40\x00") + record(0, 4, b"ram!") + END, r"linked into RAM \(0x40000004\)"),
    "only an end": (END, "it has no data for flash or RAM"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_is_not_an_image_is_reported_in_one_line(tmp_path, name):
    data, message = WRONG[name]
    path = written(tmp_path, data)
    with pytest.raises(UserError, match=message) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))


NAMES = {
    "cortex-m3": "ARMv7-M",
    "cortex-m0": "ARMv6S-M",
    "cortex-m4": "ARMv7E-M",
    "cortex-a9": "ARMv7-A",
    "arm926ej-s": "ARMv5TEJ",
}


@needs_cross_compiler
@pytest.mark.parametrize("processor", NAMES)
def test_an_image_for_a_newer_arm_is_refused_by_its_build_attributes(tmp_path, processor):
    path = linked(tmp_path, processor)
    with pytest.raises(UserError) as caught:
        read(path)
    assert str(caught.value) == (
        f"{path}: built for {NAMES[processor]}, by its build attributes; the LPC2194 is an ARM7TDMI-S, ARMv4T "
        "(-mcpu=arm7tdmi)"
    )


@needs_cross_compiler
@pytest.mark.parametrize("processor", ["arm7tdmi", "arm7tdmi-s", "arm8"])
def test_an_image_for_this_arm_or_an_older_one_is_read(tmp_path, processor):
    assert read(linked(tmp_path, processor)).address_of("start") == 0


@needs_cross_compiler
@pytest.mark.parametrize(("kind", "option"), [("srec", "srec"), ("bin", "binary")])
def test_the_line_for_another_format_makes_the_image_of_it(tmp_path, kind, option):
    elf_file = linked(tmp_path, "arm7tdmi")
    other = tmp_path / f"program.{kind}"
    subprocess.run(["arm-none-eabi-objcopy", "-O", option, elf_file, other], check=True)
    with pytest.raises(UserError) as caught:
        read(other)
    subprocess.run(str(caught.value).rpartition(": ")[2].split(), cwd=tmp_path, check=True)
    assert read(tmp_path / "program.hex").segments == read(elf_file).segments


def test_a_file_cut_anywhere_is_reported_in_one_line(tmp_path):
    whole = elf(names=[("main", 0x100, 8, 2)])
    for length in range(0, len(whole), 3):
        with pytest.raises(UserError) as caught:
            read(written(tmp_path, whole[:length]))
        assert "\n" not in str(caught.value), length
