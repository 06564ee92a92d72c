"""The exported body between communication points: its inputs and outputs as one array of numbers, and its steps.

Compiled, because an importer exchanges every value at every communication point. Outputs are read from the plant when
one is asked for, once for each communication step.
"""

import array
from typing import Annotated, Final

import cython

from ranger_sim.foundation.numbers import integers
from ranger_sim.plant.bridge import Bridge
from ranger_sim.plant.ranger import SAMPLES, STEP_NS, RangerPlant
from ranger_sim.plant.sensors.imu import SET_MODE, SET_MODE_SECOND, SET_MODE_THIRD, SILENT
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from ranger_sim.plant.wiring_points import ANALOG_COUNT, ENCODER_COUNT, MOTOR_COUNT, WORD_COUNT

STEP_S = STEP_NS * 1e-9
# How far a time may lie from the grid: far above the rounding of a day's seconds, far below a step. Chosen by us.
NEAR_S = 1e-7
LONGEST_S = 1e9  # of a communication step: its steps are far from the largest integer. Chosen by us.
PERIOD_COUNTS: Final = 600  # of the PWM: 100 kHz at 60 MHz (robot.md N4.4)

# Places in the array: a motor's inputs, one motor after the other, those of the whole robot, and the outputs.
MATCH_2: Final = 0
MATCH_6: Final = 1
PERIOD: Final = 2
DELAY: Final = 3
LOW_SIDE_2: Final = 4
LOW_SIDE_6: Final = 5
WATCHDOG: Final = 6
WATCHDOG_DELAY: Final = 7
PER_MOTOR: Final = 8
IMU_MODE: Final = 32
HELD_NOW: Final = 33
INPUT_COUNT: Final = 34

# kinds of numbers
REAL: Final = 0
INTEGER: Final = 1
TRUTH: Final = 2

WRITTEN: Final = 5  # numbers that a bridge has of its board: the match registers and the low-side enables


@cython.final
@cython.cclass
class Stepper:
    """Moves a plant by inputs that are constant in a communication step.

    `kinds`, `low`, `high`: kind and inclusive limits of every number, inputs first, then outputs. `steps`: of the
    plant, since `begin`.
    """

    plant: RangerPlant
    steps: Annotated[cython.longlong, "readonly"]
    holding: Annotated[cython.bint, "readonly"]
    observed: cython.bint
    release_rate_rad_s: cython.double
    imu_mode: cython.longlong
    numbers: cython.double[::1]
    low: cython.double[::1]
    high: cython.double[::1]
    samples: cython.double[::1]
    kinds: cython.longlong[::1]
    delays_ns: cython.longlong[::1]  # of the inputs that are times, rounded
    written: cython.longlong[::1]

    def __init__(self, kinds, low, high) -> None:
        self.kinds = array.array("q", kinds)
        self.low = array.array("d", low)
        self.high = array.array("d", high)
        self.numbers = array.array("d", [0.0]) * len(kinds)
        self.samples = array.array("d", [0.0]) * len(SAMPLES)
        self.delays_ns = integers(INPUT_COUNT)
        self.written = integers(WRITTEN * MOTOR_COUNT)
        self.steps = 0
        self.holding = True
        self.observed = False
        self.release_rate_rad_s = 0.0
        self.imu_mode = SILENT

    def begin(self, plant: RangerPlant, release_rate_rad_s: float) -> None:
        """Step this held plant from now on; its bridges are as at power-up. The inputs keep their values."""
        motor: cython.longlong
        place: cython.longlong
        self.plant = plant
        self.steps = 0
        self.holding = True
        self.observed = False
        self.release_rate_rad_s = release_rate_rad_s
        self.imu_mode = SILENT
        for motor in range(MOTOR_COUNT):
            place = WRITTEN * motor
            self.written[place + MATCH_2] = 0
            self.written[place + MATCH_6] = 0
            self.written[place + PERIOD] = PERIOD_COUNTS
            self.written[place + 3] = 1
            self.written[place + 4] = 1

    # ---- numbers ----------------------------------------------------------------------------------------------

    def value(self, place: cython.longlong) -> object:
        """The number at `place` as Python has it: a float, an int, or a bool."""
        if place >= INPUT_COUNT and not self.observed:
            self._observe()
        if self.kinds[place] == REAL:
            return self.numbers[place]
        return bool(self.numbers[place]) if self.kinds[place] == TRUTH else int(self.numbers[place])

    def set_value(self, place: cython.longlong, value: object) -> None:
        """Set an input, which is within its limits."""
        if self.numbers[place] != value:
            self.numbers[place] = value
            if self.kinds[place] == REAL:  # the inputs that are not whole numbers are times
                self.delays_ns[place] = round(1e9 * self.numbers[place])

    def get_all(self, references: list, first: cython.longlong, kind: cython.longlong) -> object:
        """Values of one kind, a list. None if one is another variable; `first`: the reference of the first number."""
        found: list = []
        place: cython.longlong
        count: cython.longlong = len(references)
        total: cython.longlong = len(self.numbers)
        k: cython.longlong
        reference: cython.longlong
        if not self.observed:
            self._observe()
        for k in range(count):
            reference = references[k]
            place = reference - first
            if place < 0 or place >= total or self.kinds[place] != kind:
                return None
            if kind == REAL:
                found.append(self.numbers[place])
            elif kind == TRUTH:
                found.append(self.numbers[place] != 0.0)
            else:
                found.append(cython.cast(cython.longlong, self.numbers[place]))
        return found

    def set_all(self, references: list, values: list, first: cython.longlong, kind: cython.longlong) -> bool:
        """Set inputs of one kind. False, and nothing is set, if one is another variable or beyond its limits.

        Another mode of the inertial unit is refused as well: not every number within its limits is a mode.
        """
        count: cython.longlong = len(references)
        place: cython.longlong
        k: cython.longlong
        reference: cython.longlong
        value: cython.double
        for k in range(count):
            reference = references[k]
            place = reference - first
            if place < 0 or place >= INPUT_COUNT or self.kinds[place] != kind:
                return False
            value = values[k]
            if not (self.low[place] <= value and value <= self.high[place]):
                return False
            if place == IMU_MODE and value != self.numbers[place]:
                return False
        for k in range(count):
            reference = references[k]
            place = reference - first
            value = values[k]
            if self.numbers[place] != value:
                self.set_value(place, values[k])
        return True

    # ---- passing time -----------------------------------------------------------------------------------------

    def whole_steps(self, time_s: cython.double, length_s: cython.double) -> int:
        """Steps of the plant in a communication step of `length_s` from `time_s` on, both since `begin`.

        0 if the length is not a whole number of steps, and -1 if the body is at another time.
        """
        count: cython.longlong
        here_s: cython.double = self.steps * STEP_S
        if not (-NEAR_S <= time_s - here_s <= NEAR_S):  # also true of NaN
            return -1
        if not (0.0 < length_s <= LONGEST_S):
            return 0
        count = cython.cast(cython.longlong, length_s / STEP_S + 0.5)
        return count if -NEAR_S <= length_s - count * STEP_S <= NEAR_S else 0

    def advance(self, count: cython.longlong) -> bool:
        """Advance by `count` steps with the present inputs; False, and no further motion, when the body has fallen."""
        plant: RangerPlant = self.plant
        end: cython.longlong = self.steps + count
        while self.steps < end and not plant.fell:
            self._act()
            plant.step()
            self.steps += 1
            self.observed = False
        return not plant.fell

    @cython.cfunc
    def _act(self) -> object:
        """Apply the inputs at the begin of a step: to a bridge only what has changed, and every edge."""
        plant: RangerPlant = self.plant
        now: cython.longlong = plant.time_ns
        numbers: cython.double[::1] = self.numbers
        written: cython.longlong[::1] = self.written
        bridge: Bridge
        motor: cython.longlong
        place: cython.longlong
        before: cython.longlong
        mode: cython.longlong
        if self.holding and numbers[HELD_NOW] == 0.0:
            self.holding = False
            plant.release(self.release_rate_rad_s)
        for motor in range(MOTOR_COUNT):
            bridge = plant.bridges[motor]
            place = PER_MOTOR * motor
            before = WRITTEN * motor
            if (
                numbers[place + MATCH_2] != written[before]
                or numbers[place + MATCH_6] != written[before + 1]
                or numbers[place + PERIOD] != written[before + 2]
            ):
                written[before] = cython.cast(cython.longlong, numbers[place + MATCH_2])
                written[before + 1] = cython.cast(cython.longlong, numbers[place + MATCH_6])
                written[before + 2] = cython.cast(cython.longlong, numbers[place + PERIOD])
                bridge.write_pwm(
                    now + self.delays_ns[place + DELAY], written[before], written[before + 1], written[before + 2]
                )
            if numbers[place + LOW_SIDE_2] != written[before + 3] or numbers[place + LOW_SIDE_6] != written[before + 4]:
                written[before + 3] = numbers[place + LOW_SIDE_2] != 0.0
                written[before + 4] = numbers[place + LOW_SIDE_6] != 0.0
                bridge.low_side(now, written[before + 3] != 0, written[before + 4] != 0)
            if numbers[place + WATCHDOG] != 0.0:
                bridge.watchdog_edge(now + self.delays_ns[place + WATCHDOG_DELAY])
        mode = cython.cast(cython.longlong, numbers[IMU_MODE])
        if mode != self.imu_mode:
            self.imu_mode = mode
            for byte in (SET_MODE, SET_MODE_SECOND, SET_MODE_THIRD, mode):
                plant.imu.receive_byte(now, byte)
        return None

    @cython.cfunc
    def _observe(self) -> object:
        """Read the sensors and the body's state, in the order of the outputs."""
        plant: RangerPlant = self.plant
        numbers: cython.double[::1] = self.numbers
        encoder: IncrementalEncoder
        place: cython.longlong = INPUT_COUNT
        k: cython.longlong
        self.observed = True
        for k in range(ANALOG_COUNT):
            numbers[place] = plant.analog_end[k]
            place += 1
        for k in range(WORD_COUNT):
            numbers[place] = plant.words[k]
            place += 1
        for k in range(ENCODER_COUNT):
            encoder = plant.encoders[k]
            numbers[place] = encoder.cell
            place += 1
        numbers[place] = plant.imu.roll
        numbers[place + 1] = plant.imu.rate_x
        place += 2
        plant.fill_sample(self.samples)
        for k in range(len(self.samples)):
            numbers[place] = self.samples[k]
            place += 1
        numbers[place] = plant.distance_m
        numbers[place + 1] = plant.fell
        return None
