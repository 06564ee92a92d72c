"""Building firmware: what is wrong with a folder, its sources or a library is reported in plain lines."""

import os
import re

import pytest

from ranger_sim.firmware_sim.native import build as building
from ranger_sim.firmware_sim.native import library
from ranger_sim.firmware_sim.native.build import build
from ranger_sim.firmware_sim.native.library import Library
from ranger_sim.firmware_sim.native.manifest import load
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.native.support import COMPILER, SCHEDULE, START, TIMER, folder_with, library_of

needs_compiler = pytest.mark.skipif(not COMPILER, reason="no C compiler here")


def lines(action, *arguments, **how):
    with pytest.raises(UserError) as mistake:
        action(*arguments, **how)
    return str(mistake.value).splitlines()


@pytest.mark.parametrize(
    ("manifest", "reported"),
    [
        ("[firmware", "Expected ']' at the end of a table declaration"),
        ("[firmwear]\n", "firmwear: not known here; there are firmware, defines, hardware"),
        ("firmware = 3\n", "firmware is 3, a table is expected"),
        ("[firmware]\nname = 'a b'\n", "firmware.name 'a b': letters, digits, _ and - are expected"),
        ("[firmware]\nsources = ['other.c']\n", "firmware.sources: 'other.c' matches no file in"),
        ("[firmware]\nsources = 'small.c'\n", "firmware.sources is 'small.c', a list of texts is expected"),
        ("[firmware]\ninclude = ['inc']\n", "firmware.include: 'inc' is not a folder in"),
        ("[defines]\n'A B' = 1\n", "defines: 'A B' is not a name in C"),
        ("[hardware]\nhz = '60 MHz'\n", "hardware.hz is '60 MHz', a whole number is expected"),
        ("[hardware.external]\ninputs = { 2 = 8 }\n", "hardware.external.inputs is {'2': 8}, channel = analog place"),
        ("[hardware.spi.0]\nwords = 1\n", "hardware.spi.0.words: not known here; there are word, bits,"),
    ],
)
def test_a_wrong_manifest_is_one_line_that_names_file_and_key(tmp_path, manifest, reported):
    folder = folder_with(tmp_path / "small", TIMER, manifest)
    (line,) = lines(load, folder)
    assert line.startswith(f"{folder / 'firmware.toml'}:") and reported in line


@pytest.mark.parametrize("name", ["control.cpp", "control.cc", "control.cxx"])
def test_cplusplus_next_to_c_is_refused_by_name(tmp_path, name):
    folder = folder_with(tmp_path / "small", TIMER)
    (folder / name).write_text("int x;\n")
    assert lines(load, folder) == [
        f"{folder / 'firmware.toml'}: {name} is C++, and firmware is built from C alone "
        "(firmware.sources = ['*.c'] leaves it out)"
    ]
    (folder / "firmware.toml").write_text("[firmware]\nname = 'small'\nsources = ['*.c']\n")
    assert [each.name for each in load(folder).sources] == ["small.c"]
    (folder / "firmware.toml").write_text("[firmware]\nname = 'small'\nsources = ['*.c*']\n")
    assert lines(load, folder) == [f"{folder / 'firmware.toml'}: {name} is C++, and firmware is built from C alone"]


def test_a_folder_without_a_manifest_is_reported(tmp_path):
    assert lines(load, tmp_path) == [f"{tmp_path}: no firmware.toml in it, so it is not a folder of firmware"]


def test_without_a_compiler_the_names_tried_are_reported(tmp_path, monkeypatch):
    folder = folder_with(tmp_path / "small", TIMER + SCHEDULE + START)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert lines(build, load(folder)) == [
        "no C compiler is installed here (looked for cc, gcc, clang); firmware in C needs one"
    ]


@needs_compiler
def test_a_process_compiles_our_own_source_once_and_again_when_it_has_changed(tmp_path, monkeypatch):
    compiled = []

    def keeps(command, run=building.run_compiler):
        compiled.extend(command[command.index("-c") + 1 :][:1] if "-c" in command else ())
        return run(command)

    monkeypatch.setattr(building, "_OURS", {})
    monkeypatch.setattr(building, "run_compiler", keeps)
    folders = [folder_with(tmp_path / name, TIMER + SCHEDULE + START) for name in ("one", "two")]
    for folder in folders:
        library_of(folder)
    runtime = building.RUNTIME
    assert compiled == [str(runtime), str(folders[0] / "small.c"), str(folders[1] / "small.c")]
    changed = tmp_path / "runtime.c"
    monkeypatch.setattr(building, "RUNTIME", changed)
    changed.write_bytes(runtime.read_bytes())
    library_of(folder_with(tmp_path / "three", TIMER + SCHEDULE + START))
    changed.write_bytes(runtime.read_bytes() + b"#error later\n")
    assert lines(build, load(folders[0]))[0].startswith(f"{changed} does not compile with ")


@needs_compiler
def test_errors_of_the_compiler_are_reported_with_file_and_line(tmp_path):
    folder = folder_with(tmp_path / "small", "#include <ranger_sim/firmware.h>\nint f(void) { return x; }\nint g = 1\n")
    first, *errors = lines(library_of, folder)
    assert first == f"{folder}: small does not compile:"
    assert [re.sub(r"error: .*", "error", line) for line in errors] == [
        f"{folder / 'small.c'}:2: error",
        f"{folder / 'small.c'}:3: error",
    ]
    assert not list((folder / "build").glob("*.so")) and not list((folder / "build").glob(".making*"))


@needs_compiler
def test_a_function_that_no_source_defines_is_reported_by_name_and_line(tmp_path):
    source = TIMER.replace("TASK;", "other();").replace(
        "static int32_t calls;", "void other(void);\nstatic int32_t calls;"
    )
    first, error = lines(library_of, folder_with(tmp_path / "small", source + SCHEDULE + START))
    assert re.search(r"small\.c:\d+: error: other is used, but no source defines it$", error)


@needs_compiler
@pytest.mark.parametrize(
    ("source", "reported"),
    [
        (START, "no firmware_schedule() or firmware_main() in it"),
        (TIMER + SCHEDULE, "no firmware_start() in it"),
        (TIMER + SCHEDULE + START + "void firmware_main(void) {}", "are defined; one is allowed"),
    ],
)
def test_a_library_without_the_entry_points_is_refused_when_it_is_built(tmp_path, source, reported):
    (line,) = lines(library_of, folder_with(tmp_path / "small", "#include <ranger_sim/firmware.h>\n" + source))
    assert reported in line


@needs_compiler
def test_a_library_for_another_version_of_the_header_is_refused(tmp_path, monkeypatch):
    path = library_of(folder_with(tmp_path / "small", TIMER + SCHEDULE + START))
    monkeypatch.setattr(library, "VERSION", 2)  # as a later release of the package would have it
    assert lines(Library, path) == [f"{path}: compiled with version 1 of firmware.h, this is 2: build it again"]


@needs_compiler
def test_a_file_that_is_not_a_library_is_refused(tmp_path):
    path = tmp_path / "text.so"
    path.write_text("not a library", encoding="utf-8")
    (line,) = lines(Library, path)
    assert line.startswith(f"{path}: cannot be loaded as a library: ")
    (line,) = lines(Library, tmp_path / "none.so")
    assert "there is no such firmware library" in line


@needs_compiler
def test_a_program_that_needs_a_long_of_32_bits_is_stopped_by_the_compiler_where_it_has_64(tmp_path):
    folder = folder_with(tmp_path / "small", "#define FW_NEEDS_32_BIT_LONG\n" + TIMER + SCHEDULE + START)
    reported = lines(library_of, folder)
    assert any("fw_this_program_needs_a_long_of_32_bits" in line for line in reported)


@needs_compiler
def test_it_is_compiled_again_only_when_something_has_changed(tmp_path):
    folder = folder_with(tmp_path / "small", TIMER + SCHEDULE + START)
    assert build(load(folder)).was_made and not build(load(folder)).was_made
    with (folder / "small.c").open("a", encoding="utf-8") as file:
        file.write("/* more */\n")
    assert build(load(folder)).was_made
    (folder / "firmware.toml").write_text("[firmware]\nname = 'small'\n[defines]\nA = 1\n", encoding="utf-8")
    assert build(load(folder)).was_made


@needs_compiler
@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_to_is_reported(tmp_path):
    folder = folder_with(tmp_path / "small", TIMER + SCHEDULE + START)
    folder.chmod(0o500)
    try:
        (line,) = lines(library_of, folder)
    finally:
        folder.chmod(0o700)
    assert "nothing can be built there" in line
