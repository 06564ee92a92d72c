"""A session with the real gdb: its own idea of breakpoints, steps, frames and memory, over the tiny machine."""

import concurrent.futures
import re
import shutil
import subprocess

import pytest

from ranger_sim.firmware_sim.gdb.server import GdbServer
from tests.firmware_sim.gdb import machine as tiny

GDB = next(filter(None, map(shutil.which, ("gdb-multiarch", "arm-none-eabi-gdb"))), None)

pytestmark = [
    pytest.mark.skipif(GDB is None, reason="no gdb that knows ARM (apt-get install gdb-multiarch)"),
    pytest.mark.skipif(not tiny.compiler_is_there(), reason="no cross compiler (apt-get install gcc-arm-none-eabi)"),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """(ELF file, bytes of flash)"""
    return tiny.build(tmp_path_factory.mktemp("program"))


def debugged(machine, elf, commands, tmp_path, code=0):
    """What gdb prints when it obeys these commands, each after a line `> command`."""
    script = tmp_path / "script.gdb"
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        server = GdbServer(machine, 0)
        try:
            lines = ["set pagination off", "set confirm off", "set width 0", f"target remote :{server.port}"]
            for command in commands:
                lines += [f"echo > {command}\\n", command]
            script.write_text("\n".join(lines) + "\n")
            call = (GDB, "-nx", "-batch", "-x", str(script), str(elf))
            both = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}  # monitor writes to the second
            future = pool.submit(subprocess.run, call, text=True, timeout=60, check=False, **both)
            server.ends = future.done
            server.wait_for_debugger()
            while not future.done():
                machine.run(machine.core.cycles + 100_000)
        finally:
            server.close()
        done = future.result()
    assert done.returncode == code, done.stdout
    answers = {}
    for part in re.split(r"^> ", done.stdout, flags=re.MULTILINE)[1:]:
        command, _, answer = part.partition("\n")
        answers.setdefault(command, []).append(answer)
    return answers


def test_a_session_from_the_first_breakpoint_to_leaving(program, tmp_path):
    elf, flash = program
    machine = tiny.Machine(flash)
    reported = debugged(
        machine,
        elf,
        [
            "break weigh",
            "continue",
            "backtrace",
            "print sample",
            "finish",
            "step",
            "info line",
            "delete",
            "watch sum",
            "continue",
            "print turns",
            "delete",
            "rwatch turns",
            "continue",
            "delete",
            "x/xw 0xe0000000",
            "monitor time",
            "set variable sum = 1000",
            "print sum",
            "print/x $sp_irq",
            "tbreak tick",
            "continue",
            "print/x $cpsr & 0x1f",
            "print/x $spsr_irq & 0x1f",
            "info registers lr",
            "print $cycles >= 700",
            "disassemble tick,+4",
            "detach",
        ],
        tmp_path,
    )
    assert "Breakpoint 1, weigh (sample=1)" in reported["continue"][0]
    assert re.search(r"#0 .*weigh .*\n#1 .*main \(\) at .*program.c:32", reported["backtrace"][0])
    assert "$1 = 1" in reported["print sample"][0]
    assert "Value returned is" in reported["finish"][0]
    assert "remember (value=4)" in reported["step"][0]
    assert re.search(r"Old value = 0\nNew value = 4\n", reported["continue"][1])
    assert "read watchpoint" in reported["continue"][2]
    assert "0x00000002" in reported["x/xw 0xe0000000"][0]  # looked at: the next that a read would give
    assert re.search(r"TINY: \d+ cycles, \d+ instructions", reported["monitor time"][0])
    assert "= 1000" in reported["print sum"][0]
    assert "= 0x40003f00" in reported["print/x $sp_irq"][0]
    assert "tick ()" in reported["continue"][3]
    assert "= 0x12" in reported["print/x $cpsr & 0x1f"][0]
    assert "= 0x1f" in reported["print/x $spsr_irq & 0x1f"][0]
    assert "= 1" in reported["print $cycles >= 700"][0]
    assert "push\t{r" in reported["disassemble tick,+4"][0] or "stmfd" in reported["disassemble tick,+4"][0]
    assert "detached" in reported["detach"][0]
    assert machine.core.debugger is None


def test_a_function_is_called_by_hand_and_everything_is_as_it_was(program, tmp_path):
    elf, flash = program
    machine = tiny.Machine(flash)
    reported = debugged(
        machine,
        elf,
        [
            "break remember",
            "continue",
            "print/x $lr",
            "call weigh(5)",
            "print weigh(6) + 1",
            "print/x $lr",
            "backtrace 1",
        ],
        tmp_path,
    )
    assert reported["call weigh(5)"] == ["$2 = 16\n"]
    assert reported["print weigh(6) + 1"] == ["$3 = 20\n"]
    assert reported["print/x $lr"][0].split()[-1] == reported["print/x $lr"][1].split()[-1]
    assert "#0  remember (value=4)" in reported["backtrace 1"][0]


def test_what_editors_send_resets_and_halts(program, tmp_path):
    elf, flash = program
    machine = tiny.Machine(flash)
    reported = debugged(
        machine,
        elf,
        ["break remember", "continue", "monitor halt", "monitor reset halt", "maintenance flush register-cache",
         "print/x $pc", "load", "monitor reset halt", "tbreak weigh", "continue", "monitor explode"],
        tmp_path,
        code=1,
    )  # fmt: skip
    assert "TINY: halted at" in reported["monitor halt"][0]
    assert "TINY: reset, halted at 0x00000000" in reported["monitor reset halt"][0]
    assert reported["print/x $pc"] == ["$1 = 0x0\n"]
    assert "weigh (sample=" in reported["continue"][1]
    assert "monitor explode: unknown command" in reported["monitor explode"][0]


def test_load_programs_the_flash_and_compares_it(program, tmp_path):
    elf, flash = program
    machine = tiny.Machine()
    reported = debugged(
        machine,
        elf,
        ["load", "compare-sections .text", "print/x $pc", "hbreak remember", "continue", "kill"],
        tmp_path,
    )
    assert "Transfer rate" in reported["load"][0]
    assert "matched" in reported["compare-sections .text"][0]
    assert "remember (value=4)" in reported["continue"][0]
    assert machine.core.peek(0) == int.from_bytes(flash[:4], "little")


def test_a_session_that_only_looks_leaves_the_run_as_it_is(program, tmp_path):
    elf, flash = program
    machine = tiny.Machine(flash)
    looks = ["break remember", "continue", "next", "next", "next", "stepi", "info registers", "x/16xw 0x40000000"]
    debugged(machine, elf, [*looks, "continue", "backtrace", "delete", "detach"], tmp_path)
    end = max(100_000, machine.core.cycles)
    machine.run(end)
    alone = tiny.Machine(flash)
    alone.run(end)
    assert machine.digest() == alone.digest()
