"""The generated C compiles as strict C99 and says the same as the table."""

import shutil
import struct
import subprocess

import pytest

from ranger_sim.datatable.generate import GENERATED_FOLDER
from ranger_sim.datatable.generate_c import C_TYPES
from ranger_sim.datatable.generate_python import known_to, received_by, sent_by
from ranger_sim.datatable.loader import load_table
from ranger_sim.datatable.routing import destination_masks

COMPILER = shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler `cc` found: the generated C was NOT compiled")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
FOLDER = GENERATED_FOLDER / "c"
TABLE = load_table()
BOARDS = [board for board in TABLE.boards if board.firmware]


def build_and_run(folder, name, program, sources):
    """Compile a program with generated sources and return what it prints, as lists of words."""
    (folder / f"{name}.c").write_text(program)
    build = [COMPILER, *FLAGS, f"-I{FOLDER}", f"{name}.c", *map(str, sources), "-o", name]
    done = subprocess.run(build, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([str(folder / name)], capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def reading_program(board):
    """A C program that prints everything the generated files of a board say."""
    small = board.name.lower()
    lines = [
        "#include <stdio.h>",
        "#include <string.h>",
        f'#include "{small}_table.h"',
        "static void word(const char *what, unsigned long id, size_t size, const void *at)",
        "{",
        "    uint32_t bits;",
        "    memcpy(&bits, at, sizeof bits);",
        '    printf("%s %lu %lu %lu\\n", what, id, (unsigned long)size, (unsigned long)bits);',
        "}",
        "int main(void)",
        "{",
        "    size_t i;",
        f'    printf("size %lu\\n", (unsigned long)sizeof(struct {small}_data));',
        f'    printf("board %d %d %d\\n", {board.name}_BOARD_NUMBER, {board.name}_SLOT_US, {board.name}_ROWS);',
    ]
    for variable in known_to(TABLE, board):
        member = f"{small}_initial.{variable.name.lower()}"
        lines.append(f'    word("initial", {variable.name}, sizeof {member}, &{member});')
    for which in ("send", "receive"):
        lines += [
            f"    for (i = 0; i < {board.name}_{which.upper()}_COUNT; i++)",
            f'        printf("{which} %u %u %lu\\n", (unsigned){small}_{which}[i].id,',
            f"               (unsigned){small}_{which}[i].type, (unsigned long){small}_{which}[i].offset);",
        ]
    if board.role == "router":
        lines += [
            f"    for (i = 0; i < sizeof {small}_routes; i++)",
            f'        printf("route %u\\n", (unsigned){small}_routes[i]);',
        ]
    return "\n".join([*lines, "    return 0;", "}", ""])


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
def test_a_boards_c_code_compiles_and_says_what_the_table_says(board, tmp_path):
    source = FOLDER / f"{board.name.lower()}_table.c"
    printed = build_and_run(tmp_path, "reader", reading_program(board), [source])
    known = known_to(TABLE, board)
    expected = [["size", str(4 * len(known))], ["board", str(board.number), str(board.slot_us), str(len(board.rows))]]
    for variable in known:
        layout = {"f32": "<f", "i32": "<i", "u32": "<I"}[variable.type]
        (word,) = struct.unpack("<I", struct.pack(layout, variable.initial))
        expected.append(["initial", str(variable.id), "4", str(word)])
    place = {variable.id: 4 * index for index, variable in enumerate(known)}
    for which, variables in (("send", sent_by(TABLE, board)), ("receive", received_by(TABLE, board))):
        for v in variables:
            expected.append([which, str(v.id), str(list(C_TYPES).index(v.type)), str(place[v.id])])
    if board.role == "router":
        expected += [["route", str(mask)] for mask in destination_masks(TABLE)]
    assert printed == expected


def test_headers_of_all_boards_and_error_codes_live_in_one_program(tmp_path):
    names = [board.name.lower() for board in BOARDS]
    program = "".join(f'#include "{name}_table.h"\n' for name in names) + "#include <stdio.h>\nint main(void)\n{\n"
    program += "".join(f'    printf("{error.name} %d\\n", ERR_{error.name});\n' for error in TABLE.errors)
    program += "    return 0;\n}\n"
    printed = build_and_run(tmp_path, "all", program, [FOLDER / f"{name}_table.c" for name in names])
    assert printed == [[error.name, str(error.id)] for error in TABLE.errors]
