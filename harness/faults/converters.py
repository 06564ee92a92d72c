"""Faults of the analog-digital converters: of their transfer, and conversions that come late or never.

The faults change the converter's own numbers from the data sheets: gain, offset, reference, time. A fault acts
if the same voltage converts differently with and without it, once the board has converted it.
"""

import math
from collections.abc import Iterator
from typing import Any, ClassVar

from ranger_sim.firmware_sim.peripherals.adc_external import GAIN_MASK, GAIN_SHIFT
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter
from ranger_sim.harness.faults.kinds import BURST_CONVERTER, CONVERTER, INTERNAL_CONVERTER
from ranger_sim.harness.faults.reach import emulated

CONVERTERS = (CONVERTER, INTERNAL_CONVERTER, BURST_CONVERTER)
AWAITED = (CONVERTER, INTERNAL_CONVERTER)
# A year: no program waits that long for a conversion.
NEVER_DONE_NS = 31_536_000_000_000_000


class ConverterFault(Fault):
    """A fault of one converter on a board. `usual`: its own numbers, by name of the field."""

    fields: ClassVar[tuple[str, ...]] = ()  # that it changes, of either kind of converter

    def connect(self) -> None:
        board = self.robot.loop.board(self.place.details["board"])
        if board.apart:
            raise FaultError(f"fault {self.text()}: {board.name} runs in a process of its own; its converter is there")
        emulated(self.robot, board.name, f"fault {self.text()}")
        self.board: Any = board
        self.inside = board.name
        self.converter: Any = getattr(board, self.place.details["converter"])
        self.external = self.place.kind == CONVERTER

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.usual = {name: getattr(self.converter, name) for name in self.fields if hasattr(self.converter, name)}
        self.slots = self.board.scheduler.slot_count
        self.change()

    def change(self) -> None:
        """Set the converter's numbers with the fault."""
        raise NotImplementedError

    def finish(self, now_ns: int) -> None:
        for name, value in self.usual.items():
            setattr(self.converter, name, value)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        return all(getattr(self.converter, name) == value for name, value in self.usual.items())


class TransferFault(ConverterFault):
    """Another number than the usual one for the same voltage."""

    unit = "counts"
    fields = ("gains", "scale", "offset_counts", "count_V")

    def before(self, now_ns: int) -> None:
        slots = self.board.scheduler.slot_count
        if slots == self.slots:
            return  # nothing has been converted since then
        self.slots = slots
        with_fault = list(self._results(now_ns))
        changed = {name: getattr(self.converter, name) for name in self.usual}
        self.finish(now_ns)
        without = list(self._results(now_ns))
        for name, value in changed.items():
            setattr(self.converter, name, value)
        difference = max((a - b for a, b in zip(with_fault, without, strict=True)), key=abs, default=0)
        if difference:
            self.note(now_ns, difference)

    def _results(self, now_ns: int) -> Iterator[int]:
        """The converter's results for the present voltages at its used inputs."""
        converter, volts = self.converter, self.board.analog.volts
        if self.external:
            # a program in C does not expose its sequence: only its last start is known
            for code in converter.sequence[: converter.length] or [converter.register4]:
                gain = code >> GAIN_SHIFT & GAIN_MASK
                yield converter.convert(volts(converter.inputs[code & 15], now_ns), gain)
        else:
            channels = converter.channels[: converter.burst_count] or [converter.channel]
            for channel in channels:
                yield converter.convert(volts(converter.inputs[channel], now_ns))


@mode
class ConverterGain(TransferFault):
    """A wrong gain of the converter's amplifier."""

    mode = "gain"
    kinds = CONVERTERS
    needs = "a converter"
    meaning = "converts with a gain that is wrong by a factor"
    parameters = (Parameter("factor", "1", 1.1, 0.0, 10.0, "times the right gain", "chosen by us: a tenth too much"),)

    def change(self) -> None:
        factor = self.values["factor"]
        if self.external:
            self.converter.gains = [factor * gain for gain in self.converter.gains]
        else:
            self.converter.scale = factor * self.converter.scale


@mode
class ConverterOffset(TransferFault):
    """A wrong zero."""

    mode = "offset"
    kinds = CONVERTERS
    meaning = "converts with a wrong zero"
    parameters = (
        Parameter(
            "offset",
            "counts",
            50.0,
            -8192.0,
            8192.0,
            "added to each result",
            "chosen by us: 0.08 A of a motor's current",
        ),
    )

    def change(self) -> None:
        self.converter.offset_counts = self.converter.offset_counts + math.floor(self.values["offset"] + 0.5)


@mode
class ReferenceSag(TransferFault):
    """The reference is lower than it should be, so that every voltage reads higher."""

    mode = "reference_sag"
    kinds = CONVERTERS
    needs = "a converter"
    meaning = "converts against a reference that is too low by a share"
    parameters = (
        Parameter("share", "1", 0.05, -1.0, 0.9, "share that is missing; below 0: too high", "chosen by us: 5 %"),
    )

    def change(self) -> None:
        self.converter.count_V = self.converter.count_V * (1.0 - self.values["share"])


class TimeFault(ConverterFault):
    """A conversion takes too long. `lateness_ns`: by how much."""

    unit = "us"
    fields = ("conversion_ns",)

    def lateness_ns(self) -> int:
        """By how much a conversion is late."""
        raise NotImplementedError

    def change(self) -> None:
        self.converter.conversion_ns = self.converter.conversion_ns + self.lateness_ns()


@mode
class LateConversion(TimeFault):
    """Conversions take longer."""

    mode = "late_conversion"
    kinds = AWAITED
    needs = "a converter that somebody waits for"
    meaning = "takes longer for each conversion"
    parameters = (
        Parameter("late_us", "us", 300.0, 1.0, 1e6, "by how much", "chosen by us: the sequence ends after its slot"),
    )

    def lateness_ns(self) -> int:
        return round(self.values["late_us"] * 1e3)

    def before(self, now_ns: int) -> None:
        if self.board.scheduler.slot_count != self.slots:  # conversions have been begun
            self.note(now_ns, self.values["late_us"])


@mode
class MissingConversion(TimeFault):
    """A conversion starts and never ends: no interrupt comes.

    A motor board waits in its slot for the external converter (robot.md N4.5) and has no time-out: it hangs from then
    on, also when the converter works again.
    """

    mode = "missing_conversion"
    kinds = AWAITED
    needs = "a converter that somebody waits for"
    meaning = "begins a conversion and never ends it"

    def connect(self) -> None:
        super().connect()
        if self.external:
            self.permanent = "the board's reset: it waits in its slot for the conversion, without a time-out"

    def lateness_ns(self) -> int:
        return NEVER_DONE_NS

    def before(self, now_ns: int) -> None:
        converter = self.converter
        begun_ns = converter.alarm.time - converter.conversion_ns  # of one that never ends
        overdue_ns = now_ns - begun_ns - self.usual["conversion_ns"]
        if converter.busy and begun_ns >= self.activated_ns and overdue_ns > 0:
            self.note(now_ns, overdue_ns * 1e-3)

    def finish(self, now_ns: int) -> None:
        """Reset the converter: no conversion is in progress."""
        super().finish(now_ns)
        if self.converter.busy and self.converter.alarm.time > now_ns + NEVER_DONE_NS // 2:
            self.converter.alarm.set(NEVER)
            self.converter.busy = False
