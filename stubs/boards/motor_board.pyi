# Generated from boards/motor_board.py and boards/motor_board.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.firmware_board import SatelliteBoard
from ranger_sim.boards.modules.absolute_encoder import AbsoluteEncoder
from ranger_sim.boards.modules.adc_readings import AdcReadings
from ranger_sim.boards.modules.compliant_control import CompliantControl
from ranger_sim.boards.modules.current_control import CurrentControl
from ranger_sim.boards.modules.encoder_capture import EncoderCapture
from ranger_sim.boards.modules.encoder_capture import WrapCounter
from ranger_sim.boards.modules.motor_limits import MotorLimits
from ranger_sim.boards.modules.motor_output import MotorOutput
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.spi_encoder import SpiEncoder
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import EventQueue
from typing import Any

BATTERY_VOLTAGE_CHANNEL: int
PINS: dict[str, Any]
ANALOG: dict[str, int]
NOT_CONVERTED: float
WORDS: dict[str, int]
START_VALUES_NS: int
SLOTS_BEGIN_NS: int
START_VALUES: int
SLOTS_BEGIN: int
CONVERSION_NS: int
RECEIVE_LIST: dict[str, tuple[str, ...]]
USUAL_RECEIVE_LIST: tuple[str, ...]
EXTERNAL_ADC_SLOT: int
INTERNAL_ADC_SLOT: int
TIMER_SLOT: int
CAN_ERROR_SLOT: int
SPI_SLOT: int

class PowerUp(Peripheral):
    board: MotorBoard
    first: Alarm
    second: Alarm
    def __init__(self, chip: Any, board: MotorBoard) -> None: ...
    def begin(self, phase_ns: int) -> None: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...

class MotorBoard(SatelliteBoard):
    adc_external: Ads7871
    adc_internal: AdcInternal
    spi: SpiEncoder
    encoder: AbsoluteEncoder | None
    motor: QuadratureDecoder
    compliance: CompliantControl
    limits: MotorLimits
    current_control: CurrentControl
    readings: AdcReadings
    pwm: Pwm
    output: MotorOutput
    cap01: QuadratureDecoder
    cap23: QuadratureDecoder
    capture01: EncoderCapture
    capture23: EncoderCapture
    wraps: WrapCounter
    timer0: TimerCapture
    encoder_select: int
    rezero_count: int
    rezeroing: bool
    power_up: PowerUp
    def __init__(self, table: Any, crystal: Any, quirks: Any, phase_ns: Any, sequence: Any, readings: Any, limits: Any, sign: Any, largest_duty: Any, gear: Any, interrupts: Any = ..., conversion_ns: Any = ...) -> None: ...
    def listen(self) -> None: ...
    def add_encoders(self, phase_ns: Any, cap01: Any, cap23: Any) -> None: ...
    def add_absolute_encoder(self, second_connector: Any, zero: Any, sign: Any, rpm: Any) -> None: ...
    def start_slots(self, phase_ns: Any) -> None: ...
    def read_sensors_once(self) -> None: ...
    def set_start_values(self) -> None: ...
    def start_internal_adc(self) -> None: ...
    def start_absolute_encoder(self) -> None: ...
    def on_absolute_encoder(self, queue: EventQueue) -> None: ...
    def on_internal_adc(self, queue: EventQueue) -> None: ...
    def start_external_adc(self) -> None: ...
    def controlled_position(self) -> int: ...
    def controlled_velocity(self) -> int: ...
    def compliant_control(self) -> None: ...
    def rezero_motor(self, share: float) -> None: ...
    def end_line(self) -> None: ...
