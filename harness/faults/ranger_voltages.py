"""Faults of Ranger's analog inputs: what its sensors measure (A, V of the battery, rad, V of a foot's sensor)."""

from collections.abc import Mapping

from ranger_sim.boards.steering import LIMITS as STEERING_LIMITS
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults import kinds, signals
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Parameter, WholeNumber
from ranger_sim.harness.faults.sensor import Quantity, lasting, mode_classes
from ranger_sim.harness.faults.voltages import VoltageFault
from ranger_sim.plant.electrics.electrics import STEERING_CENTRE_V, STEERING_V_PER_RAD
from ranger_sim.plant.sensors.foot_sensor import STANCE_COUNTS, SWING_COUNTS, VOLTS_PER_COUNT

# fmt: off
QUANTITIES: Mapping[str, Quantity] = {
    #                              unit  typical limit  clip low, high       open
    kinds.MOTOR_CURRENT: Quantity("A",  1.0,    20.0,  -1.0, 1.0,           0.0,
        "chosen by us: a quarter of the hip's largest command (robot.md N4.2); the sensor ends at 12.6 A"),
    kinds.BATTERY_CURRENT: Quantity("A", 0.5,   10.0,  -0.3, 0.3,           0.0,
        "chosen by us: the motors of the 65 km walk took 0.4 A together (robot.md B5)"),
    kinds.BATTERY_VOLTAGE: Quantity("V", 2.0,   60.0,  0.0, 20.0,           0.0,
        "chosen by us: the packs go from 29 to 23 V; the converter ends at 33 V"),
    kinds.FOOT: Quantity("V",           0.5,    5.0,   0.0, 0.5,            0.0,
        "chosen by us: 0.5 V are 1638 counts, a quarter of the way from swing to stance (robot.md C3.2)"),
    kinds.STEERING_ANGLE: Quantity("rad", 0.02, 5.0,   -0.002, 0.002,       -STEERING_CENTRE_V / STEERING_V_PER_RAD,
        "chosen by us: half of the feet's travel; an open wire reads 0 V"),
    kinds.SUPPLY_CURRENT: Quantity("A", 0.1,    2.0,   0.0, 0.1,            0.0,
        "chosen by us: half of the electronics' current"),
    kinds.SUPPLY_VOLTAGE: Quantity("V", 2.0,    60.0,  0.0, 20.0,           0.0,
        "chosen by us: as the motor boards' battery voltage"),
}
# fmt: on
STEERING_BOARD = "MCSI"
# Only the currents of the motor boards come on two wires (robot.md N4.5).
DIFFERENTIAL = (kinds.MOTOR_CURRENT, kinds.BATTERY_CURRENT)


class RangerVoltageFault(VoltageFault):
    """As for any machine, except that the steering's currents stay inside a range."""

    def check_range(self) -> None:
        if self.signal_class is not signals.Saturation or self.place.details["board"] != STEERING_BOARD:
            return
        most_A, low, high = STEERING_LIMITS["current_max"], self.values["low"], self.values["high"]
        if self.place.kind in DIFFERENTIAL and low <= -most_A and high >= most_A:
            raise FaultError(
                f"fault {self.text()}: it cannot act there; the steering's board holds its motor to {most_A:g} A, so "
                f"its currents never leave {low:g} to {high:g} A; give low= and high= inside -{most_A:g} to {most_A:g}"
            )


for kind, quantity in QUANTITIES.items():
    for each in mode_classes(
        RangerVoltageFault, kind, quantity, without=() if kind in DIFFERENTIAL else ("swapped_sign",)
    ):
        mode(each)

SWING_V, STANCE_V = SWING_COUNTS * VOLTS_PER_COUNT, STANCE_COUNTS * VOLTS_PER_COUNT
LEVELS = "swing and stance as the boards read them, 700 and 7000 counts (robot.md C3.2)"


@mode
class ContactChatter(RangerVoltageFault):
    """The interrupter's flag trembles: the voltage jumps between open and closed."""

    mode = "contact_chatter"
    kinds = (kinds.FOOT,)
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
class ContactStuck(RangerVoltageFault):
    """The gap of the foot stays open or closed."""

    mode = "contact_stuck"
    kinds = (kinds.FOOT,)
    needs = "a foot's contact"
    meaning = "stays open or closed"
    unit = "V"
    signal_class = signals.Stuck
    parameters = (WholeNumber("closed", "1", 1.0, 0.0, 1.0, "1: closed as in stance, 0: open as in swing", LEVELS),)

    def new_signal(self) -> signals.Signal:
        return signals.Stuck(self.random, level=STANCE_V if self.values["closed"] >= 0.5 else SWING_V)
