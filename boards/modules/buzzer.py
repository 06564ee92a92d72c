"""The piezo buzzer on PWM5 (P0.21): tones, one short tune, and beeps on errors.

Period 60e6 / Hz counts in MR0, half of it in MR5. UI_EMPTY_TX2 or UI_SET_BUZZER_AMPL, when not 0, starts
the tune. The firmware of 2016 then never stops it, and silences the buzzer in every millisecond without a tune,
so that a frequency alone is not audible (robot.md N4.11). Appendix 3.8 has beeps on errors and
own sounds for the common ones; `beeps` and `repeats` are the switches buzzer_beeps, song_repeats_for_ever.
"""

import array

import cython

from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.firmware_sim.peripherals.pwm import LER_MR0, LER_MR5, Pwm

# Our own tune, a rising and falling fifth: the robot played a song that belongs to others. (Hz, ms)
TUNE = ((523, 200), (784, 200), (659, 200), (988, 200), (784, 400), (587, 200), (523, 400), (0, 200))
# Beeps are chosen by us, because the appendix says only that there were some: short enough to count, far
# enough apart to distinguish, and at most eight wait (a robot with a lasting fault need not beep for minutes).
BEEP_MS = 60
PAUSE_MS = 60
MOST_WAITING = 8
# an error's code modulo 4 chooses its pitch, so different errors sound different
PITCHES_HZ = (1047, 1319, 1568, 2093)
PWM_CLOCK_HZ = 60_000_000
PERIOD_AT_START = 100_000  # counts of MR0, as the firmware sets it up
LOWEST_HZ, HIGHEST_HZ = 1, 30_000


@cython.cclass
class Buzzer:
    """`update` runs once per slot of 1 ms; `hertz` is the tone last set in the PWM unit, 0 for silence."""

    pwm: Pwm
    beeps: cython.bint
    repeats: cython.bint
    playing: cython.bint
    silence_left_ms: cython.longlong
    beep_left_ms: cython.longlong
    beeps_waiting: cython.longlong
    hertz: cython.longlong
    frequency_hertz: cython.longlong
    note: cython.longlong
    note_left_ms: cython.longlong
    beep_hertz: cython.longlong
    beep_next: cython.longlong
    tune_hertz: cython.longlong[::1]
    tune_ms: cython.longlong[::1]
    pitches: cython.longlong[::1]
    beep_queue: cython.longlong[::1]
    tunes_started: cython.longlong
    beeps_made: cython.longlong

    def __init__(self, pwm: Pwm, beeps=True, repeats=False) -> None:
        self.pwm = pwm
        self.beeps = beeps
        self.repeats = repeats
        self.hertz = 0
        self.frequency_hertz = 0  # as last commanded
        self.playing = False
        self.note = 0
        self.note_left_ms = 0
        self.beep_left_ms = 0
        self.beep_hertz = 0
        self.beep_queue = array.array("q", [0]) * MOST_WAITING
        self.beep_next = 0
        self.beeps_waiting = 0
        self.silence_left_ms = 0
        self.tune_hertz = array.array("q", [note[0] for note in TUNE])
        self.pitches = array.array("q", PITCHES_HZ)
        self.tune_ms = array.array("q", [note[1] for note in TUNE])
        self.tunes_started = 0
        self.beeps_made = 0

    @cython.ccall
    def tone(self, hertz: cython.longlong) -> cython.int:
        """Sound `hertz` (1-30 000; anything else is silence) by writing MR0 and MR5."""
        if hertz < LOWEST_HZ or hertz > HIGHEST_HZ:
            hertz = 0
        if hertz == self.hertz:
            return 0
        self.hertz = hertz
        if hertz == 0:
            self.pwm.MR5 = 0
            self.pwm.latch(LER_MR5)
        else:
            self.pwm.MR0 = PWM_CLOCK_HZ // hertz
            self.pwm.MR5 = self.pwm.MR0 // 2
            self.pwm.latch(LER_MR0 | LER_MR5)
        return 0

    @cython.ccall
    def start_tune(self) -> cython.void:
        """From the first note; a tune that plays goes on."""
        if self.playing:
            return
        self.playing = True
        self.tunes_started += 1
        self.note = 0
        self.note_left_ms = self.tune_ms[0]

    @cython.ccall
    def error_sound(self, code: cython.longlong) -> cython.void:
        """Queue a beep for an error code, if beeps are switched on."""
        if not self.beeps or self.beeps_waiting >= MOST_WAITING:
            return
        self.beep_queue[(self.beep_next + self.beeps_waiting) % MOST_WAITING] = self.pitches[code % len(PITCHES_HZ)]
        self.beeps_waiting += 1

    @cython.ccall
    def update(self) -> cython.longlong:
        """One millisecond: a beep goes before the tune, and without either the buzzer is silent.

        With beeps switched on a frequency command alone is audible as well. Returns 1 while something sounds.
        """
        if self.silence_left_ms > 0:
            self.silence_left_ms -= 1
        elif self.beep_left_ms > 0:
            self.beep_left_ms -= 1
            if self.beep_left_ms == 0:
                self.silence_left_ms = PAUSE_MS
        elif self.beeps_waiting > 0:
            self.beeps_waiting -= 1
            self.beep_hertz = self.beep_queue[self.beep_next]
            self.beep_next = (self.beep_next + 1) % MOST_WAITING
            self.beeps_made += 1
            self.beep_left_ms = BEEP_MS
        if self.beep_left_ms > 0:
            self.tone(self.beep_hertz)
            return 1
        if self.silence_left_ms > 0:
            self.tone(0)
            return 0
        if self.playing:
            self.tone(self.tune_hertz[self.note])
            self.note_left_ms -= 1
            if self.note_left_ms <= 0:
                self.note += 1
                if self.note == len(self.tune_hertz):
                    self.note = 0
                    if not self.repeats:
                        self.playing = False
                self.note_left_ms = self.tune_ms[self.note]
            return 1
        if self.beeps:
            self.tone(self.frequency_hertz)
            return 0
        self.tone(0)
        return 0


@cython.cclass
class BuzzerFrequency(Receiver):
    """Takes UI_SET_BUZZER_FREQ, Hz."""

    buzzer: Buzzer

    def __init__(self, buzzer: Buzzer) -> None:
        Receiver.__init__(self)
        self.buzzer = buzzer

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame; a negative number is beyond the buzzer's range."""
        self.frames += 1
        self.buzzer.frequency_hertz = value_word


@cython.cclass
class TuneStart(Receiver):
    """Takes UI_SET_BUZZER_AMPL and UI_EMPTY_TX2: anything but 0 starts the tune."""

    buzzer: Buzzer

    def __init__(self, buzzer: Buzzer) -> None:
        Receiver.__init__(self)
        self.buzzer = buzzer

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame."""
        self.frames += 1
        if value_word != 0:
            self.buzzer.start_tune()


@cython.cclass
class ErrorSound(Receiver):
    """Takes ERROR_LCD, an error of any board: code in bits 0-15, and 0 is none.

    ROBOT PARITY: the 2016 user interface has no receiver for it; appendix 3.8 has it beep on errors.
    """

    buzzer: Buzzer

    def __init__(self, buzzer: Buzzer) -> None:
        Receiver.__init__(self)
        self.buzzer = buzzer

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame."""
        self.frames += 1
        if value_word & 0xFFFF:
            self.buzzer.error_sound(value_word & 0xFFFF)
