"""What differs between Linux, macOS and Windows; docs/explanation/systems.md has the table of what works where.

A module that every system needs imports nothing of one system at its top: it asks here.
"""

import contextlib
import os
import sys
from collections.abc import Iterator

from ranger_sim.foundation.user_error import UserError

# The byte of a file that Windows locks: the last one that its `_locking` reaches, behind all content, so that other
# programs can read the file.
LOCK_AT = (1 << 31) - 2
# Flags of `os.open`, 0 where a system does not have them: bytes as they are, not lines as Windows translates them; and
# not through a symbolic link.
O_BINARY: int = getattr(os, "O_BINARY", 0)
O_NOFOLLOW: int = getattr(os, "O_NOFOLLOW", 0)


def can_fork() -> bool:
    """True where a process can be copied as it is: on Linux and macOS."""
    return hasattr(os, "fork")


def is_windows() -> bool:
    """True on Windows, where an open file cannot be renamed and a console takes text, not bytes."""
    return sys.platform == "win32"


def is_linux() -> bool:
    """True on Linux, where processes, abstract sockets and owners of connections are known."""
    return sys.platform.startswith("linux")


def require_linux(what: str, why: str, instead: str = "") -> None:
    """UserError on another system than Linux.

    what: the things that need it, a plural; why: the calls that other systems lack; instead: what works there.
    """
    if not is_linux():
        raise UserError(f"{what} need Linux ({why}), this is {sys.platform}{f'; {instead}' if instead else ''}")


def processors() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def lock(descriptor: int) -> None:
    """Lock an open file for this process until it is closed; BlockingIOError when another one has it locked."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        with _at(descriptor, LOCK_AT):
            try:
                msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
            except PermissionError as error:
                raise BlockingIOError(error.errno, error.strerror) from None
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def write_at(descriptor: int, data: bytes | memoryview, at: int) -> int:
    """Write at byte `at` of a file that this thread alone uses; returns the number of bytes taken."""
    if hasattr(os, "pwrite"):
        return os.pwrite(descriptor, data, at)
    with _at(descriptor, at):
        return os.write(descriptor, data)


def read_at(descriptor: int, length: int, at: int) -> bytes:
    """Read up to `length` bytes from byte `at` of a file that this thread alone uses."""
    if hasattr(os, "pread"):
        return os.pread(descriptor, length, at)
    with _at(descriptor, at):
        return os.read(descriptor, length)


@contextlib.contextmanager
def _at(descriptor: int, at: int) -> Iterator[None]:
    """Inside, the file's position is `at`."""
    position = os.lseek(descriptor, 0, os.SEEK_CUR)
    os.lseek(descriptor, at, os.SEEK_SET)
    try:
        yield
    finally:
        os.lseek(descriptor, position, os.SEEK_SET)
