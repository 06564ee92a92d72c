"""Faults of analog inputs: another voltage at the converter's pin than the sensor gives.

A pin's voltage runs straight over a step of the plant. Values are told in what the sensor measures (A, V of the
battery, rad, V of a foot's sensor) and go through the sensor's line to the pin (plant/electrics.py).
"""

from collections.abc import Mapping
from typing import Any

from ranger_sim.boards.steering import LIMITS as STEERING_LIMITS
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults import places, signals
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Parameter, WholeNumber
from ranger_sim.harness.faults.sensor import Quantity, SignalFault, lasting, mode_classes
from ranger_sim.plant.electrics import STEERING_CENTRE_V, STEERING_V_PER_RAD
from ranger_sim.plant.foot_sensor import STANCE_COUNTS, SWING_COUNTS, VOLTS_PER_COUNT

MOST_DEVIATIONS = 3.7  # of NoiseSource's normal numbers (plant/noise.py)

# fmt: off
QUANTITIES: Mapping[str, Quantity] = {
    #                              unit  typical limit  clip low, high       open
    places.MOTOR_CURRENT: Quantity("A",  1.0,    20.0,  -1.0, 1.0,           0.0,
        "chosen by us: a quarter of the hip's largest command (robot.md N4.2); the sensor ends at 12.6 A"),
    places.BATTERY_CURRENT: Quantity("A", 0.5,   10.0,  -0.3, 0.3,           0.0,
        "chosen by us: the motors of the 65 km walk took 0.4 A together (robot.md B5)"),
    places.BATTERY_VOLTAGE: Quantity("V", 2.0,   60.0,  0.0, 20.0,           0.0,
        "chosen by us: the packs go from 29 to 23 V; the converter ends at 33 V"),
    places.FOOT: Quantity("V",           0.5,    5.0,   0.0, 0.5,            0.0,
        "chosen by us: 0.5 V are 1638 counts, a quarter of the way from swing to stance (robot.md C3.2)"),
    places.STEERING_ANGLE: Quantity("rad", 0.02, 5.0,   -0.002, 0.002,       -STEERING_CENTRE_V / STEERING_V_PER_RAD,
        "chosen by us: half of the feet's travel; an open wire reads 0 V"),
    places.SUPPLY_CURRENT: Quantity("A", 0.1,    2.0,   0.0, 0.1,            0.0,
        "chosen by us: half of the electronics' current"),
    places.SUPPLY_VOLTAGE: Quantity("V", 2.0,    60.0,  0.0, 20.0,           0.0,
        "chosen by us: as the motor boards' battery voltage"),
}
# fmt: on
STEERING_BOARD = "MCSI"
# Only the currents of the motor boards come on two wires (robot.md N4.5).
DIFFERENTIAL = (places.MOTOR_CURRENT, places.BATTERY_CURRENT)


class VoltageFault(SignalFault):
    """A signal in the place of what the sensor on one analog input measures."""

    def connect(self) -> None:
        self.electrics: Any = self.robot.plant.electrics
        self.voltage: int = self.place.details["voltage"]
        self.check_range()
        self.zero_V: float = self.electrics.zero_V[self.voltage]
        self.slope_V: float = self.electrics.slope_V[self.voltage]
        self.started = False
        self.true_end_V = 0.0  # at the end of the latest step, as the sensor gives it
        self.shown_end_V = 0.0

    def check_range(self) -> None:
        """UserError for limits that the sensor never comes to."""
        if self.signal_class is not signals.Saturation or self.place.details["board"] != STEERING_BOARD:
            return
        most_A, low, high = STEERING_LIMITS["current_max"], self.values["low"], self.values["high"]
        if self.place.kind in DIFFERENTIAL and low <= -most_A and high >= most_A:
            raise UserError(
                f"fault {self.text()}: it cannot act there; the steering's board holds its motor to {most_A:g} A, so "
                f"its currents never leave {low:g} to {high:g} A; give low= and high= inside -{most_A:g} to {most_A:g}"
            )

    def begin(self, now_ns: int) -> None:
        super().begin(now_ns)
        self.signal = self.new_signal()
        self.started = False

    def after(self, start_ns: int, end_ns: int) -> None:
        starts, ends, place = self.electrics.analog_start, self.electrics.analog_end, self.voltage
        if not self.started:
            self.started = True
            self.signal.begin(self.value(starts[place]), start_ns)
            self.shown_end_V = self._instead(starts[place], start_ns)
        self.true_end_V = ends[place]
        starts[place] = self.shown_end_V
        self.shown_end_V = self._instead(self.true_end_V, end_ns)
        ends[place] = self.shown_end_V

    def value(self, volts: float) -> float:
        """What the sensor measures at this voltage."""
        return (volts - self.zero_V) / self.slope_V

    def _instead(self, volts: float, now_ns: int) -> float:
        """The voltage that stands in the place of the sensor's."""
        true = self.value(volts)
        shown = self.signal.shown(true, now_ns)
        if shown == true:
            return volts
        self.note(now_ns, shown - true)
        return self.zero_V + self.slope_V * shown

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """The voltage is that of what the plant has now, but for the sensor's noise."""
        electrics, place = self.electrics, self.voltage
        if self.started:
            electrics.analog_start[place] = self.true_end_V
            self.started = False
        expected_V = self.zero_V + self.slope_V * electrics.values[place]
        noise_V = MOST_DEVIATIONS * electrics.noise_V[place] + 1e-9
        return bool(abs(electrics.analog_end[place] - expected_V) <= noise_V)


for kind, quantity in QUANTITIES.items():
    for each in mode_classes(VoltageFault, kind, quantity, without=() if kind in DIFFERENTIAL else ("swapped_sign",)):
        mode(each)

SWING_V, STANCE_V = SWING_COUNTS * VOLTS_PER_COUNT, STANCE_COUNTS * VOLTS_PER_COUNT
LEVELS = "swing and stance as the boards read them, 700 and 7000 counts (robot.md C3.2)"


@mode
class ContactChatter(VoltageFault):
    """The interrupter's flag trembles: the voltage jumps between open and closed."""

    mode = "contact_chatter"
    kinds = (places.FOOT,)
    needs = "a foot's contact"
    meaning = "jumps between open and closed for a while, at random"
    unit = "V"
    signal_class = signals.Chatter
    parameters = (
        Parameter("low", "V", SWING_V, 0.0, 5.0, "the open contact", LEVELS),
        Parameter("high", "V", STANCE_V, 0.0, 5.0, "the closed one", LEVELS),
        *lasting("chatter", 20.0, 100.0),
    )


@mode
class ContactStuck(VoltageFault):
    """The gap of the foot stays open or closed."""

    mode = "contact_stuck"
    kinds = (places.FOOT,)
    needs = "a foot's contact"
    meaning = "stays open or closed"
    unit = "V"
    signal_class = signals.Stuck
    parameters = (WholeNumber("closed", "1", 1.0, 0.0, 1.0, "1: closed as in stance, 0: open as in swing", LEVELS),)

    def new_signal(self) -> signals.Signal:
        return signals.Stuck(self.random, level=STANCE_V if self.values["closed"] >= 0.5 else SWING_V)
