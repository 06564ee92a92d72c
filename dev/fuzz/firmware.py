"""Hostile firmware: generated programs in C, and images, each as the hip board of a separate walk.

A case is a program of one to three hostile pieces (signals, exits, descriptors, memory, stack, control flow, tables,
calls, output) at places where a program runs: a constructor, the start, a task, an interrupt. Every sixth case is an
image: random instructions, or ELF files with pieces exchanged. `walk` runs in a forked process. After it: it has
ended in time with a code that agrees with its summary, a lost board has a cause, a refusal is one line, standard output
is JSON and nothing else, and no process, file or shared memory is left.

`--state FILE` keeps the counts after each case; a later run of the same seed goes on there.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import pathlib
import signal
import struct
import sys
import tempfile
import warnings
from typing import Any

from dev.fuzz import Finding
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.cli import main

DEADLINE = "2s"  # for an answer of the board's process: the same mechanism as with 10 s
LONGEST_S = 120.0  # of a case: the compiler and a busy machine included. Chosen by us
LARGEST_OUTPUT = 1 << 26
WALKED = "30ms"  # of the robot: the pieces run from the tenth slot of 0.5 ms on
CODES = (0, 1, 2)
IMAGE_EVERY = 6

# What a piece needs at the top of the file. fork and pthread_create fail with EPERM where system calls are restricted;
# elsewhere the loops around them end.
HEAD = """#define _GNU_SOURCE
#pragma GCC diagnostic ignored "-Wall"
#include <ranger_sim/firmware.h>
#include "mch_table.h"
#include <alloca.h>
#include <fcntl.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
void quick_exit(int);
static volatile uint32_t sink, slots;
static jmp_buf earlier;
extern int64_t fw_mail[32];
extern int64_t (*fw_answer)(void *, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t);
extern void *fw_host;
static void *thread(void *with) { for (;;) sink++; return with; }
static void again(int number) { sink += number; }
static uint32_t deeper(uint32_t depth)
{
    volatile uint32_t here[200];
    here[depth % 200] = depth;
    return depth == 0xFFFFFFFFu ? 0 : deeper(depth + 1) + here[depth % 200];
}
static void over_shared(int how, uint64_t value)
{
    char line[512];
    FILE *list = fopen("/proc/self/maps", "r");
    unsigned long first[64], end[64];
    int count = 0;
    while (list && count < 64 && fgets(line, sizeof line, list))
        if (strstr(line, " rw-s ") && sscanf(line, "%lx-%lx", &first[count], &end[count]) == 2)
            count++;
    if (list)
        fclose(list);
    for (int part = 0; part < count; part++)
        for (uint64_t *at = (uint64_t *)first[part]; at < (uint64_t *)end[part]; at++)
            if (how == 0 || (how == 1 && rand() % 50 == 0))
                *at = how == 0 ? value : ((uint64_t)rand() << 32 ^ (uint64_t)rand());
            else if (how == 2)
                (*at)++;
}
"""

# By name; %(n)d: a small number, %(s)d: a signal, %(w)d: any word, %(d)d: a descriptor.
PIECES = {
    "signal": "raise(%(s)d);",
    "signal to itself": "kill(getpid(), %(s)d);",
    "signals blocked": "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); for (;;) sink++;",
    "signals blocked, asleep": "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); for (;;) pause();",
    "signals ignored": "for (int each = 1; each < 65; each++) signal(each, SIG_IGN); for (;;) sink++;",
    "signals handled": "for (int each = 1; each < 65; each++) signal(each, again); *(volatile int *)8 = 1;",
    "timer off": "struct itimerval none; memset(&none, 0, sizeof none); "
    "setitimer(ITIMER_PROF, &none, 0); for (;;) sink++;",
    "alarm": "alarm(1);",
    "handlers default": "for (int each = 1; each < 32; each++) signal(each, SIG_DFL); *(volatile int *)%(n)d = 1;",
    "exit": "exit(%(n)d);",
    "_exit": "_exit(%(n)d);",
    "quick_exit": "quick_exit(%(n)d);",
    "abort": "abort();",
    "exit at exit": "atexit((void (*)(void))abort); exit(0);",
    "exit by the kernel": "syscall(SYS_exit_group, %(n)d);",
    "exit of the thread": "syscall(SYS_exit, %(n)d);",
    "descriptors closed": "for (int each = 0; each < 1024; each++) close(each);",
    "one descriptor closed": "close(%(d)d);",
    "descriptors reused": 'int it = open("/dev/null", O_RDWR); for (int each = 0; each < 40; each++) dup2(it, each);',
    "one descriptor reused": 'int it = open("/dev/zero", O_RDONLY); dup2(it, %(d)d);',
    "descriptors written": "for (int each = 0; each < 40; each++) { uint64_t one = 1; "
    "if (write(each, &one, 8) < 0) sink++; }",
    "descriptors read": "for (int each = 0; each < 40; each++) { char some[64]; fcntl(each, F_SETFL, O_NONBLOCK); "
    "if (read(each, some, 64) < 0) sink++; }",
    "read for ever": "char some[64]; for (;;) if (read(%(d)d, some, 64) < 0) sink++;",
    "descriptors used up": 'while (open("/dev/null", O_RDONLY) >= 0) sink++;',
    "block filled": "over_shared(0, %(w)dull);",
    "block zeroed": "over_shared(0, 0);",
    "block scribbled": "srand(%(w)d); over_shared(1, 0);",
    "block counted up": "for (;;) over_shared(2, 0);",
    "block counted up, blocked": "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); "
    "for (;;) over_shared(2, 0);",
    "answers out of order": "for (int each = 0; each < 200; each++) { over_shared(2, 0); uint64_t one = 1; "
    "for (int to = 3; to < 12; to++) if (write(to, &one, 8) < 0) sink++; }",
    "mail": "for (int each = 0; each < 32; each++) fw_mail[each] = %(w)d;",
    "host of calls moved": "fw_host = (char *)fw_host + 8 * (%(n)d + 3);",
    "calls removed": "fw_answer = 0;",
    "threads": "pthread_t it; for (int each = 0; each < 8; each++) sink += pthread_create(&it, 0, thread, 0);",
    "forks": "for (int each = 0; each < 4; each++) if (fork() == 0) "
    "for (int turn = 0; turn < 100; turn++) usleep(10000);",
    "another program": 'char *none[] = {0}; execve("/bin/true", none, none);',
    "traced": "syscall(SYS_ptrace, 0, 0, 0, 0); raise(SIGSTOP);",
    "outlives its parent": "prctl(PR_SET_PDEATHSIG, 0); prctl(PR_SET_DUMPABLE, 0);",
    "sockets": "sink += socket(AF_INET, SOCK_STREAM, 0); sink += socket(AF_UNIX, SOCK_STREAM, 0);",
    "recursion": "sink = deeper(sink);",
    "huge stack": "volatile char *much = alloca(1u << 30); much[0] = 1; sink += much[0];",
    "stack overwritten": "volatile char here[8]; memset((void *)here, %(n)d, 4096);",
    "jump to a function that has returned": "longjmp(earlier, 1);",
    "jump to nowhere": "((void (*)(void))(uintptr_t)%(w)dull)();",
    "null": "*(volatile int *)0 = 1;",
    "instruction": "__builtin_trap();",
    "memory used up": "for (;;) { char *much = malloc(1 << 22); if (!much) break; memset(much, 1, 1 << 22); }",
    "memory unmapped": "munmap((void *)((uintptr_t)&sink & ~4095ull), 4096); sink++;",
    "memory protected": "mprotect((void *)((uintptr_t)&sink & ~4095ull), 4096, PROT_NONE); sink++;",
    "computing": "for (;;) sink++;",
    "asking the chip": "for (;;) sink += fw_slot_cycles();",
    "asleep": "pause();",
    "asleep for long": "struct timespec it = {100, 0}; nanosleep(&it, 0);",
    "yielding": "for (;;) syscall(SYS_sched_yield);",
    "stopped": "raise(SIGSTOP);",
    "double start": "fw_can_start(1, 0x00254001, 0); fw_can_start(%(n)d, %(w)d, %(w)d);",
    "unknown devices": "fw_timer_start(%(n)d, %(w)d, 1); fw_adc_start(%(n)d); fw_spi_transfer(%(n)d);",
    "unknown pins": "fw_pin_write(%(w)d, 1); fw_capture_connect(%(n)d, %(n)d, %(w)d);",
    "frames": "fw_can_frame it = {%(w)d, %(w)d, %(w)d, %(w)d}; for (int each = 0; each < 9; each++) "
    "fw_can_transmit(each %% 5, each, &it);",
    "time": "fw_spend(%(w)du); fw_idle();",
    "interrupts": "fw_request(%(n)d, %(w)d); fw_detach(%(n)d, 0);",
    "output": 'for (int each = 0; each < 20000; each++) printf("%%d {\\"a\\": [", each);',
    "bytes": 'for (int each = 0; each < 4096; each++) putchar(each); fputs("\\033[2J\\033]0;x\\007", stderr);',
    "output for ever": 'for (;;) if (write(1, "0123456789abcdef", 16) < 0) sink++;',
}
PLACES = ("task", "start", "constructor", "handler", "schedule")
OFTEN = 3  # of five cases, a task

PROGRAM = """
__attribute__((noinline)) static void %(name)s(void)
{
    %(pieces)s
}
"""
BODY = """
%(constructor)s
static int32_t control(void)
{
    if (!slots)
        setjmp(earlier);
    if (++slots == 10) { %(task)s; }
    return 0;
}
static int32_t handler(void) { %(handler)s; return 0; }
static const fw_task every[] = {{control, "control", 20, 30}};
static const fw_schedule schedule = {%(schedule)s};
void firmware_start(void)
{
    fw_interrupt it = {.kind = FW_TIMER_MATCH, .index = 1, .handler = handler, .name = "it", .cost = 20, .vic_slot = 3};
    (void)it;
    fw_can_start(1, 0x00254001, 0);
    %(start)s;
}
const fw_schedule *firmware_schedule(void) { %(before)s; return %(which)s; }
uint32_t firmware_table_version(void) { return %(version)s; }
"""
GOOD = ".slot_ns = 500000, .every = FW_TASKS(every), .tick_cost = 60, .tick_vic_slot = 4"
SCHEDULES = (
    (".slot_ns = 0, .every = FW_TASKS(every)", "&schedule"),
    (".slot_ns = 4000000000u, .every = FW_TASKS(every), .tick_vic_slot = 99", "&schedule"),
    (".slot_ns = 1, .every = FW_TASKS(every), .tick_vic_slot = 4", "&schedule"),
    (".slot_ns = 500000, .every = {every, 4000000000u}, .tick_vic_slot = 4", "&schedule"),
    (".slot_ns = 500000, .every = {(const fw_task *)8, 1}, .tick_vic_slot = 4", "&schedule"),
    (".slot_ns = 500000, .every = {0, 1}, .tick_vic_slot = 4", "&schedule"),
    (GOOD, "0"),
    (GOOD, "(const fw_schedule *)4096"),
)
MANIFEST = "[firmware]\nname = 'small'\ntables = ['mch']\n"


class Fuzz:
    """`case(number)` is one case; Finding as soon as a check fails. A case depends on seed and number only."""

    def __init__(self, seed: int, folder: pathlib.Path) -> None:
        self.seed = seed
        self.folder = folder
        self.counts = {"cases": 0, "refused": 0, "lost": 0, "went_on": 0, "images": 0, "longest_s": 0}

    def case(self, number: int) -> None:
        """Generate a program, walk with it, check everything."""
        self.stream: Any = RandomStream(self.seed, f"firmware fuzz {number}")
        folder = self.folder / str(number)
        folder.mkdir()
        is_image = number % IMAGE_EVERY == IMAGE_EVERY - 1
        what = self.image(folder) if is_image else self.program(folder)
        where = f"case {number} ({what})"
        began_s = wallclock.monotonic_s()
        code, output, errors = self.walk(folder, is_image, where)
        self.counts["longest_s"] = max(self.counts["longest_s"], round(wallclock.monotonic_s() - began_s))
        self.counts["cases"] += 1
        self.counts["images"] += is_image
        self.check(code, output, errors, where)
        for path in sorted(folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        folder.rmdir()

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def one_of(self, of: Any) -> Any:
        """One of a sequence."""
        return of[self.number(len(of))]

    # --- programs -----------------------------------------------------------------------------------------

    def program(self, folder: pathlib.Path) -> str:
        """Write a program; returns what is in it."""
        place = "task" if self.number(5) < OFTEN else self.one_of(PLACES)
        names = [self.one_of(sorted(PIECES)) for _ in range(1 + self.number(3))]
        values = {"n": self.number(9), "s": 1 + self.number(64), "w": self.number(1 << 31), "d": self.number(12)}
        functions = [{"name": f"piece{i}", "pieces": PIECES[name] % values} for i, name in enumerate(names)]
        pieces = "".join(PROGRAM % each for each in functions)
        calls = " ".join(f"piece{i}();" for i in range(len(names)))
        parts = {"task": "", "start": "", "handler": "", "before": "", "constructor": ""}
        parts.update(schedule=GOOD, which="&schedule", version="RANGER_TABLE_VERSION")
        if place == "constructor":
            parts["constructor"] = f"__attribute__((constructor)) static void early(void) {{ {calls} }}"
        elif place == "schedule":
            parts["schedule"], parts["which"] = self.one_of(SCHEDULES)
            parts["task"] = calls
            names.insert(0, parts["schedule"])
            if self.number(4) == 0:
                parts["version"] = str(values["w"])
        elif place == "handler":
            parts["handler"] = calls
            parts["start"] = "fw_timer_start(1, 6000, 1); fw_attach(&it)"
        else:
            parts[place] = calls
        (folder / "small.c").write_text(HEAD + pieces + BODY % parts, encoding="utf-8")
        (folder / "firmware.toml").write_text(MANIFEST, encoding="utf-8")
        return f"{place}: {', '.join(names)}"

    # --- images -------------------------------------------------------------------------------------------

    def image(self, folder: pathlib.Path) -> str:
        """Write an image; returns its kind."""
        words = [self.number(1 << 32) for _ in range(16 + self.number(200))]
        kind = self.one_of(("instructions", "vectors to code", "empty vectors", "aborts", "sizes", "pieces"))
        if kind != "instructions":
            words[:8] = [0xEA000006, *[0xFFFFFFFF if kind == "empty vectors" else 0xEAFFFFFE] * 7]
        if kind == "aborts":  # ldr r0, =somewhere; ldr, str, bx or an undefined instruction
            words[8:12] = [0xE51F0000 | 0, 0xE3A00000 | self.number(4096), self.one_of((0xE5901000, 0xE5801000,
                           0xE12FFF10, 0xE7F000F0)), 0xEAFFFFFE]  # fmt: skip
        content = struct.pack(f"<{len(words)}I", *words)
        file = bytearray(elf(content))
        if kind == "sizes":
            for at in (28, 32, 44, 48, 56, 60, 64, 68, 72):
                if self.number(2):
                    file[at : at + 4] = struct.pack("<I", self.one_of((0, 1, 1 << 16, 1 << 31, (1 << 32) - 1)))
        elif kind == "pieces":
            for _ in range(1 + self.number(8)):
                file[self.number(84)] = self.number(256)
        (folder / "small.elf").write_bytes(file)
        return f"image of {kind}"

    # --- the walk -----------------------------------------------------------------------------------------

    def walk(self, folder: pathlib.Path, is_image: bool, where: str) -> tuple[int, bytes, str]:
        """Walk in a forked process; exit code, standard output, standard error."""
        what = ["--image", f"MCH={folder / 'small.elf'}"] if is_image else ["--firmware", f"MCH={folder}"]
        command = ["walk", "--time", WALKED, *what, "--json", "-", "--log", "none", "--board-deadline", DEADLINE]
        places = [folder / name for name in ("stdout", "stderr")]
        temporary = folder / "temporary"
        temporary.mkdir()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # other threads: the child needs none of them
            sys.stdout.flush()
            sys.stderr.flush()
            process = os.fork()
        if process == 0:
            _walk(command, places, temporary)
        watch = os.pidfd_open(process)
        has_ended = bool(descriptors.wait([watch], [], LONGEST_S)[0])
        os.close(watch)
        left = processes_of(process)
        if not has_ended:
            os.killpg(process, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        if not has_ended:
            raise Finding(f"{where}: it has not ended after {LONGEST_S:g} s")
        if left - {process}:
            raise Finding(f"{where}: {len(left) - 1} processes are left")
        shared = [name for name in os.listdir("/dev/shm") if "ranger" in name]  # others are of other programs
        if left_files := shared + os.listdir(temporary):
            raise Finding(f"{where}: files are left: {left_files}")
        if places[0].stat().st_size > LARGEST_OUTPUT:
            raise Finding(f"{where}: {places[0].stat().st_size} bytes on standard output")
        return code, places[0].read_bytes(), places[1].read_text(encoding="utf-8", errors="replace")

    def check(self, code: int, output: bytes, errors: str, where: str) -> None:
        """The exit code, the summary and the messages agree."""
        if "Traceback" in errors or code not in CODES:
            raise Finding(f"{where}: code {code}: {errors[-2000:]}")
        if code == 2:  # noqa: PLR2004  (a user's mistake: argparse's code)
            if output or not errors.startswith("ranger-sim: "):
                raise Finding(f"{where}: refused, but: {output[:200]!r} {errors[:500]}")
            self.counts["refused"] += 1
            return
        try:
            summary = json.loads(output)
        except ValueError:
            raise Finding(f"{where}: standard output is not JSON: {output[:200]!r}") from None
        failed = summary["failed_boards"]
        if code != (1 if summary["fell"] or failed else 0):
            raise Finding(f"{where}: code {code}, failed boards {failed}")
        lost = summary["firmware"].get("MCH", {}) if "firmware" in summary else {}
        if "MCH" in failed and not lost.get("why") and "lost_s" in lost:
            raise Finding(f"{where}: lost without a cause")
        self.counts["lost" if failed else "went_on"] += 1


def _walk(command: list[str], places: list[pathlib.Path], temporary: pathlib.Path) -> None:
    """In the forked process, which ends here: the command, with its output in files."""
    code = 99
    try:
        os.setpgid(0, 0)
        for number, place in enumerate(places, start=1):
            file = os.open(place, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            os.dup2(file, number)
            os.close(file)
        sys.stdout, sys.stderr = (
            os.fdopen(os.dup(number), "w", encoding="utf-8", errors="backslashreplace") for number in (1, 2)
        )
        tempfile.tempdir = str(temporary)
        os.environ["TMPDIR"] = str(temporary)
        code = main(command)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001  (it must never return into the fuzzer)
        import traceback

        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def processes_of(group: int) -> set[int]:
    """The processes of a process group, zombies left out."""
    found = set()
    for name in os.listdir("/proc"):
        if name.isdecimal():
            with contextlib.suppress(OSError):
                fields = pathlib.Path(f"/proc/{name}/stat").read_text(encoding="utf-8", errors="replace")
                state, _parent, its_group = fields.rpartition(")")[2].split()[:3]
                if int(its_group) == group and state != "Z":
                    found.add(int(name))
    return found


def elf(content: bytes) -> bytes:
    """An executable for the chip with one segment at the beginning of the flash."""
    head = struct.pack("<16sHHIIIIIHHHHHH", b"\x7fELF\x01\x01\x01", 2, 40, 1, 0, 52, 0, 0x05000000, 52, 32, 1, 40, 0, 0)
    return head + struct.pack("<8I", 1, 84, 0, 0, len(content), len(content), 5, 4) + content


def run(cases: int, seed: int, state: pathlib.Path | None = None) -> dict[str, int]:
    """`cases` cases; the counts. state: a file in which an earlier run of this seed has kept its counts."""
    for name in ("harness.processes.forked_boards", "firmware_sim.native.library", "tools.run.walk", "ranger.robot"):
        importlib.import_module(f"ranger_sim.{name}")  # here once, and not in every forked process
    with tempfile.TemporaryDirectory(prefix="ranger-sim-fuzz-") as folder:
        fuzz = Fuzz(seed, pathlib.Path(folder))
        if state is not None and state.is_file():
            kept = json.loads(state.read_text(encoding="utf-8"))
            if kept["seed"] != seed:
                raise UserError(f"{state}: seed {kept['seed']}, not {seed}")
            fuzz.counts = kept["counts"]
        while fuzz.counts["cases"] < cases:
            fuzz.case(fuzz.counts["cases"])
            if state is not None:
                state.write_text(json.dumps({"seed": seed, "counts": fuzz.counts}), encoding="utf-8")
        return fuzz.counts
