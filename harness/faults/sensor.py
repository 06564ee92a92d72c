"""Common parts of sensor faults: what a sensor measures, how far it can be wrong, and the modes made of signals.

The same signals (harness/faults/signals.py) act on edges, words, voltages and packets. One table lists the parameters
of each; their defaults and limits follow from what is measured, so that an offset of a current is amperes and that
of an encoder counts.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, ClassVar

from ranger_sim.harness.faults import signals
from ranger_sim.harness.faults.fault import Fault, Parameter


@dataclasses.dataclass(frozen=True)
class Quantity:
    """What a sensor measures, in `unit`. `typical`: an error that matters in walking; `limit`: beyond it an error means
    nothing; `clip_low`, `clip_high`: a range that walking leaves; `open_value`: the reading of an open wire.
    """

    unit: str
    typical: float
    limit: float
    clip_low: float
    clip_high: float
    open_value: float
    source: str


class SignalFault(Fault):
    """A signal instead of a sensor's value."""

    signal_class: ClassVar[type[signals.Signal]]

    def new_signal(self) -> signals.Signal:
        """The signal with this fault's parameters and randomness."""
        return self.signal_class(self.random, **self.values)


@dataclasses.dataclass(frozen=True)
class Row:
    """A mode of the table below: signal, its meaning, its parameters for a quantity."""

    mode: str
    signal: type[signals.Signal]
    meaning: str
    parameters: Callable[[Quantity], tuple[Parameter, ...]]
    needs: str = "a sensor"


def number(
    q: Quantity, name: str, default: float, low: float, high: float, meaning: str, unit: str | None = None
) -> Parameter:
    """A parameter in the unit of the quantity; default and limits follow from its row, as `source` says."""
    return Parameter(name, q.unit if unit is None else unit, default, low, high, meaning, q.source)


def lasting(meaning: str, length_ms: float, pause_ms: float) -> tuple[Parameter, ...]:
    """Parameters for a duration and a pause."""
    chosen = "chosen by us: some slots of a board, some times per step"
    return (
        Parameter("length_ms", "ms", length_ms, 0.25, 1e6, f"how long {meaning} lasts", chosen),
        Parameter(
            "pause_ms",
            "ms",
            pause_ms,
            0.0,
            1e6,
            "mean pause until the next, exponential; the first comes at once",
            chosen,
        ),
    )


def stuck(q: Quantity) -> tuple[Parameter, ...]:
    """The parameter for a given level."""
    return (number(q, "level", math.nan, -q.limit, q.limit, "value that it keeps; default: its present value"),)


def scaled(q: Quantity) -> tuple[Parameter, ...]:
    """The parameter for a factor."""
    chosen = "chosen by us: a tenth too large; beyond the limits another fault is meant"
    return (Parameter("factor", "1", 1.1, -10.0, 10.0, "what it is multiplied by", chosen),)


def delayed(q: Quantity) -> tuple[Parameter, ...]:
    """The parameter for a time."""
    chosen = "chosen by us: ten slots of a motor board, a third of a robot's reaction to a strike"
    return (Parameter("delay_ms", "ms", 5.0, 0.25, 1e4, "how late it shows", chosen),)


# fmt: off
ROWS = (
    Row("stuck", signals.Stuck, "shows one value whatever happens", stuck),
    Row("offset", signals.Offset, "shows a constant too much",
        lambda q: (number(q, "offset", q.typical, -q.limit, q.limit, "what is added"),)),
    Row("drift", signals.Drift, "shows an error that grows with time from nothing",
        lambda q: (number(q, "rate", q.typical, -100.0 * q.limit, 100.0 * q.limit, "growth per second",
                          f"{q.unit}/s"),)),
    Row("scale", signals.Scale, "shows its value times a factor", scaled),
    Row("noise", signals.Noise, "shows normal noise, new every 250 us",
        lambda q: (number(q, "deviation", q.typical / 5.0, 0.0, q.limit, "standard deviation"),)),
    Row("spike", signals.Spike, "shows a constant too much for a short time, at random",
        lambda q: (number(q, "height", 3.0 * q.typical, -q.limit, q.limit, "what is added"),
                   *lasting("a spike", 0.5, 50.0))),
    Row("drop_out", signals.DropOut, "reads as an open wire for a while, at random",
        lambda q: (number(q, "level", q.open_value, -q.limit, q.limit, "what an open wire reads"),
                   *lasting("a drop-out", 10.0, 100.0))),
    Row("delay", signals.Delay, "shows its value late", delayed),
    Row("quantisation", signals.Quantisation, "shows multiples of a coarse step",
        lambda q: (number(q, "step", q.typical / 2.0, q.typical / 1000.0, q.limit, "the step"),)),
    Row("saturation", signals.Saturation, "shows nothing beyond two limits",
        lambda q: (number(q, "low", q.clip_low, -q.limit, q.limit, "the least that it shows"),
                   number(q, "high", q.clip_high, -q.limit, q.limit, "the most that it shows"))),
    Row("swapped_sign", signals.Inverted, "shows the other sign, as two swapped wires do",
        lambda q: (), needs="a signal on two wires or channels that can be swapped"),
)
# fmt: on


def mode_classes(
    base: type[SignalFault],
    kind: str,
    quantity: Quantity,
    without: tuple[str, ...] = (),
    **more: Any,
) -> list[type[SignalFault]]:
    """A mode of each row for one kind of place."""
    made = []
    for row in ROWS:
        if row.mode in without:
            continue
        fields: dict[str, Any] = {
            "__doc__": f"At the {kind}: {row.meaning}.",
            "__module__": base.__module__,
            "mode": row.mode,
            "kinds": (kind,),
            "meaning": row.meaning,
            "needs": row.needs,
            "parameters": row.parameters(quantity),
            "unit": quantity.unit,
            "signal_class": row.signal,
            **more,
        }
        name = "".join(word.capitalize() for word in f"{kind} {row.mode}".replace("_", " ").split())
        made.append(type(name, (base,), fields))
    return made
