# Generated from boards/user_interface.py and boards/user_interface.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.firmware_board import SatelliteBoard
from ranger_sim.boards.modules.buzzer import Buzzer
from ranger_sim.boards.modules.colour_leds import ColourLeds
from ranger_sim.boards.modules.imu_parser import ImuParser
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.boards.modules.lcd import Lcd
from ranger_sim.boards.modules.rc_receiver import RcReceiver
from ranger_sim.boards.modules.sync_light import SyncLight
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.scheduler import Schedule
from typing import Any
from typing import final

RC_PINS: tuple[Any, ...]
PINS: dict[str, Any]
IMU_UART: int
TIMER_SLOT: int
RC_SLOT: int
UART_SLOT: int
CAN_ERROR_SLOT: int
IMU_START_SLOTS: int
RC_CYCLES: int
UART_CYCLES: int
UART_BYTE_CYCLES: int
LCD_IDLE_CYCLES: int
LCD_BYTE_CYCLES: int
IMU_CYCLES: int
IMU_BYTE_CYCLES: int

@final
class UserInterfaceBoard(SatelliteBoard):
    imu: ImuParser
    uart1: Uart
    lcd: Lcd
    sync_light: SyncLight
    buzzer: Buzzer
    slots: int
    imu_start_slots: int
    timer0: TimerCapture
    rc: RcReceiver
    keypad: Keypad
    leds: ColourLeds
    imu_command: bytes
    def __init__(self, crystal: Any, quirks: Any, phase_ns: Any = 0) -> None: ...
    def listen(self) -> None: ...
    def schedule(self) -> Schedule: ...
    def on_uart(self, queue: Any) -> Any: ...
    def on_rc_edge(self, queue: Any) -> None: ...
    def lcd_tick(self) -> None: ...
    def update_imu(self) -> Any: ...
    def update_errors(self) -> Any: ...
    def watch_sync_key(self) -> None: ...
    def update_sync_light(self) -> Any: ...
    def update_buzzer(self) -> None: ...
