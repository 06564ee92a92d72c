"""What a firmware in C prints: never in the result, always by its board."""

import json

import pytest

from tests.firmware_sim.native.support import COMPILER, folder_with

pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler here")

MANIFEST = "[firmware]\nname = 'small'\ntables = ['{table}']\n"
CONTROLLER = {"mch": 1, "ui": 2}  # on which the board's bus hangs
PROGRAM = """
#include <ranger_sim/firmware.h>
#include "{table}_table.h"
#include <stdio.h>
#include <stdlib.h>
static uint32_t slots;
static int32_t control(void)
{{
    if (++slots == 3) {{ printf("slot %d \\xff\\x1b[31m\\n", 3); fprintf(stderr, "wrong\\n"); printf("no end"); }}
    {more}
    return 0;
}}
static const fw_task every[] = {{{{control, "control", 20, 30}}}};
static const fw_schedule schedule = {{
    .slot_ns = 500000, .every = FW_TASKS(every), .tick_cost = 60, .tick_vic_slot = 4}};
void firmware_start(void) {{ printf("started\\n"); fw_can_start({can}, 0x00254001, 0); }}
const fw_schedule *firmware_schedule(void) {{ return &schedule; }}
uint32_t firmware_table_version(void) {{ return RANGER_TABLE_VERSION; }}
"""
SHOWN = ["MCH: started", "MCH: slot 3 \ufffd\\x1b[31m", "MCH: wrong", "MCH: no end"]
HERE = [line for line in SHOWN if "wrong" not in line]  # in the walk's process standard error is the walk's own


def firmware(folder, board="mch", more=""):
    return folder_with(
        folder, PROGRAM.format(table=board, more=more, can=CONTROLLER[board]), MANIFEST.format(table=board)
    )


@pytest.mark.parametrize(
    ("words", "shown"),
    [(["walk"], SHOWN), (["walk", "--in-process"], [*HERE, "wrong"]), (["up", "--speed", "max"], SHOWN)],
    ids=" ".join,
)
def test_a_result_is_json_although_the_firmware_prints(command, tmp_path, words, shown):
    words = [*words, "--firmware", f"MCH={firmware(tmp_path / 'hip')}", "--time", "20ms"]
    if words[0] == "up":
        words += ["--name", "printing"]
    done = command(*words, "--json", "-")
    assert json.loads(done.stdout)["firmware"]["MCH"]["name"] == "small", done.stderr
    assert sorted(done.stderr.splitlines()) == sorted(shown)


@pytest.mark.parametrize("mode", ["walk", "up"])
def test_in_a_run_folder_each_board_has_a_file_of_what_it_printed(command, tmp_path, mode):
    boards = {"MCH": firmware(tmp_path / "hip"), "UI": firmware(tmp_path / "panel", "ui")}
    given = [word for board, folder in boards.items() for word in ("--firmware", f"{board}={folder}")]
    more = ["--speed", "max", "--name", "printing"] if mode == "up" else []
    done = command(mode, *given, *more, "--time", "20ms", "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["complete"]
    for board in boards:
        kept = (tmp_path / "run" / f"printed-{board}.txt").read_bytes()
        assert kept == b"started\nslot 3 \xff\x1b[31m\nwrong\nno end"
        assert summary["files"][f"printed-{board}.txt"] == "complete"
    assert "slot 3" not in done.stdout + done.stderr
    again = command(mode, *more, "--time", "1ms", "--out", tmp_path / "run")
    assert again.returncode == 0 and not list((tmp_path / "run").glob("printed-*")), again.stderr


def test_what_a_program_printed_before_it_broke_is_kept(command, tmp_path):
    hip = firmware(tmp_path / "hip", more='if (slots == 5) { printf("last words\\n"); abort(); }')
    done = command("walk", "--firmware", f"MCH={hip}", "--time", "20ms")
    assert done.returncode == 1 and "MCH: no endlast words\n" in done.stderr
    assert "MCH was lost" in done.stderr


def test_what_a_constructor_prints_does_not_reach_the_json(command, tmp_path):
    hip = firmware(tmp_path / "hip")
    source = hip / "small.c"
    early = '__attribute__((constructor)) static void early(void) { printf("loaded\\n"); fflush(stdout); }\n'
    source.write_text(source.read_text() + early)
    done = command("walk", "--firmware", f"MCH={hip}", "--time", "20ms", "--json", "-")  # it is compiled, then loaded
    assert json.loads(done.stdout)["failed_boards"] == []
    assert "MCH: loaded" in done.stderr


def test_what_a_program_prints_that_does_not_start_is_shown(command, tmp_path):
    hip = firmware(tmp_path / "hip")
    source = hip / "small.c"
    source.write_text(source.read_text().replace('printf("started\\n");', 'printf("no sensor\\n"); exit(3);'))
    done = command("walk", "--firmware", f"MCH={hip}", "--time", "20ms", "--json", "-")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.splitlines()[0] == "MCH: no sensor"
    assert "fails in its start" in done.stderr


def test_a_program_that_prints_much_holds_nothing_up(command, tmp_path):
    hip = firmware(tmp_path / "hip", more='for (int i = 0; i < 1000; i++) printf("%060d\\n", i);')
    done = command("walk", "--firmware", f"MCH={hip}", "--time", "50ms", "--out", tmp_path / "run")
    assert done.returncode in (0, 1), done.stderr
    lines = (tmp_path / "run" / "printed-MCH.txt").read_bytes().splitlines()
    assert len(lines) > 50_000 and lines[-1] == b"%060d" % 999
