"""Confines a process that runs a program in C: what it can reach is its board's memory and the files that it reads.

`confine` is called in that process, before the program is loaded. It takes, as far as the kernel grants each:

- separate user, network, IPC and host-name namespaces, and no capabilities in any; with `fork`, one of process
  numbers;
- Landlock: it reads the interpreter, the system's libraries and the firmware's folder, and writes only where coverage
  and sanitizers keep their results;
- limits of memory, of the size of a file, of descriptors and of core dumps;
- a list of system calls (seccomp): files, memory, clocks and its own signals. Everything else fails with EPERM:
  sockets, processes, threads, other processes' memory, mounts, modules, keys.

`fork` starts such a process in a namespace of process numbers. The first process of one ignores signals that it sends
itself, so that `abort()` would go unnoticed; it is an init of ours, which only waits, and the board is the second. The
board is nevertheless a child of the process that called `fork`, which sees its signals and its end as of every child.
System calls that could use another process's number are refused as well.
"""

import contextlib
import ctypes
import dataclasses
import os
import pathlib
import platform
import re
import signal
import struct
import sys
from collections.abc import Callable, Collection, Iterable
from typing import NoReturn

from ranger_sim.foundation import descriptors, systems

MEMORY_BYTES = 512 << 20  # for a program beyond what the process has; the chip has 16 KB. Chosen by us
FILE_BYTES = 256 << 20  # of one file: what it prints, and its coverage. Chosen by us
DESCRIPTORS = 64  # beyond those that are open; chosen by us

CLONE_PARENT, CLONE_NEWPID = 0x00008000, 0x20000000  # sched.h
CLONE_NEWUTS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWNET = 0x04000000, 0x08000000, 0x10000000, 0x40000000  # sched.h
PR_SET_PDEATHSIG, PR_SET_DUMPABLE, PR_CAPBSET_DROP, PR_SET_NO_NEW_PRIVS = 1, 4, 24, 38  # linux/prctl.h
PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL = 47, 4
CAPABILITY_VERSION_3 = 0x20080522  # linux/capability.h
LAST_CAPABILITY = 63
LONG_S = 3600.0  # between two looks at a board that does not end
BOARD = 2  # its number in its namespace: the process after init
ERROR_NOT_PERMITTED = 1  # EPERM
MCL_CURRENT = 1  # sys/mman.h

# Landlock (linux/landlock.h): numbers of its system calls are those of every processor
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
CREATE_VERSION = 1
RULE_PATH_BENEATH = 1
EXECUTE, WRITE_FILE, READ_FILE, READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
REMOVE_FILE, MAKE_DIR, MAKE_REG, TRUNCATE = 1 << 5, 1 << 7, 1 << 8, 1 << 14
FILES_OF_VERSION = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 4: (1 << 15) - 1}  # later ones add devices
FILES_LATEST = (1 << 16) - 1
NET_BIND_CONNECT = 3  # from version 4
SCOPE_SOCKETS_SIGNALS = 3  # from version 6
OF_A_FILE = EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE

# seccomp (linux/seccomp.h, linux/audit.h, linux/filter.h)
SECCOMP_SET_MODE_FILTER = 1
RETURN_ALLOW, RETURN_ERROR, RETURN_KILL = 0x7FFF0000, 0x00050000, 0x80000000
LOAD, JUMP_EQUAL, JUMP_GREATER_EQUAL, RETURN = 0x20, 0x15, 0x35, 0x06
AT_NUMBER, AT_ARCHITECTURE, AT_ARGUMENTS = 0, 4, 16
X32_BIT = 0x40000000  # system calls of the x32 ABI, which the numbers below do not name


@dataclasses.dataclass(frozen=True)
class Processor:
    """The numbers of a processor's system calls (asm/unistd_64.h, asm-generic/unistd.h)."""

    architecture: int  # AUDIT_ARCH_*
    clone: int
    seccomp: int
    capset: int
    close_range: int
    free: tuple[int, ...]  # with any arguments
    to_itself: tuple[int, ...]  # the first argument is this process
    fcntl: int
    prlimit: int


PROCESSORS = {
    "x86_64": Processor(
        0xC000003E, 56, 317, 126, 436,
        free=(
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 17, 18, 19, 20, 21, 23, 24, 25, 26, 27, 28, 32,
            33, 34, 35, 36, 37, 38, 39, 60, 63, 74, 75, 77, 78, 79, 83, 87, 89, 95, 96, 97, 98, 99, 100, 102, 104,
            107, 108, 110, 127, 128, 130, 131, 186, 201, 202, 204, 217, 219, 221, 228, 229, 230, 231, 257, 258, 262,
            263, 267, 269, 270, 271, 273, 292, 318, 332, 334, 436, 439,
        ),
        to_itself=(62, 200, 234, 310),  # kill, tkill, tgkill, process_vm_readv
        fcntl=72, prlimit=302,
    ),
    "aarch64": Processor(
        0xC00000B7, 220, 277, 91, 436,
        free=(
            17, 23, 24, 34, 35, 46, 48, 56, 57, 61, 62, 63, 64, 65, 66, 67, 68, 72, 73, 78, 79, 80, 82, 83, 93, 94,
            98, 99, 101, 102, 103, 113, 114, 115, 123, 124, 128, 132, 133, 134, 135, 136, 137, 139, 153, 160, 163,
            165, 166, 169, 172, 173, 174, 175, 176, 177, 178, 179, 214, 215, 216, 222, 223, 226, 227, 232, 233, 278,
            291, 293, 436, 439,
        ),
        to_itself=(129, 130, 131, 270),
        fcntl=25, prlimit=261,
    ),
}  # fmt: skip
FCNTL_COMMANDS = (0, 1, 2, 3, 4, 1030)  # duplicate, flags: no owner, lease or signal


@dataclasses.dataclass(frozen=True)
class Needs:
    """What a program needs beyond the usual. read, write: folders or files. large_memory: it was compiled with the
    address sanitizer, whose table takes terabytes of addresses.
    """

    read: tuple[pathlib.Path, ...] = ()
    write: tuple[pathlib.Path, ...] = ()
    large_memory: bool = False

    @property
    def has_own_numbers(self) -> bool:
        """Whether its process can have separate process numbers: the address sanitizer names its files by them."""
        return not self.large_memory


def unavailable() -> str:
    """Why no process can be confined on this system; empty where it can."""
    if not systems.is_linux():
        return f"confinement needs Linux, this is {sys.platform}"
    if platform.machine() not in PROCESSORS or sys.maxsize < 1 << 32:
        return f"the system calls of {platform.machine()} are not known here"
    return ""


def describe(lacks: Iterable[str] | None) -> str:
    """`yes`, or `partly (...)`; None: `no`."""
    if lacks is None:
        return "no"
    lacking = "; ".join(lacks)
    return f"partly ({lacking})" if lacking else "yes"


LAUNCHERS: dict[int, int] = {}  # by the process that `fork` returned: the one that ends after it
# Why this process has no separate process numbers; empty where it has.
without_numbers = "not asked for"


def fork(has_own_numbers: bool, prepare: Callable[[], object] = lambda: None) -> int:
    """As os.fork; has_own_numbers: into a namespace of process numbers, where the kernel grants it (`confine` reports
    it). Such a child ends with this process, in whatever way that ends; its `os.getppid()` is 0.

    prepare: called with the rights of this process; what it does is inherited, such as scheduling.
    """
    if not has_own_numbers or unavailable():
        return os.fork()
    reading, writing = os.pipe()
    parent = os.getpid()
    launcher = os.fork()
    if launcher == 0:
        os.close(reading)
        prepare()
        _launch(writing, parent)
        return 0
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        number = int(pipe.read() or launcher)  # nothing: it ended early, which its parent will see
    if number != launcher:
        LAUNCHERS[number] = launcher
    return number


def wait_for(process: int) -> int:
    """Wait until nothing of a process that `fork` returned is left; its code, as os.waitstatus_to_exitcode has it."""
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    if launcher := LAUNCHERS.pop(process, 0):
        with contextlib.suppress(ChildProcessError):  # the caller waits for every child
            os.waitpid(launcher, 0)
    return code


def _launch(report: int, parent: int) -> None:
    """In the launcher: start the namespace's init and the board, which returns; without a namespace it is the board."""
    global without_numbers  # noqa: PLW0603  (of this process, for its `confine`)
    libc = ctypes.PyDLL(None, use_errno=True)  # one that keeps the interpreter's lock while it clones
    user, group = os.getuid(), os.getgid()
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    number, init = 0, 0
    if libc.unshare(CLONE_NEWUSER | CLONE_NEWPID) == 0:
        _map_itself(user, group)
        libc.prctl(PR_SET_DUMPABLE, 1, 0, 0, 0)
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        (begun, init_begun), (board_begun, begin) = os.pipe(), os.pipe()
        init = os.fork()
        if init == 0:
            os.close(begin)
            _be_init(libc, init_begun, board_begun)
        os.close(init_begun)
        os.close(board_begun)
        os.read(begun, 1)  # it ends with this process from now on
        os.close(begun)
        flags = ctypes.c_ulong(CLONE_PARENT | signal.SIGCHLD)
        number = libc.syscall(PROCESSORS[platform.machine()].clone, flags, None, None, None, None)
        if number == 0:
            os.close(begin)
            os.close(report)
            without_numbers = ""
            return
        if number > 0:
            os.write(begin, b"+")
        os.close(begin)
    without_numbers = os.strerror(ctypes.get_errno())
    if os.getppid() != parent:
        os._exit(1)
    os.write(report, str(number if number > 0 else os.getpid()).encode())
    os.close(report)
    if number > 0:
        _wait_silently(libc)
        os.waitpid(init, 0)
        os._exit(0)


def _be_init(libc: ctypes.CDLL, has_begun: int, board_has_begun: int) -> NoReturn:
    """The first process of the namespace: ends with the board, its second process, and with its parent."""
    try:
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        os.write(has_begun, b"+")
        os.close(has_begun)
        _wait_silently(libc, board_has_begun)
        if os.read(board_has_begun, 1):
            watch = os.pidfd_open(BOARD)
            while not descriptors.wait([watch], [], LONG_S)[0]:
                pass
    finally:
        os._exit(0)


def _wait_silently(libc: ctypes.CDLL, *keep: int) -> None:
    """Keep no descriptor open but these, and leave Ctrl-C and the like to others."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    _keep_descriptors(libc, PROCESSORS[platform.machine()], keep)
    for output in (1, 2):
        os.dup2(0, output)


def confine(needs: Needs, keep: Collection[int]) -> list[str]:
    """Confine this process for the rest of its life; returns what could not be had, in words.

    keep: descriptors that stay open next to 0, 1 and 2; descriptor 0 becomes empty. The process must have one thread.
    """
    if why := unavailable():
        return [why]
    numbers = PROCESSORS[platform.machine()]
    libc = ctypes.CDLL(None, use_errno=True)
    parent = os.getppid()
    lacks = [f"no separate process numbers: {without_numbers}"] if without_numbers else []
    if _locks_memory():  # what is locked stays so; what comes later cannot be, without the right to it
        libc.munlockall()
        libc.mlockall(MCL_CURRENT)
    _keep_descriptors(libc, numbers, keep)
    _limit(needs, lacks)
    user, group = os.getuid(), os.getgid()
    if libc.unshare(CLONE_NEWUSER | CLONE_NEWNET | CLONE_NEWIPC | CLONE_NEWUTS) != 0:
        lacks.append(f"no separate namespaces: {os.strerror(ctypes.get_errno())}")
    else:
        _map_itself(user, group)
    libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    _drop_capabilities(libc, numbers)
    # other rights may have cleared both: it ends with its parent, and a debugger of its user may attach
    libc.prctl(PR_SET_DUMPABLE, 1, 0, 0, 0)
    libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
    if why := _restrict_files(libc, needs):
        lacks.append(f"files are not restricted: {why}")
    if why := _restrict_calls(libc, numbers):
        lacks.append(f"system calls are not restricted: {why}")
    return lacks


def _locks_memory() -> bool:
    """Whether memory of this process is locked."""
    status = pathlib.Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    return not re.search(r"^VmLck:\s+0 kB$", status, re.MULTILINE)


def _keep_descriptors(libc: ctypes.CDLL, numbers: Processor, keep: Collection[int]) -> None:
    """Close everything that was inherited but is not needed, such as sockets and the memory of other boards."""
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    first = 3
    for descriptor in (*sorted(each for each in keep if each > 2), 1 << 31):
        if descriptor > first:
            libc.syscall(numbers.close_range, ctypes.c_uint(first), ctypes.c_uint(descriptor - 1), 0)
        first = descriptor + 1


def _limit(needs: Needs, lacks: list[str]) -> None:
    """Limits that the kernel holds; the time that a turn may compute is limited by the runtime."""
    import resource  # only here: POSIX

    def lower(kind: int, value: int) -> None:
        hard = resource.getrlimit(kind)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(kind, (value, value))

    if needs.large_memory:
        lacks.append("memory is not limited: the address sanitizer needs terabytes of addresses")
    else:
        pages = int(pathlib.Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        lower(resource.RLIMIT_AS, pages * resource.getpagesize() + MEMORY_BYTES)
    lower(resource.RLIMIT_FSIZE, FILE_BYTES)
    lower(resource.RLIMIT_CORE, 0)
    highest = max(int(each) for each in os.listdir("/proc/self/fd"))
    lower(resource.RLIMIT_NOFILE, highest + 1 + DESCRIPTORS)


def _map_itself(user: int, group: int) -> None:
    """In the new user namespace this user is itself, and no other exists."""
    for name, text in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
        try:
            pathlib.Path(f"/proc/self/{name}").write_text(text, encoding="ascii")
        except OSError:  # without a map it is the overflow user: fewer rights
            return


def _drop_capabilities(libc: ctypes.CDLL, numbers: Processor) -> None:
    """No capability, now or after starting a program."""
    libc.prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0)
    for capability in range(LAST_CAPABILITY + 1):
        libc.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)
    head, none = struct.pack("II", CAPABILITY_VERSION_3, 0), bytes(24)
    libc.syscall(numbers.capset, head, none)


def _restrict_files(libc: ctypes.CDLL, needs: Needs) -> str:
    """Landlock; returns why not."""
    version = libc.syscall(CREATE_RULESET, None, ctypes.c_size_t(0), CREATE_VERSION)
    if version < 1:
        return f"no Landlock: {os.strerror(ctypes.get_errno())}"
    handled = FILES_OF_VERSION.get(version, FILES_LATEST)
    words = [handled, *([NET_BIND_CONNECT] if version >= 4 else []), *([SCOPE_SOCKETS_SIGNALS] if version >= 6 else [])]
    attributes = struct.pack(f"{len(words)}Q", *words)
    rules = libc.syscall(CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    if rules < 0:
        return f"Landlock: {os.strerror(ctypes.get_errno())}"
    reading, writing = (
        EXECUTE | READ_FILE | READ_DIR,
        WRITE_FILE | READ_FILE | READ_DIR | MAKE_DIR | MAKE_REG | TRUNCATE,
    )
    allowed = [(path, reading) for path in (*usual_reading(), *needs.read)]
    allowed += [(path, (writing | REMOVE_FILE) & handled) for path in needs.write]
    try:
        for path, rights in allowed:
            try:
                place = os.open(path, os.O_PATH | os.O_CLOEXEC)
            except OSError:  # nothing there: nothing to read
                continue
            rights &= -1 if os.path.isdir(path) else OF_A_FILE
            libc.syscall(ADD_RULE, rules, RULE_PATH_BENEATH, struct.pack("=Qi", rights, place), 0)
            os.close(place)
        if libc.syscall(RESTRICT_SELF, rules, 0) != 0:
            return f"Landlock: {os.strerror(ctypes.get_errno())}"
    finally:
        os.close(rules)
    return ""


def usual_reading() -> list[pathlib.Path]:
    """What every such process reads: the interpreter and its packages, this package, the system's libraries."""
    here = pathlib.Path(__file__).resolve().parents[2]
    own = [here / name for name in sorted(os.listdir(here)) if (here / name / "__init__.py").is_file()]
    prefixes = {sys.prefix, sys.base_prefix, sys.exec_prefix}
    packages = [pathlib.Path(prefix) / "lib" for prefix in sorted(prefixes)]
    system = [pathlib.Path(each) for each in ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/etc/ld.so.cache")]
    kernel = [pathlib.Path(each) for each in ("/proc/self", "/dev/null", "/dev/zero", "/dev/urandom")]
    return [*own, here / "build", *packages, *system, *kernel]


def _restrict_calls(libc: ctypes.CDLL, numbers: Processor) -> str:
    """The list of system calls; returns why not."""
    code = program_of(numbers, os.getpid())
    filter_ = ctypes.create_string_buffer(code, len(code))
    head = struct.pack("HxxxxxxP", len(code) // 8, ctypes.addressof(filter_))
    if libc.syscall(numbers.seccomp, SECCOMP_SET_MODE_FILTER, 0, head) != 0:
        return f"no seccomp: {os.strerror(ctypes.get_errno())}"
    return ""


def program_of(numbers: Processor, process: int) -> bytes:
    """The filter as a program of the kernel's packet filter, 8 bytes an instruction."""

    def step(code: int, value: int, then: int = 0, other: int = 0) -> bytes:
        return struct.pack("HBBI", code, then, other, value)

    def argument(number: int) -> int:
        return AT_ARGUMENTS + 8 * number  # its low half; both processors are little-endian

    allow, refuse = step(RETURN, RETURN_ALLOW), step(RETURN, RETURN_ERROR | ERROR_NOT_PERMITTED)
    code = [step(LOAD, AT_ARCHITECTURE), step(JUMP_EQUAL, numbers.architecture, 1), step(RETURN, RETURN_KILL)]
    code += [step(LOAD, AT_NUMBER), step(JUMP_GREATER_EQUAL, X32_BIT, 0, 1), refuse]
    for each in numbers.free:
        code += [step(JUMP_EQUAL, each, 0, 1), allow]
    for each in numbers.to_itself:
        code += [step(JUMP_EQUAL, each, 0, 4), step(LOAD, argument(0)), step(JUMP_EQUAL, process, 0, 1), allow, refuse]
    commands = [part for each in FCNTL_COMMANDS for part in (step(JUMP_EQUAL, each, 0, 1), allow)]
    code += [step(JUMP_EQUAL, numbers.fcntl, 0, len(commands) + 2), step(LOAD, argument(1)), *commands, refuse]
    # limits are read, not set: both halves of the address of a new one are 0
    reads = [step(LOAD, argument(2)), step(JUMP_EQUAL, 0, 0, 3), step(LOAD, argument(2) + 4), step(JUMP_EQUAL, 0, 0, 1)]
    code += [step(JUMP_EQUAL, numbers.prlimit, 0, len(reads) + 2), *reads, allow, refuse]
    return b"".join([*code, refuse])
