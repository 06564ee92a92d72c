"""What the processes ask of Linux: a signal when the parent dies, memory that stays, real-time scheduling."""

import contextlib
import ctypes
import os
import signal

from ranger_sim.harness.processes.settings import Settings

PR_SET_PDEATHSIG, PR_SET_NAME, PR_SET_TIMERSLACK = 1, 15, 29  # linux/prctl.h
ADDR_NO_RANDOMIZE = 0x0040000  # sys/personality.h
MCL_CURRENT, MCL_FUTURE = 1, 2  # sys/mman.h
FIFO_PRIORITY = 20  # of 99: above all ordinary processes, below those that the machine needs; chosen by us
EVENTFD = "anon_inode:[eventfd]"  # in the list of a process's descriptors
PARENT_GONE = 3  # exit code of a child whose parent was dead before it could ask for the signal


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> None:
    """Let the kernel kill this process when `parent` (a process id) ends in any way; at once if it has ended.

    A process with separate process numbers does not see its parent: its launcher ends it (native/confinement.py).
    """
    _libc().prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() not in (parent, 0):  # it died before the call above: the kernel would not send the signal
        os._exit(PARENT_GONE)


def fix_addresses() -> None:
    """Load programs that this process starts to fixed addresses, where the kernel permits it.

    The address sanitizer of gcc 12 and 13 does not start where the kernel spreads addresses widely.
    """
    _libc().personality(ADDR_NO_RANDOMIZE)


def name_process(name: str) -> None:
    """Set the name that `ps` and `top` show (15 bytes)."""
    _libc().prctl(PR_SET_NAME, name.encode()[:15], 0, 0, 0)


def sharp_timers() -> None:
    """Let timers of this process fire within 1 ns instead of 50 us of slack (as far as the kernel can)."""
    _libc().prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)


def leave_signals_to_the_supervisor() -> None:
    """Ignore the signals that Ctrl-C and the like send to a whole group: the supervisor decides on the end."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


def begin_process(name: str, settings: Settings) -> None:
    """Set up a process of the robot: its name, its timers, its processor, its scheduling."""
    name_process(name)
    sharp_timers()
    leave_signals_to_the_supervisor()
    if settings.real_time:
        lock_memory()
    schedule(settings)


def schedule(settings: Settings) -> None:
    """Set the processor and the scheduling of this process, which its forks inherit."""
    stay_on(settings.processor)
    if settings.wants_fifo:
        real_time_scheduling()


def stay_on(processor: int | None) -> None:
    """Run on this processor only; None: any processor."""
    if processor is not None:
        os.sched_setaffinity(0, {processor})


def lock_memory() -> str:
    """Keep all pages in memory; returns why not, empty when it was permitted."""
    libc = _libc()
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        return ""
    return os.strerror(ctypes.get_errno())


def real_time_scheduling() -> str:
    """SCHED_FIFO for this process; returns why not, empty when it was permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
    except OSError as error:
        return error.strerror or str(error)
    return ""


def be_ordinary() -> None:
    """Give real-time scheduling back and run on any processor: for writing files."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.sched_setaffinity(0, range(os.cpu_count() or 1))


def processor_time_s(process: int) -> float:
    """Processor time a process has used (user and system), s; 0 when it is gone."""
    fields = _stat(process)
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK") if fields else 0.0


def slices_of(process: int) -> int:
    """How often a process got a processor; 0 where the kernel does not count it."""
    try:
        with open(f"/proc/{process}/schedstat", encoding="ascii") as file:
            return int(file.read().split()[2])
    except (OSError, IndexError):
        return 0


def state_of(process: int) -> str:
    """Letter of the state (R, S, D, T, t, Z), empty when it is gone; proc(5)."""
    fields = _stat(process)
    return fields[0] if fields else ""


def open_files(process: int) -> list[str]:
    """What the descriptors of a process lead to, as /proc lists it; those that may not be read are left out."""
    found = []
    folder = f"/proc/{process}/fd"
    try:
        numbers = os.listdir(folder)
    except OSError:
        return [EVENTFD]  # not listed for this user: nothing is known about it
    for number in numbers:
        with contextlib.suppress(OSError):
            found.append(os.readlink(f"{folder}/{number}"))
    return found


def waiting_in(process: int) -> str:
    """` (function)` of the kernel in which a process waits; empty where the kernel does not report it."""
    try:
        with open(f"/proc/{process}/wchan", encoding="ascii", errors="replace") as file:
            name = file.read()
    except OSError:
        return ""
    return f" ({name})" if name.isidentifier() else ""


def _stat(process: int) -> list[str]:
    """Fields of /proc/PID/stat after the name, which may hold spaces and brackets."""
    try:
        with open(f"/proc/{process}/stat", encoding="utf-8", errors="replace") as file:
            return file.read().rpartition(")")[2].split()
    except OSError:
        return []
