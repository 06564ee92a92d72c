"""The common part of the four motor boards (B2A): chip, peripherals, modules, publishing, start-up.

Each board's module (hip.py, outer_feet.py, inner_feet.py, steering.py) holds its constants and its table
of what runs when. Source: robot.md N1.2, N4, N5, N6.1.

Where the numbers of cycles come from: two per instruction, as counted in the images (robot.md T2); tables read
`2 * instructions`. Where least, median and most differ by the work done, the difference is in what is counted per item
or spent by the work itself; where they differ without a reason that is modelled, the median is used. MCFO has no
counted figures: it is MCFI with another encoder's sign, and has its figures. Other derived numbers have their reason
at the line.
A task's limit is about a third above the most that was counted, or can be for a full ring: 63 edges, 20 frames of
gains, ten errors at once; a Wait's is its converter's whole sequence.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.boards.firmware_board import ALL_CAN_INTERRUPTS, SatelliteBoard
from ranger_sim.boards.modules.absolute_encoder import AbsoluteEncoder
from ranger_sim.boards.modules.adc_readings import AdcReadings
from ranger_sim.boards.modules.compliant_control import (
    COMMAND,
    DAMPNESS,
    STIFFNESS,
    TARGET,
    CompliantControl,
    GainReceiver,
)
from ranger_sim.boards.modules.current_control import INTEGRAL_GAIN, PROPORTIONAL_GAIN, CurrentControl
from ranger_sim.boards.modules.encoder_capture import EncoderCapture, WrapCounter
from ranger_sim.boards.modules.mcu_led import PINS as LED_PINS
from ranger_sim.boards.modules.motor_limits import MotorLimits
from ranger_sim.boards.modules.motor_output import PERIOD_COUNTS, MotorOutput
from ranger_sim.boards.modules.motor_output import PINS as MOTOR_PINS
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.adc_external import CONVERSION_NS as FASTEST_CONVERSION_NS
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.gpio import p0
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.spi_encoder import SpiEncoder
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.vic import ADC_DONE, EXTERNAL_INTERRUPT, IRQ_LATENCY, SPI_DONE, InterruptSource
from ranger_sim.foundation.events import EventQueue
from ranger_sim.foundation.numbers import fixed_of_float, float32

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

# Processor pins by connected device (robot.md N4.1, N4.4, N4.7, N4.9, N4.11); for the wiring table.
PINS = {
    **{f"led_{colour}": pin for colour, pin in LED_PINS.items()},
    **MOTOR_PINS,
    "limit_switch_left": p0(0),
    "limit_switch_right": p0(1),
    "absolute_encoder_select": p0(13),
    "encoder_01_a": p0(22),
    "encoder_01_b": p0(27),
    "encoder_23_a": p0(16),
    "encoder_23_b": p0(29),
}
# Places on `chip.analog`, in volts at the converter's input; differential pairs are one place.
ANALOG = {
    "motor_current": 0,
    "battery_current": 1,
    "left_foot": 2,
    "right_foot": 3,
    "steering_sensor": 4,
    "battery_voltage": 5,
}
NOT_CONVERTED = 0.0  # sent as the bridge's temperature on AIN3, which no board converts (robot.md N4.6)
# Places on `chip.words`.
WORDS = {"absolute_encoder": 0}

# About 23,000 instructions pass from reset to the first slot (robot.md N7.3): at 1.3 cycles each 0.5 ms.
START_VALUES_NS = 400_000
SLOTS_BEGIN_NS = 500_000
# The two alarms of the start
START_VALUES, SLOTS_BEGIN = 0, 1

# The external converter takes longer on the robot than in its data sheet: with this the slots of MCFI and MCSI are as
# long as the logs' (robot.md T1). MCH keeps the data sheet's: its two conversions end before any task waits (T2).
CONVERSION_NS = 31_000

BATTERY_VOLTAGE_CHANNEL: Final = 1  # AIN1, P0.28

# Receive lists, which are searched from the first entry: MCH's is known (robot.md N2.4). The others' order is chosen by
# us: on MCFI the time and three gains take 632 instructions for MCH's 716 (T2), so they are a place or two earlier.
RECEIVE_LIST = {
    "MCH": ("MOTOR_TARGET_CURRENT", "TIMESTAMP", "SHUTDOWN", "COMMAND_CURRENT", "STIFFNESS", "DAMPNESS", "SLEEP"),
}
USUAL_RECEIVE_LIST = (
    "TIMESTAMP", "COMMAND_CURRENT", "STIFFNESS", "DAMPNESS", "MOTOR_TARGET_CURRENT", "SHUTDOWN", "SLEEP",
)  # fmt: skip

# VIC slots (robot.md N4.16)
EXTERNAL_ADC_SLOT = 1
INTERNAL_ADC_SLOT = 3
TIMER_SLOT = 4
CAN_ERROR_SLOT = 8
SPI_SLOT = 10


@cython.cclass
class PowerUp(Peripheral):
    """The part of `main` before the scheduler's loop: one reading of the sensors, then start values.

    ROBOT PARITY: the firmware waits for the reading and hangs for ever without a sensor; here the slots begin
    anyhow and the start values are those of a count of 0.
    """

    board: "MotorBoard"
    first: "Alarm"
    second: "Alarm"

    def __init__(self, chip, board) -> None:
        Peripheral.__init__(self, chip)
        self.board = board
        self.first = chip.new_alarm(self, START_VALUES)
        self.second = chip.new_alarm(self, SLOTS_BEGIN)

    @cython.ccall
    def begin(self, phase_ns: cython.longlong) -> None:
        """Power comes at `phase_ns`."""
        self.first.set(phase_ns + START_VALUES_NS)
        self.second.set(phase_ns + SLOTS_BEGIN_NS - 1)

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        if alarm == START_VALUES:
            self.board.read_sensors_once()
        else:
            self.board.set_start_values()
        return None


@cython.cclass
class MotorBoard(SatelliteBoard):
    """A B2A board. `table`: generated module of the board; `quirks`: switches; `phase_ns`: when it gets power.

    `largest_duty` in counts of 600, `sign` of the motor's mounting, `gear` of the motor (0: no encoder).
    """

    # what the tasks of every slot and the interrupts touch
    adc_external: Ads7871
    adc_internal: AdcInternal
    spi: SpiEncoder
    encoder: AbsoluteEncoder
    motor: QuadratureDecoder
    compliance: CompliantControl
    limits: MotorLimits
    current_control: CurrentControl
    readings: AdcReadings
    # the rest
    pwm: Pwm
    output: MotorOutput
    cap01: QuadratureDecoder
    cap23: QuadratureDecoder
    capture01: EncoderCapture
    capture23: EncoderCapture
    wraps: WrapCounter
    timer0: TimerCapture
    encoder_select: cython.longlong
    rezero_count: cython.longlong
    rezeroing: cython.bint
    power_up: PowerUp

    def __init__(
        self,
        table,
        crystal,
        quirks,
        phase_ns,
        sequence,
        readings,
        limits,
        sign,
        largest_duty,
        gear,
        interrupts=ALL_CAN_INTERRUPTS,
        conversion_ns=FASTEST_CONVERSION_NS,
    ) -> None:
        board: object = self  # bound methods are looked up dynamically
        SatelliteBoard.__init__(self, table, crystal, quirks, CAN_ERROR_SLOT, interrupts)
        quirks = self.quirks
        # converters
        self.adc_external = Ads7871(self, eint=1, conversion_ns=conversion_ns)
        self.adc_external.set_sequence(*((channel, gain, ANALOG[place]) for place, channel, gain in sequence))
        self.adc_internal = AdcInternal(self, clkdiv=200)
        self.adc_internal.inputs[BATTERY_VOLTAGE_CHANNEL] = ANALOG["battery_voltage"]
        places = [place for place, _, _ in sequence]
        self.readings = AdcReadings(
            self.adc_external,
            self.adc_internal,
            motor_entry=places.index("motor_current"),
            battery_entry=places.index("battery_current"),
            **readings,
        )
        # the interrupts' cycles are two per instruction counted (robot.md T2), latency included
        self.vic.attach(
            EXTERNAL_INTERRUPT,
            1,
            board.adc_external.on_busy,
            cost=2 * 68 - IRQ_LATENCY,
            slot=EXTERNAL_ADC_SLOT,
            name="adcx_busy",
        )
        self.vic.attach(
            ADC_DONE, 0, board.on_internal_adc, cost=2 * 38 - IRQ_LATENCY, slot=INTERNAL_ADC_SLOT, name="adci_done"
        )
        # motor
        self.pwm = Pwm(self, period=PERIOD_COUNTS, phase_ns=phase_ns)
        self.output = MotorOutput(
            self.gpio,
            self.pwm,
            sign=sign,
            largest=largest_duty,
            offset=quirks.alternating_offset_counts,
        )
        self.compliance = CompliantControl(quirks.compliant_gain_sign, quirks.gains_latch_with_current)
        self.limits = MotorLimits(
            self.errors,
            codes,
            gear=gear,
            derating=quirks.thermal_derating,
            peak=quirks.peak_current_limiter,
            speed=quirks.speed_limiter,
            **limits,
        )
        self.current_control = CurrentControl(
            self.limits,
            self.output,
            self.heartbeat,
            self.errors,
            codes,
            proportional_gain=PROPORTIONAL_GAIN if quirks.proportional_current_control else 0,
            integral_gain=INTEGRAL_GAIN,
        )
        self.motor = None
        self.encoder = None
        self.spi = None
        self.encoder_select = 0
        self.rezeroing = False
        self.rezero_count = 0
        self.subscribe()
        self.power_up = PowerUp(self, self)
        self.power_up.begin(phase_ns)

    def subscribe(self) -> None:
        """Fill the receive list, in the order of RECEIVE_LIST."""
        name = self.table.BOARD + "_"
        receivers = {
            "MOTOR_TARGET_CURRENT": GainReceiver(self.compliance, TARGET),
            "SHUTDOWN": self.output.shutdown,
            "COMMAND_CURRENT": GainReceiver(self.compliance, COMMAND),
            "STIFFNESS": GainReceiver(self.compliance, STIFFNESS),
            "DAMPNESS": GainReceiver(self.compliance, DAMPNESS),
            "SLEEP": self.output.sleep,
        }
        for entry in RECEIVE_LIST.get(self.name, USUAL_RECEIVE_LIST):
            if entry == "TIMESTAMP":
                self.can.subscribe(self.table.TIMESTAMP, self.time)
            else:
                self.can.subscribe(getattr(self.table, name + entry), receivers[entry])

    def add_encoders(self, phase_ns, cap01, cap23) -> None:
        """The two incremental encoders on timer 0: (pulses, gear) of the pairs 0/1 and 2/3."""
        quirks = self.quirks
        self.timer0 = TimerCapture(self, number=0, period=30000, phase_ns=phase_ns, match_interrupt=True)
        self.wraps = WrapCounter(self.timer0)
        self.cap01 = QuadratureDecoder(
            *cap01,
            self.errors,
            codes.QDC_CH01_GLTCH,
            codes.QDC_CH01_BUF_F,
            filter_exponent=quirks.rate_filter_exponent,
        )
        self.cap23 = QuadratureDecoder(
            *cap23,
            self.errors,
            codes.QDC_CH23_GLTCH,
            codes.QDC_CH23_BUF_F,
            filter_exponent=quirks.rate_filter_exponent,
        )
        self.capture01 = EncoderCapture(self, self.wraps, 0, PINS["encoder_01_a"], PINS["encoder_01_b"], self.cap01)
        self.capture23 = EncoderCapture(self, self.wraps, 2, PINS["encoder_23_a"], PINS["encoder_23_b"], self.cap23)
        self.wraps.attach(self)

    def add_absolute_encoder(self, second_connector, zero, sign, rpm) -> None:
        """The joint's encoder on SPI 0, at connector J3 (AE_1) or, `second_connector`, J9 (AE_2)."""
        self.encoder = AbsoluteEncoder(zero, sign, rpm, self.errors, codes.AE_SPIKE)
        self.spi = SpiEncoder(self, number=0, word=WORDS["absolute_encoder"])
        self.encoder_select = second_connector
        board: object = self
        self.vic.attach(
            SPI_DONE, 0, board.on_absolute_encoder, cost=2 * 35 - IRQ_LATENCY, slot=SPI_SLOT, name="ae_read"
        )

    def start_slots(self, phase_ns) -> None:
        """Start the scheduler; the first slot comes when the start values are set."""
        self.filter_frames()
        self.start(self.schedule(), phase_ns + SLOTS_BEGIN_NS)

    # --- start-up ---------------------------------------------------------------------------------------

    @cython.ccall
    def read_sensors_once(self) -> None:
        """Before the first slot: low sides on, multiplexer set, and one reading of the joint's angle."""
        self.output.enable_low_side(1)
        if self.encoder is not None:
            self.gpio.write(PINS["absolute_encoder_select"], self.encoder_select)
            self.spi.start()

    @cython.ccall
    def set_start_values(self) -> None:
        """Set the start values when that reading is complete."""

    # --- tasks ------------------------------------------------------------------------------------------

    def start_internal_adc(self) -> None:
        """adci_convert_all: battery voltage."""
        if not self.adc_internal.start(BATTERY_VOLTAGE_CHANNEL):
            self.errors.report(codes.ADCI_DNF)

    def start_absolute_encoder(self) -> None:
        """ae_update: begin a transfer; the interrupt 14 us later has the result for this slot's control."""
        self.spi.start()

    def on_absolute_encoder(self, queue: EventQueue) -> None:
        """Interrupt: the transfer is complete."""
        self.encoder.accept(self.spi.read())

    def on_internal_adc(self, queue: EventQueue) -> None:
        """Interrupt: the result stays in `adc_internal.result`; no filter on these boards."""

    def start_external_adc(self) -> None:
        """adcx_convert_all: start the sequence; the last one unfinished is an error, and it goes on."""
        if not self.adc_external.start_sequence():
            self.errors.report(codes.ADCX_DNF)

    @cython.ccall
    @cython.exceptval(check=False)
    def controlled_position(self) -> cython.longlong:
        """Position in the compliant law, rad x 65536: of the motor, unless a board's module overrides it."""
        return self.motor.position

    @cython.ccall
    @cython.exceptval(check=False)
    def controlled_velocity(self) -> cython.longlong:
        """Velocity in the compliant law, rad/s x 65536."""
        return self.motor.rate

    def compliant_control(self) -> None:
        """mc_compliant_control: both loops, outer then inner."""
        velocity: cython.longlong = self.controlled_velocity()
        target: cython.longlong = self.compliance.update(self.controlled_position(), velocity)
        target = self.limits.limit_target(target, velocity)
        self.compliance.target = target
        self.current_control.update(target, self.readings.motor_current_fixed())

    @cython.ccall
    def rezero_motor(self, share: cython.double) -> None:
        """Move the motor's angle towards the joint's by `share` of their difference, in single floats.

        The count is set when the line's cycles are over; edges since the slot read the angle are forgotten,
        on the robot as here.
        """
        angle: cython.double = float32(self.motor.position_rad())
        difference: cython.double = float32(self.encoder.radians - angle)
        self.rezero_count = self.motor.count_at(fixed_of_float(float32(angle + difference * share)))
        self.rezeroing = True

    def end_line(self) -> None:
        """Slot task: the end of the row's line, which sends its frame or sets the motor's count."""
        if self.rezeroing:
            self.rezeroing = False
            self.motor.count = self.rezero_count
        self.can.transmit()
