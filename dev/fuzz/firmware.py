"""Hostile firmware: generated programs in C, and images, each as the hip board of a separate walk.

A case is a program of one to three hostile pieces (signals, exits, descriptors, memory, stack, control flow, tables,
calls, output) at places where a program runs: a constructor, the start, a task, an interrupt. One library has every
piece and is compiled once; each case writes the file `choice`, which the library reads before its other constructors.
Every hundredth case is compiled for itself. Every sixth case is an image: random instructions, or ELF files with pieces
exchanged. `walk` runs in a forked process. After it: it has ended in time with a code that agrees with its summary, a
lost board has a cause, a refusal says so after what the program printed, standard output is JSON and nothing else, and
no process, file or shared memory is left.

A board's process has half a second for an answer, in every hundredth case the default of ten; the case has ten seconds
more than that, and the time in which processes of the machine waited for a processor, up to five minutes.

`--state FILE` keeps the counts after each case; a later run of the same seed goes on there.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import io
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
from dev.load import waited_s
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.cli import main

DEADLINE_S = 0.5  # for an answer of the board's process: the same mechanism as with the default, which tries the
USUAL_S = 10.0  # ... limit of the processor's time as well
COMPILING_S = 120.0  # as deadline of the first walk, which compiles
MORE_S = 10.0  # of a case, beyond the deadline: start, walk and end on a busy machine. Chosen by us
LONGEST_S = 300.0  # the same, however busy the machine is
LARGEST_OUTPUT = 1 << 26
WALKED = "30ms"  # of the robot: the pieces run from the tenth slot of 0.5 ms on
CODES = (0, 1, 2)
IMAGE_EVERY = 6
USUAL_EVERY = 100  # compiled for itself, with the default deadline: seconds of a processor each

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
static volatile uint32_t sink, slots, handled;
static uint32_t place, which, version, n, s, w, d, acts[3], act_count;
static jmp_buf earlier;
extern int64_t fw_mail[32];
extern int64_t (*fw_answer)(void *, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t);
extern void *fw_host;
static void *thread(void *with) { for (;;) sink++; return with; }
static void again(int number) { sink += number; }
static void away(int number) { (void)number; longjmp(earlier, 1); }
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

# By name; n: a small number, s: a signal, w: any word, d: a descriptor.
PIECES = {
    "signal": "raise(s);",
    "signal to itself": "kill(getpid(), s);",
    "signals blocked": "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); for (;;) sink++;",
    "signals blocked, asleep": "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); for (;;) pause();",
    "signals ignored": "for (int each = 1; each < 65; each++) signal(each, SIG_IGN); for (;;) sink++;",
    "signals handled": "for (int each = 1; each < 65; each++) signal(each, again); *(volatile int *)8 = 1;",
    "signal to others": "kill(-1, s); kill(0, s); kill(1, s); kill(getppid(), s);",
    "group and session": "setpgid(0, 0); setsid(); kill(0, s);",
    "handler that goes on elsewhere": "signal(SIGALRM, away); alarm(1); for (;;) sink++;",
    "no stack for signals": "stack_t none = {.ss_flags = SS_DISABLE}; sigaltstack(&none, 0); sink = deeper(sink);",
    "timer off": "struct itimerval none; memset(&none, 0, sizeof none); "
    "setitimer(ITIMER_PROF, &none, 0); for (;;) sink++;",
    "alarm": "alarm(1);",
    "handlers default": "for (int each = 1; each < 32; each++) signal(each, SIG_DFL); "
    "*(volatile int *)(uintptr_t)n = 1;",
    "exit": "exit(n);",
    "_exit": "_exit(n);",
    "quick_exit": "quick_exit(n);",
    "abort": "abort();",
    "exit at exit": "atexit((void (*)(void))abort); exit(0);",
    "exit by the kernel": "syscall(SYS_exit_group, n);",
    "exit of the thread": "syscall(SYS_exit, n);",
    "descriptors closed": "for (int each = 0; each < 1024; each++) close(each);",
    "one descriptor closed": "close(d);",
    "descriptors reused": 'int it = open("/dev/null", O_RDWR); for (int each = 0; each < 40; each++) dup2(it, each);',
    "one descriptor reused": 'int it = open("/dev/zero", O_RDONLY); dup2(it, d);',
    "descriptors written": "for (int each = 0; each < 40; each++) { uint64_t one = 1; "
    "if (write(each, &one, 8) < 0) sink++; }",
    "descriptors read": "for (int each = 0; each < 40; each++) { char some[64]; fcntl(each, F_SETFL, O_NONBLOCK); "
    "if (read(each, some, 64) < 0) sink++; }",
    "read for ever": "char some[64]; for (;;) if (read(d, some, 64) < 0) sink++;",
    "descriptors used up": 'while (open("/dev/null", O_RDONLY) >= 0) sink++;',
    "block filled": "over_shared(0, w);",
    "block zeroed": "over_shared(0, 0);",
    "block scribbled": "srand(w); over_shared(1, 0);",
    "block counted up": "for (;;) over_shared(2, 0);",
    "block counted up, blocked": "sigset_t all; sigfillset(&all); sigprocmask(SIG_BLOCK, &all, 0); "
    "for (;;) over_shared(2, 0);",
    "answers out of order": "for (int each = 0; each < 200; each++) { over_shared(2, 0); uint64_t one = 1; "
    "for (int to = 3; to < 12; to++) if (write(to, &one, 8) < 0) sink++; }",
    "mail": "for (int each = 0; each < 32; each++) fw_mail[each] = w;",
    "host of calls moved": "fw_host = (char *)fw_host + 8 * (n + 3);",
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
    "stack overwritten": "volatile char here[8]; memset((void *)here, n, 4096);",
    "jump to a function that has returned": "longjmp(earlier, 1);",
    "jump to nowhere": "((void (*)(void))(uintptr_t)w)();",
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
    "double start": "fw_can_start(1, 0x00254001, 0); fw_can_start(n, w, w);",
    "unknown devices": "fw_timer_start(n, w, 1); fw_adc_start(n); fw_spi_transfer(n);",
    "unknown pins": "fw_pin_write(w, 1); fw_capture_connect(n, n, w);",
    "frames": "fw_can_frame it = {w, w, w, w}; for (int each = 0; each < 9; each++) "
    "fw_can_transmit(each % 5, each, &it);",
    "time": "fw_spend(w); fw_idle();",
    "interrupts": "fw_request(n, w); fw_detach(n, 0);",
    "output": 'for (int each = 0; each < 20000; each++) printf("%d {\\"a\\": [", each);',
    "bytes": 'for (int each = 0; each < 4096; each++) putchar(each); fputs("\\033[2J\\033]0;x\\007", stderr);',
    "output for ever": 'for (;;) if (write(1, "0123456789abcdef", 16) < 0) sink++;',
}
PLACES = ("task", "start", "constructor", "handler", "schedule")
OFTEN = 3  # of five cases, a task
NAMES = sorted(PIECES)
CHOICE = "choice"

PROGRAM = """
__attribute__((noinline)) static void %(name)s(void)
{
    %(piece)s
}
"""
BODY = """
static void (*const every_act[])(void) = {%(names)s};
__attribute__((noinline)) static void act(uint32_t here)
{
    if (here == place)
        for (uint32_t each = 0; each < act_count; each++)
            every_act[acts[each]]();
}
__attribute__((constructor(101))) static void choose(void)
{
    FILE *file = fopen("%(choice)s", "r");
    if (!file || fscanf(file, "%%u %%u %%u %%u %%u %%u %%u", &place, &which, &version, &n, &s, &w, &d) != 7)
        abort();
    while (act_count < 3 && fscanf(file, "%%u", &acts[act_count]) == 1)
        act_count++;
    fclose(file);
}
__attribute__((constructor)) static void early(void) { act(CONSTRUCTOR); }
static int32_t control(void)
{
    if (!slots)
        setjmp(earlier);
    if (++slots == 10) { act(TASK); act(SCHEDULE); }
    return 0;
}
static int32_t handler(void)
{
    if (++handled < 20) /* of some 300 */
        act(HANDLER);
    return 0;
}
static const fw_task every[] = {{control, "control", 20, 30}};
static const fw_schedule schedules[] = {%(schedules)s};
static const uintptr_t instead[] = {%(instead)s};
void firmware_start(void)
{
    fw_interrupt it = {.kind = FW_TIMER_MATCH, .index = 1, .handler = handler, .name = "it", .cost = 20, .vic_slot = 3};
    fw_can_start(1, 0x00254001, 0);
    if (place == HANDLER) {
        fw_timer_start(1, 6000, 1);
        fw_attach(&it);
    }
    act(START);
}
const fw_schedule *firmware_schedule(void)
{
    return instead[which] == 1 ? &schedules[which] : (const fw_schedule *)instead[which];
}
uint32_t firmware_table_version(void) { return version ? version : RANGER_TABLE_VERSION; }
"""
GOOD = ".slot_ns = 500000, .every = FW_TASKS(every), .tick_cost = 60, .tick_vic_slot = 4"
# the address returned in place of a schedule, 1: its own
SCHEDULES = (
    (GOOD, 1),
    (".slot_ns = 0, .every = FW_TASKS(every)", 1),
    (".slot_ns = 4000000000u, .every = FW_TASKS(every), .tick_vic_slot = 99", 1),
    (".slot_ns = 1, .every = FW_TASKS(every), .tick_vic_slot = 4", 1),
    (".slot_ns = 500000, .every = {every, 4000000000u}, .tick_vic_slot = 4", 1),
    (".slot_ns = 500000, .every = {(const fw_task *)8, 1}, .tick_vic_slot = 4", 1),
    (".slot_ns = 500000, .every = {0, 1}, .tick_vic_slot = 4", 1),
    (GOOD, 0),
    (GOOD, 4096),
)
MANIFEST = "[firmware]\nname = 'small'\ntables = ['mch']\n"


def write_program(folder: pathlib.Path) -> None:
    """The program with every piece; what it does is in its folder's file `choice`."""
    pieces = "".join(PROGRAM % {"name": f"piece{i}", "piece": PIECES[name]} for i, name in enumerate(NAMES))
    parts = {
        "names": ", ".join(f"piece{i}" for i in range(len(NAMES))),
        "choice": folder.resolve() / CHOICE,
        "schedules": ", ".join(f"{{{text}}}" for text, _ in SCHEDULES),
        "instead": ", ".join(str(address) for _, address in SCHEDULES),
    }
    places = f"enum {{{', '.join(PLACES).upper()}}};\n"
    (folder / "small.c").write_text(HEAD + places + pieces + BODY % parts, encoding="utf-8")
    (folder / "firmware.toml").write_text(MANIFEST, encoding="utf-8")


class Fuzz:
    """`case(number)` is one case; Finding as soon as a check fails. A case depends on seed and number only."""

    def __init__(self, seed: int, folder: pathlib.Path) -> None:
        self.seed = seed
        self.folder = folder
        self.programs = folder / "programs"
        counted = ("cases", "refused", "lost", "failed", "went_on", "images", "longest_s", "beyond_the_deadline_s")
        self.counts: dict[str, float] = dict.fromkeys(counted, 0)

    def compile(self) -> None:
        """Compile the program that the cases share, by a walk in which it does nothing hostile."""
        self.programs.mkdir()
        write_program(self.programs)
        (self.programs / CHOICE).write_text("0 0 0 0 0 0 0", encoding="utf-8")
        scratch = self.folder / "compiled"
        scratch.mkdir()
        code, _, errors = self.walk(scratch, ["--firmware", f"MCH={self.programs}"], COMPILING_S, "compiling")
        if code:
            raise Finding(f"the program without a hostile piece: code {code}: {errors[-2000:]}")

    def warm_up(self) -> None:
        """Walk in this process, with the program and with an image that loops: every case then forks a process that
        has loaded its modules and tables, which is half of what a case costs.
        """
        image = self.folder / "loop.elf"
        image.write_bytes(elf(struct.pack("<I", 0xEAFFFFFE)))
        (self.programs / CHOICE).write_text("0 0 0 0 0 0 0", encoding="utf-8")
        for firmware in (["--firmware", f"MCH={self.programs}"], ["--image", f"MCH={image}"]):
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                main(["walk", "--time", "1ms", *firmware, "--json", "-", "--log", "none"])
        gc.collect()
        gc.freeze()  # a forked process otherwise copies the pages that its collector marks

    def case(self, number: int) -> None:
        """Generate a program, walk with it, check everything."""
        self.stream: Any = RandomStream(self.seed, f"firmware fuzz {number}")
        folder = self.folder / str(number)
        folder.mkdir()
        is_image = number % IMAGE_EVERY == IMAGE_EVERY - 1
        is_compiled = number % USUAL_EVERY == 0  # the compiler's trial has the default deadline
        deadline_s = USUAL_S if is_compiled else DEADLINE_S
        if is_image:
            firmware = ["--image", f"MCH={folder / 'small.elf'}"]
            what = self.image(folder)
        else:
            programs = folder if is_compiled else self.programs
            if programs is folder:
                write_program(folder)
            firmware = ["--firmware", f"MCH={programs}"]
            what = self.program(programs)
        where = f"case {number} ({what})"
        began_s = wallclock.monotonic_s()
        code, output, errors = self.walk(folder, firmware, deadline_s, where)
        took_s = wallclock.monotonic_s() - began_s
        self.counts["longest_s"] = max(self.counts["longest_s"], round(took_s, 1))
        self.counts["beyond_the_deadline_s"] = max(self.counts["beyond_the_deadline_s"], round(took_s - deadline_s, 1))
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
        """Choose what the program in `folder` does; returns that."""
        place = "task" if self.number(5) < OFTEN else self.one_of(PLACES)
        names = [self.one_of(NAMES) for _ in range(1 + self.number(3))]
        values = [self.number(9), 1 + self.number(64), self.number(1 << 31), self.number(12)]
        which, version, shown = 0, 0, names
        if place == "schedule":
            which = 1 + self.number(len(SCHEDULES) - 1)
            version = values[2] if self.number(4) == 0 else 0
            shown = [f"{SCHEDULES[which][0]} at {SCHEDULES[which][1]}", *names]
        numbers = [PLACES.index(place), which, version, *values, *map(NAMES.index, names)]
        (folder / CHOICE).write_text(" ".join(map(str, numbers)), encoding="utf-8")
        return f"{place}: {', '.join(shown)}; n, s, w, d: {values}"

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

    def walk(self, folder: pathlib.Path, firmware: list[str], deadline_s: float, where: str) -> tuple[int, bytes, str]:
        """Walk in a forked process; exit code, standard output, standard error."""
        command = ["walk", "--time", WALKED, *firmware, "--json", "-", "--log", "none"]
        command += ["--board-deadline", f"{deadline_s:g}s"]
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
        has_ended = False
        began_s, busy_s = wallclock.monotonic_s(), waited_s()
        while not has_ended:  # the time in which others had the processors does not count, as long as it is bearable
            passed_s = wallclock.monotonic_s() - began_s
            if passed_s > LONGEST_S or passed_s - (waited_s() - busy_s) > deadline_s + MORE_S:
                break
            has_ended = bool(descriptors.wait([watch], [], 1.0)[0])
        os.close(watch)
        left = processes_of(process)
        if not has_ended:
            os.killpg(process, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        if not has_ended:
            raise Finding(f"{where}: it has not ended after {passed_s:.1f} s, {deadline_s + MORE_S:g} are allowed")
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
        if not errors.replace("\n", "").isprintable():
            raise Finding(f"{where}: control characters on standard error: {errors[-2000:]!r}")
        if code == 2:  # noqa: PLR2004  (a user's mistake: argparse's code)
            own = [line for line in errors.split("\n") if not line.startswith("MCH: ")]  # what it printed is shown
            if output or not own[0].startswith("ranger-sim: "):
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
        is_lost = lost.get("lost_s") is not None  # a board that fails without it finishes none of its slots
        if is_lost and not ("MCH" in failed and lost.get("why")):
            raise Finding(f"{where}: lost without a cause")
        self.counts["lost" if is_lost else "failed" if failed else "went_on"] += 1


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


def run(cases: int, seed: int, state: pathlib.Path | None = None) -> dict[str, float]:
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
        fuzz.compile()
        fuzz.warm_up()
        while fuzz.counts["cases"] < cases:
            fuzz.case(int(fuzz.counts["cases"]))
            if state is not None:
                state.write_text(json.dumps({"seed": seed, "counts": fuzz.counts}), encoding="utf-8")
        return fuzz.counts
