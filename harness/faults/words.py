"""Faults of the absolute encoders: another 13-bit word for a board's SPI to read.

A word holds for a step of the plant, 250 us. The values of parameters count in the joint's sense from the joint's
angle 0, so that an offset of 100 shows a joint that is 100 x 2 pi / 8192 rad farther ahead on every board.
"""

import math
from typing import Any

from ranger_sim.harness.faults import signals
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, WholeNumber
from ranger_sim.harness.faults.kinds import WORD
from ranger_sim.harness.faults.sensor import Quantity, SignalFault, lasting, mode_classes
from ranger_sim.plant.sensors.absolute_encoder import COUNTS_PER_TURN, WORD_BITS

COUNTS = Quantity(
    unit="counts",
    typical=100.0,
    limit=4096.0,
    clip_low=-200.0,
    clip_high=200.0,
    open_value=0.0,
    source="chosen by us: 100 counts are 0.077 rad, a quarter of a step's half angle; the limit is half a turn",
)
MOST_DEVIATIONS = 3.7  # of NoiseSource's normal numbers (plant/sensors/noise.py)


def signed(counts: int) -> int:
    """Counts of a turn as -4096 ... 4095."""
    return (counts + COUNTS_PER_TURN // 2) % COUNTS_PER_TURN - COUNTS_PER_TURN // 2


class WordFault(Fault):
    """A fault of one absolute encoder's word. `encoder`: that of the plant; `true`: the word that it shows."""

    unit = COUNTS.unit

    def connect(self) -> None:
        plant = self.robot.plant
        self.word: int = self.place.details["word"]
        self.encoder: Any = (plant.hip_word, plant.outer_word, plant.inner_word)[self.word]

    def joint_rad(self) -> float:
        """The present angle, which this encoder measures."""
        return float(self.robot.plant.word_rad(self.word))

    def counts(self, word: int) -> int:
        """A word in the joint's sense, from the joint's angle 0."""
        return int(self.encoder.sign) * signed(word - int(self.encoder.zero))

    def word_of(self, counts: int) -> int:
        """The word of `counts`."""
        return (int(self.encoder.zero) + int(self.encoder.sign) * counts) % COUNTS_PER_TURN

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.true: int = self.robot.plant.words[self.word]
        self.begin_in_word(now_ns)
        self._hold_out(now_ns)

    def begin_in_word(self, now_ns: int) -> None:
        """Start with the encoder's word `true`, not changed yet."""

    def after(self, start_ns: int, end_ns: int) -> None:
        self.true = self.robot.plant.words[self.word]
        self._hold_out(end_ns)

    def _hold_out(self, now_ns: int) -> None:
        """Show the other word, instead of the true one, from `now_ns` on."""
        shown = self.instead(now_ns)
        if shown != self.true:
            self._put(shown)
            self.note(now_ns, signed(self.counts(shown) - self.counts(self.true)))

    def _put(self, word: int) -> None:
        """Show this word."""
        self.robot.plant.words[self.word] = word

    def instead(self, now_ns: int) -> int:
        """The word that is shown instead of `true`."""
        raise NotImplementedError

    def finish(self, now_ns: int) -> None:
        self._put(self.true)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the word is that of the joint's angle, except the encoder's noise."""
        encoder = self.encoder
        x = encoder.scale * self.joint_rad() + encoder.offset_rad
        if encoder.lag_s > 0.0:
            x = encoder.angle
        x += encoder.eccentricity_1 * math.sin(x + encoder.phase_1)
        x += encoder.eccentricity_2 * math.sin(2.0 * x + encoder.phase_2)
        expected = encoder.zero + encoder.counts_per_rad * x
        off = (self.robot.plant.words[self.word] - expected + 4096.0) % COUNTS_PER_TURN - 4096.0
        return bool(abs(off) <= 0.5 + 1e-6 + MOST_DEVIATIONS * encoder.noise_counts)


class SignalInWord(WordFault, SignalFault):
    """A signal of harness/faults/signals.py instead of the counts."""

    def begin_in_word(self, now_ns: int) -> None:
        self.signal = self.new_signal()
        self.signal.begin(self.counts(self.true), now_ns)

    def instead(self, now_ns: int) -> int:
        return self.word_of(math.floor(self.signal.shown(self.counts(self.true), now_ns) + 0.5))


for each in mode_classes(SignalInWord, WORD, COUNTS, without=("drop_out",)):
    mode(each)


@mode
class WordDropOut(WordFault):
    """The data line floats for a while, pulled low or high."""

    mode = "drop_out"
    kinds = (WORD,)
    meaning = "reads as an open data line for a while, at random"
    parameters = (
        WholeNumber(
            "word",
            "counts",
            0.0,
            0.0,
            8191.0,
            "what the line reads: 0 low, 8191 high",
            "chosen by us: low",
        ),
        *lasting("a drop-out", 10.0, 100.0),
    )

    def begin_in_word(self, now_ns: int) -> None:
        self.gaps = signals.Random(self.random, **self.values)
        self.gaps.begin(0.0, now_ns)

    def instead(self, now_ns: int) -> int:
        return int(self.values["word"]) if self.gaps.on(now_ns) else self.true


@mode
class BitFlips(WordFault):
    """Bits of the word are read wrong, as on the long unshielded cable of appendix 3.8."""

    mode = "bit_flips"
    kinds = (WORD,)
    needs = "a serial word"
    meaning = "has a bit read wrong in some of its words"
    parameters = (
        Parameter("share", "1", 0.05, 0.0, 1.0, "share of the words with a wrong bit", "chosen by us: one in twenty"),
        WholeNumber(
            "bit",
            "1",
            -1.0,
            -1.0,
            12.0,
            "which bit; -1: each time another one",
            "13 bits (robot.md N4.7)",
        ),
    )

    def instead(self, now_ns: int) -> int:
        if self.random.uniform() >= self.values["share"]:
            return self.true
        bit = int(self.values["bit"])
        return self.true ^ 1 << (self.random.integer(WORD_BITS) if bit < 0 else bit)
