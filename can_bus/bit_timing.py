"""Bit timing of a bus: its unit of time, and the two bit rates and sample points of CAN FD in that unit.

A classic bus counts bits. A CAN FD bus counts ticks: the longest unit of which both bits are whole multiples, divided
so that a bit at the data rate has at least LEAST_TICKS of them. All nodes of a bus have the same timing; propagation
takes no time and oscillators do not drift, so transmitter delay compensation and resynchronisation within a frame
would change nothing and do not exist here.
"""

import math

import cython

LEAST_TICKS = 20  # of a bit at the data rate; chosen by us: sample points in steps of 5 % or finer
HIGHEST_TICK_RATE = 1_000_000_000  # ticks per second; chosen by us: times are whole ns
# CiA 601-3 recommends 80 % for the arbitration phase, and the same for both phases where nothing else is known
SAMPLE_POINT = 0.8


@cython.final
@cython.cclass
class BitTiming:
    """Ticks: `rate` per second; `nominal`, `data`: of a bit; `sample`, `data_sample`: from its start to its sample
    point. Without a data rate (0): a classic bus, whose tick is a bit. `is_fd`: whether it has one.
    """

    is_fd: cython.bint
    rate: cython.longlong
    nominal: cython.longlong
    data: cython.longlong
    sample: cython.longlong
    data_sample: cython.longlong

    def __init__(self, where, bitrate, data_bitrate=0, sample_point=SAMPLE_POINT, data_sample_point=SAMPLE_POINT):
        self.is_fd = data_bitrate != 0
        if not self.is_fd:
            self.rate = bitrate
            self.nominal = self.data = 1
            self.sample = self.data_sample = 1
            return
        for name, point in (("sample point", sample_point), ("sample point of the data phase", data_sample_point)):
            if not 0.05 <= point <= 0.95:
                raise ValueError(f"{where}: {name} {point} is outside 0.05 ... 0.95")
        if not bitrate <= data_bitrate <= 100_000_000:
            raise ValueError(f"{where}: data bit rate {data_bitrate} bit/s is outside {bitrate} ... 100000000")
        common = math.lcm(bitrate, data_bitrate)
        rate = common * -(-LEAST_TICKS * data_bitrate // common)
        if rate > HIGHEST_TICK_RATE:
            raise ValueError(
                f"{where}: bit rates {bitrate} and {data_bitrate} bit/s have no common clock of at most "
                f"{HIGHEST_TICK_RATE} Hz with {LEAST_TICKS} ticks per data bit"
            )
        self.rate = rate
        self.nominal = rate // bitrate
        self.data = rate // data_bitrate
        self.sample = round(sample_point * self.nominal)
        self.data_sample = round(data_sample_point * self.data)

    def at_rates(self, bitrate, data_bitrate) -> "BitTiming":
        """The timing of a node of this bus whose rates are wrong (0: right), with bits of whole ticks and these sample
        points."""
        wrong: BitTiming = BitTiming("", self.rate // self.nominal, self.rate // self.data)
        wrong.rate = self.rate
        wrong.nominal = round(self.rate / bitrate) if bitrate else self.nominal
        wrong.data = round(self.rate / data_bitrate) if data_bitrate else self.data
        wrong.sample = round(self.sample * wrong.nominal / self.nominal)
        wrong.data_sample = round(self.data_sample * wrong.data / self.data)
        return wrong

    def offset(self, place, brs, delimiter) -> int:
        """Ticks from the start of a frame to the start of its bit `place`.

        `brs`, `delimiter`: places of BRS and the CRC delimiter, negative when the frame does not switch.
        """
        if brs < 0 or place <= brs:
            return int(place * self.nominal)
        first = brs * self.nominal + self.sample + self.data - self.data_sample  # the end of BRS
        if place <= delimiter:
            return int(first + (place - brs - 1) * self.data)
        last = first + (delimiter - brs - 1) * self.data + self.data_sample + self.nominal - self.sample
        return int(last + (place - delimiter - 1) * self.nominal)
