"""Firmware in C for the chip: what is linked, how it lies in memory, and what is reported when it cannot be built."""

import pathlib
import re
import shutil
import struct

import pytest

from ranger_sim.firmware_sim.lpc2194 import image as image_file
from ranger_sim.firmware_sim.native import image_build
from ranger_sim.firmware_sim.native.image_build import FLASH_BYTES, RAM_BYTES, build_image
from ranger_sim.firmware_sim.native.manifest import load
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.native.support import EXAMPLE, SCHEDULE, START, TIMER, folder_with

CROSS_COMPILER = shutil.which("arm-none-eabi-gcc")
needs_cross_compiler = pytest.mark.skipif(not CROSS_COMPILER, reason="no arm-none-eabi-gcc here")


def lines(folder):
    with pytest.raises(UserError) as mistake:
        build_image(load(folder))
    return str(mistake.value).splitlines()


def bytes_of_hex(path):
    """{address: byte} of an Intel HEX file; its checksums are right."""
    content, upper = {}, 0
    for line in path.read_text(encoding="ascii").splitlines():
        record = bytes.fromhex(line[1:])
        assert sum(record) & 0xFF == 0
        offset, kind, data = record[1] << 8 | record[2], record[3], record[4:-1]
        if kind == 0:
            content |= {upper + offset + place: byte for place, byte in enumerate(data)}
        elif kind == 4:
            upper = int.from_bytes(data, "big") << 16
    return content


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    folder = tmp_path_factory.mktemp("firmware") / "example"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("build"))
    return folder


@needs_cross_compiler
def test_the_vectors_are_at_0_and_sum_up_to_0_as_the_boot_loader_asks(example):
    image = build_image(load(example))
    assert image.warnings == ()
    content = bytes_of_hex(image.hex_path)
    words = struct.unpack("<16I", bytes(content[address] for address in range(64)))
    assert sum(words[:8]) & 0xFFFFFFFF == 0
    # each but the sixth loads pc from 32 bytes behind itself: the addresses stand there, in flash, on words
    assert all(word == 0xE59FF018 for place, word in enumerate(words[:8]) if place != 5)
    addresses = [word for place, word in enumerate(words[8:]) if place != 5]
    assert len(set(addresses)) == 7 and all(64 <= each < image.flash_bytes and each % 4 == 0 for each in addresses)
    assert max(content) < image.flash_bytes + 16 <= FLASH_BYTES and image.ram_bytes < RAM_BYTES


@needs_cross_compiler
def test_a_debugger_finds_the_start_of_the_program_by_its_name(example):
    image = image_file.read(build_image(load(example)).path)
    assert image.place_of(image.address_of("firmware_start")) == "firmware_start"


@needs_cross_compiler
def test_it_is_compiled_again_only_when_something_has_changed(tmp_path):
    folder = folder_with(tmp_path / "small", TIMER + SCHEDULE + START)
    first = build_image(load(folder))
    assert first.was_made and not build_image(load(folder)).was_made
    (folder / "small.c").write_text(
        (folder / "small.c").read_text(encoding="utf-8") + "int32_t more = 5;\n", encoding="utf-8"
    )
    assert build_image(load(folder)).was_made


@needs_cross_compiler
@pytest.mark.parametrize(
    ("addition", "reported"),
    [
        ("volatile uint8_t much[20000];", r"is .* bytes too large for the chip's ram of 16384 bytes"),
        ("static const uint8_t much[300000] = {1};", r"is .* bytes too large for the chip's flash of 253952 bytes"),
        ("volatile uint8_t much[13500];", "the variables leave less than 1024 bytes of RAM"),
    ],
)
def test_a_program_that_does_not_fit_is_reported_in_one_line(tmp_path, addition, reported):
    source = TIMER.replace("calls++;", "calls += much[calls & 7];").replace(
        "static int32_t calls;", f"static int32_t calls;\n{addition}"
    )
    (line,) = lines(folder_with(tmp_path / "small", source + SCHEDULE + START))
    assert re.search(reported, line)


@needs_cross_compiler
def test_a_call_that_the_chip_does_not_have_and_errors_of_the_compiler_are_reported_with_file_and_line(tmp_path):
    folder = folder_with(tmp_path / "small", TIMER.replace("TASK;", "fw_ssp_start(0);") + SCHEDULE + START)
    first, error = lines(folder)
    assert first == f"{folder}: small does not compile:"
    assert error.endswith("error: fw_ssp_start is used, but no source defines it") and "small.c:" in error
    folder = folder_with(tmp_path / "wrong", TIMER + SCHEDULE + START + "int f(void) { return x; }\n")
    assert [line for line in lines(folder) if "error: " in line and "small.c:" in line]


def test_without_the_cross_compiler_the_package_to_install_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    folder = folder_with(tmp_path / "small", TIMER + SCHEDULE + START)
    assert lines(folder) == [
        "no arm-none-eabi-gcc is installed here; firmware for the chip needs it "
        "(Debian, Ubuntu: apt install gcc-arm-none-eabi)"
    ]


def test_the_chips_files_are_where_the_package_looks_for_them():
    names = {each.name for each in pathlib.Path(image_build.CHIP).iterdir()}
    assert {"startup.S", "lpc2194.ld", "firmware.c", "scheduler.c", "support.c"} <= names


def test_a_board_with_can_fd_controllers_has_no_image(tmp_path):
    manifest = "[firmware]\nname = 'small'\n[hardware]\ncan = 'fd'\n"
    folder = folder_with(tmp_path / "small", TIMER + START + SCHEDULE, manifest)
    assert lines(folder)[0].endswith(
        "hardware.can is 'fd', and an image is for an LPC2194, whose controllers are classic"
    )
    (folder / "firmware.toml").write_text(manifest.replace("'fd'", "'xl'"), encoding="utf-8")
    with pytest.raises(UserError, match="hardware.can is 'xl', allowed are classic, fd"):
        load(folder)
