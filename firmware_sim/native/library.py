"""The compiled firmware as a separate library for every board: loading, and the checks that precede it.

Every board gets a copy of the file, so that two boards from one source share no variable; a process that runs one
program needs none.
"""

import atexit
import contextlib
import os
import pathlib
import shutil
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import cffi

from ranger_sim import loading
from ranger_sim.firmware_sim.native import coverage, crash, sanitizers
from ranger_sim.foundation.user_error import FirmwareError

VERSION = 1  # of the header: FW_VERSION
# Of the processor's time, not the clock's: how busy the machine is does not matter. A turn is some slots at most and
# takes microseconds; a chip that needs so long for one has missed thousands of slots. Chosen by us. Counted in whole
# ticks, so that it may be up to twice as long.
TURN_LIMIT_S = 1

# The structures of firmware.h and what runtime.c shows. A library says the sizes that its compiler gave them.
DECLARATIONS = """
typedef int32_t (*fw_work)(void);
typedef void (*fw_call)(void);
typedef struct { fw_work function; const char *name; uint32_t cost; uint32_t limit; uint32_t per_item;
                 const char *item; int kind; int32_t transmits; } fw_task;
typedef struct { const fw_task *tasks; uint32_t count; } fw_tasks;
typedef struct { uint32_t after_ns; fw_call function; } fw_step;
typedef struct { uint32_t slot_ns; uint32_t divider; uint32_t tick_cost; int32_t tick_vic_slot; uint32_t flags;
                 uint32_t first_slot_ns; fw_tasks every; const fw_tasks *rows; uint32_t row_count; fw_tasks last;
                 fw_tasks occasional; uint32_t occasional_row; uint32_t occasional_cost; uint32_t occasional_limit;
                 const fw_step *steps; uint32_t step_count;
                 fw_call on_tick; fw_call on_overrun; fw_call on_limit; fw_call on_near_limit; } fw_schedule;
typedef struct { int kind; uint32_t index; fw_work handler; const char *name; uint32_t cost; uint32_t per_item;
                 int32_t vic_slot; int32_t latency; } fw_interrupt;
typedef struct { uint32_t controller; uint32_t first; uint32_t last; } fw_can_range;
typedef struct { uint32_t ID; uint8_t length; uint8_t flags; uint8_t reserved[2]; uint8_t data[64]; } fw_canfd_frame;
typedef int64_t (*host_call)(void *, int64_t, int64_t, int64_t, int64_t, int64_t, int64_t);

void firmware_start(void);
const fw_schedule *firmware_schedule(void);
void firmware_main(void);
uint32_t firmware_table_version(void);
typedef struct { const uint32_t *counts; uint32_t count; } fw_error_counts;
const fw_error_counts *firmware_errors(void);
uint32_t firmware_time_ms(void);

extern uint32_t fw_compiled_version;
extern uint32_t fw_sizes[4];
extern const char *fw_call_names[];
extern host_call fw_answer;
extern void *fw_host;
extern const int64_t *fw_pin_levels;
extern struct { int64_t *IR; int64_t *CCR; const int64_t *CR; } fw_timers[2];
extern int64_t fw_mail[32];
extern fw_canfd_frame fw_canfd_mail;
int64_t fw_turn(void);
extern uint32_t fw_turns;
int32_t fw_watch(int64_t *record, int32_t limit_s, const char *message);
extern uint32_t fw_counts_lines;
void fw_write_counts(void);
void fw_end_counts(void);
"""
SIZED = ("fw_task", "fw_step", "fw_schedule", "fw_interrupt")  # in the order of fw_sizes
REQUIRED = ("fw_compiled_version", "fw_sizes", "fw_call_names", "fw_answer", "fw_turn", "fw_watch", "fw_turns")
ENTRY_POINTS = "firmware_start() and one of firmware_schedule() and firmware_main()"

runs_one_program = False  # this process is that of one board: nothing else is loaded here
WATCHED: list[Any] = []  # libraries that stay loaded: their code handles signals of this process, or counts

ffi: Any = cffi.FFI()
ffi.cdef(DECLARATIONS)


class Library:
    """One loaded copy of the firmware in the file `path`, which messages call `shown`.

    `schedule`: whether it offers a schedule, else it has a main loop. UserError for a file that is not such a library.
    The program itself is not checked: none of its functions is called.
    """

    def __init__(self, path: pathlib.Path, shown: pathlib.Path | None = None) -> None:
        self.path = path
        if not path.is_file():
            raise FirmwareError(f"{path}: there is no such firmware library; `ranger-sim firmware build` makes one")
        self.code = _loaded(path) if runs_one_program else _loaded_copy(path)
        sanitizers.lead_findings()
        path = shown if shown is not None else path
        for name in REQUIRED:
            if not self.has(name):
                raise FirmwareError(f"{path}: no {name} in it: not made by `ranger-sim firmware build`")
        version = self.code.fw_compiled_version
        if version != VERSION:
            raise FirmwareError(
                f"{path}: compiled with version {version} of firmware.h, this is {VERSION}: build it again"
            )
        sizes = [ffi.sizeof(name) for name in SIZED]
        if list(self.code.fw_sizes) != sizes:
            raise FirmwareError(f"{path}: its structures have {list(self.code.fw_sizes)} bytes, expected are {sizes}")
        missing = [] if self.has("firmware_start") else ["firmware_start()"]
        kinds = [name for name in ("firmware_schedule", "firmware_main") if self.has(name)]
        if not kinds:
            missing.append("firmware_schedule() or firmware_main()")
        if missing:
            raise FirmwareError(f"{path}: no {' and no '.join(missing)} in it; a program has {ENTRY_POINTS}")
        if len(kinds) == 2:
            raise FirmwareError(f"{path}: both firmware_schedule() and firmware_main() are defined; one is allowed")
        self.schedule = kinds == ["firmware_schedule"]
        if self.code.fw_counts_lines:
            WATCHED.append(self)  # it would write its counts when it is unloaded
            atexit.register(self._end_counts)

    def write_counts(self, folder: pathlib.Path) -> None:
        """Add what ran since the last time to the counts below `folder` (coverage.py); nothing where nothing counts."""
        if self.code.fw_counts_lines:
            with _setting({coverage.PREFIX: str(folder)}):
                self.code.fw_write_counts()

    def _end_counts(self) -> None:
        """Drop the counts, which were written if wanted; otherwise libgcov writes some at the end of the process."""
        with (
            tempfile.TemporaryDirectory(prefix="ranger-sim-counts-") as nobodys,
            _setting({coverage.PREFIX: nobodys}),
        ):
            self.code.fw_end_counts()

    def table_version(self) -> int | None:
        """Hash of the master table that it was compiled with; None where it has none."""
        return self.code.firmware_table_version() if self.has("firmware_table_version") else None

    def leave_record_in(self, words: Any, message: str = "") -> None:
        """From now on a signal that ends this process leaves in `words` where the program was (crash.py).

        A turn of the program that takes longer than TURN_LIMIT_S of this process's computing is ended in that way, too.
        message: printed then, with the places behind it.
        """
        self.record = ffi.from_buffer("int64_t[]", words, require_writable=True)
        if len(self.record) < crash.RECORD:
            raise ValueError(f"a record has {crash.RECORD} numbers, not {len(self.record)}")
        self.message = ffi.new("char[]", message.encode()) if message else ffi.NULL
        WATCHED.append(self)
        self.code.fw_watch(self.record, TURN_LIMIT_S, self.message)

    def has(self, name: str) -> bool:
        """True when the library defines `name`."""
        try:
            getattr(self.code, name)
        except AttributeError:
            return False
        return True

    def place(self, name: str) -> Any:
        """Where the variable `name` is: for `program.pointer`."""
        return address(ffi.addressof(self.code, name))

    def answer_by(self, answer: Callable[..., int], calls: Any) -> None:
        """Let the program's calls go to `answer`, with `calls` in place of the host's pointer, as interpreted code."""
        self.callback = ffi.callback("host_call", lambda host, *numbers: answer(calls, *numbers), error=0)
        self.code.fw_answer = self.callback

    def call_names(self) -> list[str]:
        """The calls of the header that it was compiled with, in the order of its table."""
        names: list[str] = []
        while self.code.fw_call_names[len(names)] != ffi.NULL:
            names.append(text(self.code.fw_call_names[len(names)]))
        return names


@contextlib.contextmanager
def _setting(variables: dict[str, str]) -> Iterator[None]:
    """Context in which this process has these environment variables."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _loaded(path: pathlib.Path) -> Any:
    """The file itself, loaded: debuggers and sanitizers find it under its name."""
    try:
        return ffi.dlopen(str(path), ffi.RTLD_NOW | ffi.RTLD_LOCAL)
    except OSError as error:
        raise FirmwareError(f"{path}: cannot be loaded as a library: {error}") from None


def _loaded_copy(path: pathlib.Path) -> Any:
    """A copy of the file, loaded: a file loaded twice would be one library."""
    handle, copy = tempfile.mkstemp(prefix=f"{path.stem}-", suffix=".so")
    os.close(handle)
    try:
        shutil.copyfile(path, copy)
        return ffi.dlopen(copy, ffi.RTLD_NOW | ffi.RTLD_LOCAL)
    except OSError as error:
        raise FirmwareError(f"{path}: cannot be loaded as a library: {str(error).replace(copy, path.name)}") from None
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(copy)


def address(given: Any) -> Any:
    """Of a pointer, for `program.pointer`: a number where modules are compiled, otherwise the pointer itself."""
    return int(ffi.cast("uintptr_t", given)) if loading.RUNS_COMPILED else given


def text(characters: Any) -> str:
    """A C string."""
    return ffi.string(characters).decode(errors="replace") if characters != ffi.NULL else ""
