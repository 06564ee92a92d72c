"""The requests of a debugger and their answers; no sockets, no waiting.

Source: Debugging with GDB (gdb 13), appendix E (Packets, Stop Reply Packets, General Query Packets, Memory Map Format).
A request that is not implemented here is answered by an empty packet, as the protocol requires.
"""

from __future__ import annotations

from collections.abc import Callable

from ranger_sim.firmware_sim.gdb.packets import escaped, unescaped
from ranger_sim.firmware_sim.gdb.target import CPSR, PC, READ, SIZES, WRITE, Target, TargetError, description

PACKET_SIZE = 0x4000  # bytes of the longest packet either way, reported to gdb; chosen by us
LONGEST_READ = PACKET_SIZE // 2 - 8
MOST_POINTS = 1000  # breakpoints and watchpoints together; chosen by us: each watchpoint is asked at every access
SIGNAL_INTERRUPT, SIGNAL_TRAP, SIGNAL_BAD_ACCESS = 2, 5, 11  # gdb's numbers
OK, NO_ANSWER = b"OK", b""
CRC_POLYNOMIAL = 0x04C11DB7  # of qCRC: most significant bit first, begun with ones
HELP = """\
monitor time            the board's virtual time, cycles, instructions
monitor reset           the processor's reset input: supervisor mode, address 0; memory and devices stay
monitor reset halt      the same, as editors send it (also reset init): a processor that is debugged stays halted
monitor halt            where it is halted
monitor read ADDRESS    load a device's register as the program does, with all that this does
monitor help            this
"""


STALE = "gdb shows its registers after: maintenance flush register-cache\n"


class BadRequestError(Exception):
    """A request that is not formed as it should be."""


def number(text: bytes) -> int:
    """A hexadecimal number. BadRequestError: the text is not one."""
    if not text or not all(byte in b"0123456789abcdefABCDEF" for byte in text) or len(text) > 16:
        raise BadRequestError
    return int(text, 16)


def numbers(text: bytes, count: int) -> list[int]:
    """A fixed number of hexadecimal numbers, with commas between."""
    parts = text.split(b",")
    if len(parts) != count:
        raise BadRequestError
    return [number(part) for part in parts]


def crc(data: bytes) -> int:
    """The check sum of qCRC."""
    value = 0xFFFFFFFF
    for byte in data:
        value ^= byte << 24
        for _ in range(8):
            value = (value << 1 ^ (CRC_POLYNOMIAL if value >> 31 else 0)) & 0xFFFFFFFF
    return value


class Stub:
    """Executes requests on `target`. After `answer`, `resumes` means that the processor goes on, `leaves` that the
    debugger disconnects."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self.begin()

    def begin(self) -> None:
        """Another debugger."""
        self.acknowledged = True
        self.resumes = False
        self.leaves = False
        self.console = ""  # for the debugger's console, before the answer
        self.stop = b"T%02xthread:1;" % SIGNAL_TRAP
        self.texts = {b"target.xml": description(), b"": self.target.memory_map()}

    def answer(self, request: bytes) -> bytes | None:
        """The answer's payload; None where the protocol has none (yet)."""
        try:
            for name, handler in HANDLERS:
                if request.startswith(name):
                    return handler(self, request[len(name) :])
        except BadRequestError:
            return b"E01"
        except TargetError:
            return b"E0e"  # EFAULT
        return NO_ANSWER

    def stopped(self, signal: int, hit: tuple[int, int] | None = None) -> bytes:
        """The stop reply, which `?` repeats; `hit`: address and kinds of the watchpoint that was met."""
        reply = b"T%02xthread:1;" % signal
        if hit is not None:
            name = {READ: b"rwatch", WRITE: b"watch"}.get(hit[1], b"awatch")
            reply += b"%b:%08x;" % (name, hit[0])
        self.stop = reply
        return reply

    # ---- registers and memory

    def _why(self, _: bytes) -> bytes:
        return self.stop

    def _registers(self, _: bytes) -> bytes:
        parts = (self.target.register(i).to_bytes(size, "little") for i, size in enumerate(SIZES))
        return b"".join(parts).hex().encode()

    def _set_registers(self, rest: bytes) -> bytes:
        try:
            data = bytes.fromhex(rest.decode("ascii"))
        except ValueError:
            raise BadRequestError from None
        values = []
        place = 0
        for size in SIZES:
            values.append(int.from_bytes(data[place : place + size], "little"))
            place += size
        if len(data) != place:
            raise BadRequestError
        # the status says to which bank r13 belongs, which is also there by its bank's name: what is general comes last
        for i in (CPSR, *range(CPSR + 1, len(values) - 1), *range(CPSR)):
            self.target.set_register(i, values[i])
        return OK

    def _register(self, rest: bytes) -> bytes:
        i = number(rest)
        return self.target.register(i).to_bytes(SIZES[i], "little").hex().encode()

    def _set_register(self, rest: bytes) -> bytes:
        which, _, value = rest.partition(b"=")
        try:
            data = bytes.fromhex(value.decode("ascii"))
        except ValueError:
            raise BadRequestError from None
        i = number(which)
        if i >= len(SIZES) or len(data) != SIZES[i]:
            raise BadRequestError
        self.target.set_register(i, int.from_bytes(data, "little"))
        return OK

    def _read(self, rest: bytes) -> bytes:
        address, length = numbers(rest, 2)
        return self.target.read(address, min(length, LONGEST_READ)).hex().encode()

    def _write(self, rest: bytes) -> bytes:
        where, _, text = rest.partition(b":")
        address, length = numbers(where, 2)
        try:
            data = bytes.fromhex(text.decode("ascii"))
        except ValueError:
            raise BadRequestError from None
        return self._put(address, length, data)

    def _write_binary(self, rest: bytes) -> bytes:
        where, _, data = rest.partition(b":")
        address, length = numbers(where, 2)
        return self._put(address, length, unescaped(data))

    def _put(self, address: int, length: int, data: bytes) -> bytes:
        if len(data) != length:
            raise BadRequestError
        if data:
            self.target.write(address, data)
        return OK

    def _crc(self, rest: bytes) -> bytes:
        address, length = numbers(rest, 2)
        if length > self.target.core.flash_size + self.target.core.ram_size:
            raise BadRequestError
        return b"C%08x" % crc(self.target.read(address, length))

    def _erase(self, rest: bytes) -> bytes:
        address, length = numbers(rest, 2)
        self.target.erase(address, length)
        return OK

    def _program(self, rest: bytes) -> bytes:
        where, _, data = rest.partition(b":")
        content = unescaped(data)
        address = number(where)
        self.target.read(address, len(content))  # it must be memory
        self.target.write(address, content)
        return OK

    def _done(self, _: bytes) -> bytes:
        return OK

    # ---- points and running

    def _point(self, rest: bytes) -> tuple[str, int, int]:
        kind, _, where = rest.partition(b",")
        address, length = numbers(where.partition(b";")[0], 2)
        if len(kind) != 1 or kind not in b"01234":
            raise BadRequestError
        return kind.decode(), address, length

    def _insert(self, rest: bytes) -> bytes:
        if rest[:1] not in (b"0", b"1", b"2", b"3", b"4"):
            return NO_ANSWER
        if self.target.count() >= MOST_POINTS:
            return b"E1c"  # ENOSPC
        self.target.set_point(*self._point(rest))
        return OK

    def _remove(self, rest: bytes) -> bytes:
        if rest[:1] not in (b"0", b"1", b"2", b"3", b"4"):
            return NO_ANSWER
        self.target.clear_point(*self._point(rest))
        return OK

    def _resume(self, step: bool, address: bytes) -> None:
        if address:
            self.target.set_register(PC, number(address))
        self.target.core.go_on(step)
        self.resumes = True

    def _continue(self, rest: bytes) -> None:
        self._resume(False, rest)

    def _step(self, rest: bytes) -> None:
        self._resume(True, rest)

    def _continue_with_signal(self, rest: bytes) -> None:
        self._resume(False, rest.partition(b";")[2])

    def _step_with_signal(self, rest: bytes) -> None:
        self._resume(True, rest.partition(b";")[2])

    def _actions(self, rest: bytes) -> bytes | None:
        """vCont: there is one thread, the first action is its."""
        if rest[:1] == b"?":
            return b"vCont;c;C;s;S"
        action = rest.lstrip(b";").split(b";")[0].partition(b":")[0]
        if action[:1] not in (b"c", b"C", b"s", b"S"):
            raise BadRequestError
        self._resume(action[:1] in (b"s", b"S"), b"")
        return None

    # ---- what kind of thing this is

    def _supported(self, _: bytes) -> bytes:
        return (
            b"PacketSize=%x;QStartNoAckMode+;qXfer:features:read+;qXfer:memory-map:read+;vContSupported+;"
            b"hwbreak-;swbreak-;multiprocess-" % PACKET_SIZE
        )

    def _no_acknowledgements(self, _: bytes) -> bytes:
        self.acknowledged = False
        return OK

    def _transfer(self, rest: bytes) -> bytes:
        """qXfer:OBJECT:read:ANNEX:OFFSET,LENGTH"""
        annex, _, where = rest.partition(b":")
        offset, length = numbers(where, 2)
        if annex not in self.texts:
            return b"E00"
        text = self.texts[annex].encode()
        part = text[offset : offset + min(length, PACKET_SIZE - 64)]
        return (b"l" if offset + len(part) >= len(text) else b"m") + escaped(part)

    def _thread(self, _: bytes) -> bytes:
        return b"QC1"

    def _threads(self, _: bytes) -> bytes:
        return b"m1"

    def _no_more_threads(self, _: bytes) -> bytes:
        return b"l"

    def _about_thread(self, _: bytes) -> bytes:
        return self.target.board.name.encode().hex().encode()

    def _attached(self, _: bytes) -> bytes:
        return b"1"

    def _leave(self, _: bytes) -> bytes:
        self.leaves = self.resumes = True
        return OK

    def _kill(self, _: bytes) -> None:
        self.leaves = self.resumes = True

    def _monitor(self, rest: bytes) -> bytes:
        try:
            words = bytes.fromhex(rest.decode("ascii")).decode("utf-8").split()
        except ValueError:
            raise BadRequestError from None
        answer = self._monitored(words)
        if answer is None:
            self.console = f"monitor {' '.join(words)[:40]}: unknown command\n{HELP}"
            return b"E01"
        return answer.encode().hex().encode()

    def _monitored(self, words: list[str]) -> str | None:
        """The answer of a command of `monitor`; None for an unknown one."""
        target = self.target
        if words == ["time"]:
            return target.time_text() + "\n"
        if words in (["reset"], ["reset", "halt"], ["reset", "init"]):
            target.core.reset()
            return f"{target.board.name}: reset, halted at {target.core.pc:#010x}\n{STALE}"
        if words == ["halt"]:
            return f"{target.board.name}: halted at {target.core.pc:#010x}\n"
        if words[:1] == ["read"] and len(words) == 2:
            try:
                address = int(words[1], 0)
                return f"{address & -4:#010x}: {target.read_device(address):#010x}\n"
            except (ValueError, TargetError) as error:
                return f"monitor read {words[1]}: {error}\n"
        if words in ([], ["help"]):
            return HELP
        return None


Handler = Callable[[Stub, bytes], bytes | None]
HANDLERS: tuple[tuple[bytes, Handler], ...] = (
    (b"?", Stub._why),
    (b"g", Stub._registers),
    (b"G", Stub._set_registers),
    (b"p", Stub._register),
    (b"P", Stub._set_register),
    (b"m", Stub._read),
    (b"M", Stub._write),
    (b"X", Stub._write_binary),
    (b"Z", Stub._insert),
    (b"z", Stub._remove),
    (b"c", Stub._continue),
    (b"s", Stub._step),
    (b"C", Stub._continue_with_signal),
    (b"S", Stub._step_with_signal),
    (b"H", Stub._done),
    (b"T", Stub._done),
    (b"D", Stub._leave),
    (b"k", Stub._kill),
    (b"vKill", Stub._leave),
    (b"vCont", Stub._actions),
    (b"vFlashErase:", Stub._erase),
    (b"vFlashWrite:", Stub._program),
    (b"vFlashDone", Stub._done),
    (b"QStartNoAckMode", Stub._no_acknowledgements),
    (b"qSupported", Stub._supported),
    (b"qXfer:features:read:", Stub._transfer),
    (b"qXfer:memory-map:read:", Stub._transfer),
    (b"qAttached", Stub._attached),
    (b"qCRC:", Stub._crc),
    (b"qRcmd,", Stub._monitor),
    (b"qfThreadInfo", Stub._threads),
    (b"qsThreadInfo", Stub._no_more_threads),
    (b"qThreadExtraInfo", Stub._about_thread),
    (b"qC", Stub._thread),
)
