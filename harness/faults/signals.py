"""How a value is falsified, whatever it represents: counts of an encoder, volts at a pin, a rate in a packet.

A signal takes the true value at a time and returns the one shown instead. It depends neither on the sensor
nor on the robot; `edges.py`, `words.py`, `voltages.py` and `imu.py` bring it to the wire. Calls are in order of time.
"""

from collections import deque
from math import isnan, log

from ranger_sim.foundation.random_stream import RandomStream

NS_PER_S = 1_000_000_000


class Signal:
    """What is shown instead of a value. `begin` comes first, with the true value at the time (ns) it starts.

    silent: nothing at all is shown at present, so that the value shown last remains, or the packet is missing.
    """

    def __init__(self, stream: RandomStream, **parameters: float) -> None:
        self.stream = stream
        self.parameters = parameters
        self.start_value = 0.0
        self.start_ns = 0

    def begin(self, value: float, now_ns: int) -> None:
        """Start the fault."""
        self.start_value = value
        self.start_ns = now_ns

    def shown(self, value: float, now_ns: int) -> float:
        """The value shown instead of the true `value` at `now_ns`."""
        raise NotImplementedError


class Stuck(Signal):
    """The value at the start remains, or `level` if it is given."""

    def shown(self, value: float, now_ns: int) -> float:
        level = self.parameters["level"]
        return self.start_value if isnan(level) else level


class Offset(Signal):
    """A constant is added."""

    def shown(self, value: float, now_ns: int) -> float:
        return value + self.parameters["offset"]


class Drift(Signal):
    """An error that grows from 0, in proportion to the time."""

    def shown(self, value: float, now_ns: int) -> float:
        return value + self.parameters["rate"] * (now_ns - self.start_ns) / NS_PER_S


class Scale(Signal):
    """The value times a factor."""

    def shown(self, value: float, now_ns: int) -> float:
        return value * self.parameters["factor"]


class ScaleFromStart(Signal):
    """The value's change since the start, times a factor: for a sensor without its own zero."""

    def shown(self, value: float, now_ns: int) -> float:
        return self.start_value + (value - self.start_value) * self.parameters["factor"]


class Inverted(Signal):
    """The value with the other sign."""

    def shown(self, value: float, now_ns: int) -> float:
        return -value


class Noise(Signal):
    """Normal noise, new every 250 us: as often as the plant moves."""

    HOLD_NS = 250_000

    def begin(self, value: float, now_ns: int) -> None:
        super().begin(value, now_ns)
        self.next_ns = now_ns
        self.error = 0.0

    def shown(self, value: float, now_ns: int) -> float:
        if now_ns >= self.next_ns:
            self.error = self.parameters["deviation"] * self.stream.normal()
            self.next_ns = now_ns + self.HOLD_NS
        return value + self.error


class Random(Signal):
    """A disturbance with random starts and a duration: each pause before it is drawn anew (exponential)."""

    def begin(self, value: float, now_ns: int) -> None:
        super().begin(value, now_ns)
        self.until_ns = 0
        self.next_ns = now_ns  # the first one comes at once, so that a short fault acts

    def on(self, now_ns: int) -> bool:
        """Whether it is on at `now_ns`."""
        if now_ns < self.until_ns:
            return True
        if now_ns >= self.next_ns:
            self.until_ns = now_ns + round(self.parameters["length_ms"] * 1e6)
            pause_ns = round(self.parameters["pause_ms"] * 1e6 * exponential(self.stream))
            self.next_ns = self.until_ns + pause_ns
            return self.until_ns > now_ns
        return False


class Spike(Random):
    """A constant is added for a short time, again and again."""

    def shown(self, value: float, now_ns: int) -> float:
        return value + self.parameters["height"] if self.on(now_ns) else value


class DropOut(Random):
    """The reading of an open wire for a while, again and again."""

    def shown(self, value: float, now_ns: int) -> float:
        return self.parameters["level"] if self.on(now_ns) else value


class Chatter(Random):
    """Between two levels for a while, changing at every sample with probability 0.5, again and again."""

    def shown(self, value: float, now_ns: int) -> float:
        if not self.on(now_ns):
            return value
        return self.parameters["high" if self.stream.uniform() < 0.5 else "low"]


class Delay(Signal):
    """The value of some time ago; until that much time has passed, the value at the start."""

    def begin(self, value: float, now_ns: int) -> None:
        super().begin(value, now_ns)
        self.past: deque[tuple[int, float]] = deque([(now_ns, value)])

    def shown(self, value: float, now_ns: int) -> float:
        then_ns = now_ns - round(self.parameters["delay_ms"] * 1e6)
        self.past.append((now_ns, value))
        while len(self.past) > 1 and self.past[1][0] <= then_ns:
            self.past.popleft()
        return self.past[0][1]


class Quantisation(Signal):
    """The nearest multiple of a step; halves go up."""

    def shown(self, value: float, now_ns: int) -> float:
        step = self.parameters["step"]
        return step * ((value + 0.5 * step) // step)


class Saturation(Signal):
    """The value clipped to a lower and an upper limit."""

    def shown(self, value: float, now_ns: int) -> float:
        return min(max(value, self.parameters["low"]), self.parameters["high"])


class SaturationFromStart(Signal):
    """As `Saturation`, its limits counted from the value at the start."""

    def shown(self, value: float, now_ns: int) -> float:
        moved = value - self.start_value
        return self.start_value + min(max(moved, self.parameters["low"]), self.parameters["high"])


def exponential(stream: RandomStream) -> float:
    """A random number of the exponential distribution of mean 1."""
    return -log(1.0 - stream.uniform())
