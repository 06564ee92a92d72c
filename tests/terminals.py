"""A command on a separate terminal: what it prints there, keys, a window that closes."""

import contextlib
import fcntl
import os
import pathlib
import pty
import select
import signal
import struct
import sys
import tempfile
import termios
from collections.abc import Iterator

from ranger_sim.foundation import wallclock

CTRL_C = b"\x03"
PATIENCE_S = 120.0


@contextlib.contextmanager
def alone(what: str) -> Iterator[None]:
    """One test at a time, in all processes of this machine's tests: for a command whose port is always the same."""
    with open(pathlib.Path(tempfile.gettempdir()) / f"ranger-sim-tests-{what}", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


class Terminal:
    """`ranger-sim WORDS`, or another module with its words, in a separate session whose terminal has so many columns.

    A context manager.
    """

    def __init__(self, *words: object, folder: pathlib.Path, columns: int = 80, module: str = "ranger_sim") -> None:
        self.shown = ""
        self.stopped = self.code = None
        command = [sys.executable, "-m", module, *map(str, words)]
        environment = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
        environment |= {"TERM": "xterm", "PYTHONPATH": str(pathlib.Path.cwd())}
        # The size is set before the program begins: it waits for the end of this pipe.
        go_read, go_write = os.pipe()
        self.process, self.master = pty.fork()
        if self.process == 0:
            os.close(go_write)
            os.read(go_read, 1)
            os.chdir(folder)
            os.execve(command[0], command, environment)
        os.close(go_read)
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        os.close(go_write)

    def __enter__(self):
        return self

    def __exit__(self, *_error: object) -> None:
        if self.code is None:
            for process in [self.process, *self.left()]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            os.waitpid(self.process, 0)
        if self.master is not None:
            os.close(self.master)

    def press(self, keys: bytes) -> None:
        """Type on the terminal."""
        os.write(self.master, keys)

    def close(self) -> None:
        """Close the window."""
        os.close(self.master)
        self.master = None

    def read(self, seconds: float) -> bool:
        """Take in what is shown within so long; False when nothing was, or the terminal has ended."""
        if self.master is None or not select.select([self.master], [], [], seconds)[0]:
            return False
        try:
            data = os.read(self.master, 1 << 16)
        except OSError:
            return False
        self.shown += data.decode(errors="replace")
        return bool(data)

    def until(self, text: str) -> None:
        """Wait until `text` is shown, from now on."""
        begin, end = len(self.shown), wallclock.monotonic_s() + PATIENCE_S
        while text not in self.shown[begin:]:
            self.read(0.5)
            assert self.is_there(), f"ended with {self.code} before {text!r} in:\n{self.shown[-2000:]}"
            assert wallclock.monotonic_s() < end, f"no {text!r} in:\n{self.shown[-2000:]}"

    def suspend(self) -> None:
        """Stop its process group, as Ctrl-Z does where a shell has started it, and wait for that.

        Its first process stops before the others: one that is just starting a program by vfork can stop only when that
        program has been loaded, which never happens when both are stopped at once. SIGSTOP because a group without a
        shell would ignore SIGTSTP.
        """
        os.kill(self.process, signal.SIGSTOP)
        end = wallclock.monotonic_s() + PATIENCE_S
        while self.stopped is None:
            self.read(0.1)
            assert self.is_there() and wallclock.monotonic_s() < end, self.shown
        os.killpg(self.process, signal.SIGSTOP)

    def resume(self) -> None:
        """Continue it, as `fg` of a shell does."""
        self.stopped = None
        os.killpg(self.process, signal.SIGCONT)

    def wait(self) -> int:
        """Its exit code."""
        end = wallclock.monotonic_s() + PATIENCE_S
        while self.is_there():
            if not self.read(0.1) and self.master is None:
                select.select([], [], [], 0.05)
            assert wallclock.monotonic_s() < end, f"it has not ended:\n{self.shown[-2000:]}"
        while self.read(0.0):
            pass
        return self.code

    def is_there(self) -> bool:
        """True until it has ended."""
        if self.code is None:
            process, status = os.waitpid(self.process, os.WNOHANG | os.WUNTRACED)
            if process and os.WIFSTOPPED(status):
                self.stopped = os.WSTOPSIG(status)
            elif process:
                self.code = os.waitstatus_to_exitcode(status)
        return self.code is None

    def left(self) -> list[int]:
        """Processes of its session that have not ended."""
        found = []
        for each in pathlib.Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                fields = each.read_text(errors="replace").rpartition(")")[2].split()
                if int(fields[3]) == self.process and fields[0] != "Z":
                    found.append(int(each.parent.name))
        return found
