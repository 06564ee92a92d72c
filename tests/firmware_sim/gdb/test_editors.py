"""Sessions as editors hold them: what cortex-debug and cppdbg (Visual Studio Code) send to gdb, in their order.

Source of the commands: src/gdb.ts, src/external.ts and src/backend/mi2/mi2.ts of Marus/cortex-debug ("servertype":
"external"); MICommandFactory.cs and DebuggedProcess.cs of microsoft/MIEngine ("miDebuggerServerAddress"). The sessions
speak to the real gdb by its machine interface (GDB/MI), gdb to our port.
"""

import concurrent.futures
import re
import subprocess

import pytest

from ranger_sim.firmware_sim.gdb.server import GdbServer
from tests.firmware_sim.gdb import machine as tiny
from tests.firmware_sim.gdb.test_real_gdb import GDB

pytestmark = [
    pytest.mark.skipif(GDB is None, reason="no gdb that knows ARM (apt-get install gdb-multiarch)"),
    pytest.mark.skipif(not tiny.compiler_is_there(), reason="no cross compiler (apt-get install gcc-arm-none-eabi)"),
]


class Editor:
    """One end of GDB/MI. Every command must be answered, by `^error` where `error` is asked for only."""

    def __init__(self, port):
        self.port = port
        self.process = subprocess.Popen(
            (GDB, "-nx", "-q", "--interpreter=mi2"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.number = 0
        self.stops = []  # records of stops that came and were not waited for yet
        self.lines = []

    def line(self):
        line = self.process.stdout.readline()
        assert line, "gdb ended: " + "".join(self.lines[-20:])
        self.lines.append(line)
        if line.startswith("*stopped"):
            self.stops.append(line)
        return line

    def does(self, command, answer="done"):
        """Sends a command; its result record, which must be of this class."""
        self.number += 1
        self.process.stdin.write(f"{self.number}-{command}\n")
        self.process.stdin.flush()
        while not (line := self.line()).startswith(f"{self.number}^"):
            pass
        assert line.startswith(f"{self.number}^{answer}"), (command, line)
        return line

    def console(self, command, answer="done"):
        return self.does(f'interpreter-exec console "{command}"', answer)

    def stopped(self):
        """The record of the next stop."""
        while not self.stops:
            self.line()
        return self.stops.pop(0)

    def looks(self):
        """What an editor asks for after every stop: threads, stack, variables, registers; the text of the frames."""
        assert 'threads=[{id="1"' in self.does("thread-info")
        frames = self.does("stack-list-frames --thread 1 0 20")
        self.does("stack-info-depth --thread 1 10000")
        self.does("stack-list-variables --thread 1 --frame 0 --simple-values")
        names = self.does("data-list-register-names")
        assert '"r0"' in names and '"cpsr"' in names
        assert 'number="15"' in self.does("data-list-register-values x")
        return frames

    def ends(self):
        self.process.stdin.write("-gdb-exit\n")
        self.process.stdin.flush()
        self.process.stdout.read()
        return self.process.wait(timeout=60)


def with_an_editor(machine, talk):
    """What `talk(editor)` returns, while the machine runs."""
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        server = GdbServer(machine, 0)

        def whole():
            editor = Editor(server.port)
            try:
                result = talk(editor)
                assert editor.ends() == 0
            finally:
                editor.process.kill()
                editor.process.communicate()
            return result

        try:
            future = pool.submit(whole)
            server.ends = future.done
            server.wait_for_debugger()
            while not future.done():
                machine.run(machine.core.cycles + 100_000)
        finally:
            server.close()
        return future.result()


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """(ELF file, bytes of flash)"""
    return tiny.build(tmp_path_factory.mktemp("program"))


def cortex_debug_begins(editor, elf):
    editor.does("gdb-set mi-async on")
    editor.console("set print demangle on")
    editor.console("set print asm-demangle on")
    editor.does("enable-pretty-printing")
    editor.console("set output-radix 0xa")
    editor.console("set input-radix 0xa")
    editor.does(f'file-exec-and-symbols "{elf}"')
    editor.does(f"target-select extended-remote localhost:{editor.port}", "connected")
    editor.stopped()


def test_cortex_debug_loads_the_program_runs_to_main_and_restarts(program):
    elf, flash = program
    machine = tiny.Machine(bytes(len(flash)))  # an empty flash: the editor programs it

    def talk(editor):
        cortex_debug_begins(editor, elf)
        editor.console("monitor reset halt")
        assert "load-size=" in editor.does("target-download")
        editor.console("monitor reset halt")
        editor.does("break-insert -t -h main")
        editor.does("exec-continue --all", "running")
        assert 'func="main"' in editor.stopped()
        assert 'func="main"' in editor.looks()
        point = re.search(r'number="(\d+)"', editor.does("break-insert -h weigh")).group(1)
        editor.does("exec-continue --thread 1", "running")
        assert 'reason="breakpoint-hit"' in editor.stopped()
        assert re.search(r'func="weigh".*func="main"', editor.looks())
        editor.does(f"break-condition {point} sample == 9")
        editor.does("exec-continue --thread 1", "running")
        editor.stopped()
        assert 'value="9"' in editor.does('var-create --thread 1 --frame 0 seen @ "sample"')
        editor.does("var-set-format seen hexadecimal")
        assert 'value="0x9"' in editor.does("var-evaluate-expression seen")
        assert 'name="seen"' not in editor.does("var-update --thread 1 --frame 0 --all-values seen")
        editor.does("break-delete " + point)
        for step in ("exec-next", "exec-step", "exec-step-instruction"):
            editor.does(step + " --thread 1", "running")
            assert 'reason="end-stepping-range"' in editor.stopped()
        editor.does('break-watch "sum"')
        editor.does("exec-continue --thread 1", "running")
        assert 'reason="watchpoint-trigger"' in editor.stopped()
        editor.does("break-delete")
        memory = editor.does('data-read-memory-bytes "&turns" 4')
        place = re.search(r'begin="(0x[0-9a-f]+)"', memory).group(1)
        editor.does(f"data-write-memory-bytes {place} 39300000")
        assert 'value="12345"' in editor.does("data-evaluate-expression --thread 1 --frame 0 turns")
        assert "asm_insns=" in editor.does("data-disassemble -s 0 -e 16 -- 2")
        # the button "restart"
        editor.console("monitor reset halt")
        editor.does("break-insert -t -h main")
        editor.does("exec-continue --all", "running")
        assert 'func="main"' in editor.stopped()
        # the button "pause", of a program that runs
        editor.does("exec-continue --thread 1", "running")
        editor.does("exec-interrupt --thread 1")
        assert 'signal-name="SIGINT"' in editor.stopped()
        editor.does("target-detach")
        return True

    assert with_an_editor(machine, talk)
    assert machine.core.debugger is None


def test_cortex_debug_attaches_to_a_program_that_runs_and_leaves_it_as_it_was(program):
    elf, flash = program
    machine = tiny.Machine(flash)
    machine.run(10_000)

    def talk(editor):
        cortex_debug_begins(editor, elf)
        editor.console("monitor halt")
        frames = editor.looks()
        cycles = editor.does('data-evaluate-expression "$cycles"')
        editor.does("target-detach")
        return frames, int(re.search(r'value="(\d+)"', cycles).group(1))

    frames, cycles = with_an_editor(machine, talk)
    assert "func=" in frames
    alone = tiny.Machine(flash)
    alone.run(10_000)
    assert cycles == alone.core.cycles
    alone.run(machine.core.cycles)
    assert machine.digest() == alone.digest()


def test_cppdbg_stops_at_main_steps_and_evaluates(program):
    elf, flash = program
    machine = tiny.Machine(flash)

    def talk(editor):
        editor.does("gdb-set mi-async on")
        assert "thread-info" in editor.does("list-features")
        editor.console("set pagination off")
        editor.does("gdb-set auto-solib-add on")
        editor.does("gdb-set stop-on-solib-events 1")
        editor.does(f'file-exec-and-symbols "{elf}"')
        editor.console("show architecture")
        editor.does("break-insert -f main")
        editor.does(f"target-select remote localhost:{editor.port}", "connected")
        editor.stopped()
        editor.does("exec-continue", "running")
        assert 'reason="breakpoint-hit"' in editor.stopped()
        editor.does("gdb-set stop-on-solib-events 0")
        editor.does("thread-info 1")
        assert 'func="main"' in editor.does("stack-list-frames 0 1000")
        editor.does("thread-select 1")
        editor.does("stack-select-frame 0")
        editor.does("stack-list-arguments 0 0 0")
        editor.does("stack-list-variables 0")
        editor.does('break-insert -f -c "sample == 4" weigh')
        editor.does("exec-continue", "running")
        assert 'value="4"' in editor.stopped()
        assert 'value="4"' in editor.does('var-create --thread 1 --frame 0 - * "sample"')
        editor.does('var-create --thread 1 --frame 0 - * "no_such_name"', "error")
        editor.does("exec-finish", "running")
        assert 'reason="function-finished"' in editor.stopped()
        address = re.search(r'value="\D*(\d+)', editor.does('data-evaluate-expression "(unsigned)&turns"')).group(1)
        editor.does(f"data-read-memory-bytes {address} 4")
        editor.does(f"break-watch *(int*)({int(address):#x})")
        editor.does("exec-continue", "running")
        assert 'reason="watchpoint-trigger"' in editor.stopped()
        assert 'register-names=["r0"' in editor.does("data-list-register-names")
        editor.does("data-list-register-values x 0 1 15")
        editor.does("target-detach")
        return True

    assert with_an_editor(machine, talk)
    assert machine.core.debugger is None
