# Generated from boards/modules/buzzer.py and boards/modules/buzzer.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.firmware_sim.peripherals.pwm import Pwm

TUNE: tuple[tuple[int, ...], ...]
BEEP_MS: int
PAUSE_MS: int
MOST_WAITING: int
PITCHES_HZ: tuple[int, ...]
PWM_CLOCK_HZ: int
PERIOD_AT_START: int
LOWEST_HZ: int
HIGHEST_HZ: int

class Buzzer:
    pwm: Pwm
    beeps: bool
    repeats: bool
    playing: bool
    silence_left_ms: int
    beep_left_ms: int
    beeps_waiting: int
    hertz: int
    frequency_hertz: int
    note: int
    note_left_ms: int
    beep_hertz: int
    beep_next: int
    tune_hertz: MutableSequence[int]
    tune_ms: MutableSequence[int]
    pitches: MutableSequence[int]
    beep_queue: MutableSequence[int]
    tunes_started: int
    beeps_made: int
    def __init__(self, pwm: Pwm, beeps: bool = True, repeats: bool = False) -> None: ...
    def tone(self, hertz: int) -> int: ...
    def start_tune(self) -> None: ...
    def error_sound(self, code: int) -> None: ...
    def update(self) -> int: ...

class BuzzerFrequency(Receiver):
    buzzer: Buzzer
    def __init__(self, buzzer: Buzzer) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...

class TuneStart(Receiver):
    buzzer: Buzzer
    def __init__(self, buzzer: Buzzer) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...

class ErrorSound(Receiver):
    buzzer: Buzzer
    def __init__(self, buzzer: Buzzer) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
