"""The user interface board (UI, B8A): IMU, keys, radio control, display, colour lights, buzzer.

Source: robot.md N3.6, N4.10-N4.12, N4.16; appendix 3.7, 3.8. The devices for a person are connected to its pins:
`board.panel.text()`, `board.panel.colour(i)`, `board.panel.hertz`; `board.memory` has all of it as words,
also for a board in a separate process, and for any program (modules/front_panel.py).
"""

import cython

from ranger_sim.boards.firmware_board import TICK_CYCLES, SatelliteBoard
from ranger_sim.boards.modules.buzzer import PERIOD_AT_START, Buzzer, BuzzerFrequency, ErrorSound, TuneStart
from ranger_sim.boards.modules.can_link import TRANSMIT_CYCLES
from ranger_sim.boards.modules.colour_leds import CYCLES_PER_WRITE, ColourLeds, LedReceiver
from ranger_sim.boards.modules.front_panel import KEY_PINS, SYNC_PIN, FrontPanel
from ranger_sim.boards.modules.imu_parser import (
    HEADER_ANGLES_AND_RATES,
    HEADER_RATES_ONLY,
    ImuParser,
    start_command,
)
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.boards.modules.lcd import Lcd, LcdQuarter
from ranger_sim.boards.modules.mcu_led import PINS as LED_PINS
from ranger_sim.boards.modules.publishing import Send, laid_out
from ranger_sim.boards.modules.rc_receiver import RcReceiver
from ranger_sim.boards.modules.sync_light import SyncLight
from ranger_sim.datatable.generated import ui as table
from ranger_sim.firmware_sim.peripherals.gpio import p0
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.ssp import SspMaster
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import TIMER_MATCH
from ranger_sim.foundation.events import UART_BYTE

# Processor pins by connected device (robot.md N4.11); for the wiring table.
RC_PINS = (p0(22), p0(27), p0(16), p0(29))  # the sync light drives the third, so it receives no radio
PINS = {
    **{f"led_{colour}": pin for colour, pin in LED_PINS.items()},
    **{f"key_{key}": pin for key, pin in enumerate(KEY_PINS)},
    **{f"radio_{channel}": RC_PINS[channel] for channel in (0, 1, 3)},
    "sync_light": SYNC_PIN,
}
IMU_UART = 1

# VIC slots (robot.md N4.16)
TIMER_SLOT = 1
RC_SLOT = 2
UART_SLOT = 3
CAN_ERROR_SLOT = 9

# ROBOT PARITY: the robot counts a float up to 20e6 before its first slot and only then asks the IMU for
# packets; here the board's slots begin at power-up and the request goes out after 20 of them (chosen by us,
# because that delay only waits for the IMU to wake, and every run would begin with it).
IMU_START_SLOTS = 20
# Cycles of the functions that the motor boards do not have, two per instruction; the instructions are estimated by us
# along the listed work, because none were counted.
RC_CYCLES = 2 * 66  # four flags tested, one width filtered
UART_CYCLES = 2 * 35  # entry, U1IIR, the loop, exit
UART_BYTE_CYCLES = 2 * 25  # U1LSR, U1RBR, the ring and its test for full
LCD_IDLE_CYCLES = 2 * 10
LCD_BYTE_CYCLES = 2 * 60  # eight data pins, three control pins, each a read-modify-write
IMU_CYCLES = 2 * 60  # both indices, the search for a header
IMU_BYTE_CYCLES = 2 * 30  # a byte is taken from the ring twice, for the sum and for its word


@cython.final
@cython.cclass
class UserInterfaceBoard(SatelliteBoard):
    """Slots of 1 ms, 3 rows. `phase_ns`: when it gets power, and its first slot begins."""

    # what the tasks of every slot and the interrupts touch
    imu: ImuParser
    uart1: Uart
    lcd: Lcd
    sync_light: SyncLight
    buzzer: Buzzer
    slots: cython.longlong
    imu_start_slots: cython.longlong
    # the rest
    timer0: TimerCapture
    rc: RcReceiver
    keypad: Keypad
    leds: ColourLeds
    imu_command: bytes

    def __init__(self, crystal, quirks, phase_ns=0) -> None:
        board: object = self  # a compiled class would hand out wrappers of inherited methods
        SatelliteBoard.__init__(self, table, crystal, quirks, CAN_ERROR_SLOT)
        quirks = self.quirks
        # inertial sensor: 460 526 baud (robot.md N4.10)
        rates_only = quirks.imu_packets == "rates"
        header = HEADER_RATES_ONLY if rates_only else HEADER_ANGLES_AND_RATES
        self.uart1 = Uart(self, IMU_UART, divisor=6, divaddval=5, mulval=14, trigger=8)
        self.imu = ImuParser(board.report, header, not rates_only)
        self.imu_command = start_command(header)
        self.imu_start_slots = IMU_START_SLOTS
        self.slots = 0
        self.vic.attach(UART_BYTE, IMU_UART, self.on_uart, UART_CYCLES, UART_BYTE_CYCLES, slot=UART_SLOT, name="uart1")
        # radio control: one interrupt of the timer for its four captures
        self.timer0 = TimerCapture(self, 0, period=600_000, phase_ns=phase_ns)
        self.rc = RcReceiver(board.report)
        captures = self.vic.source(TIMER_MATCH, 0)
        for channel in (0, 1, 3):
            self.timer0.use_channel(channel, RC_PINS[channel], source=captures)
        self.vic.attach(TIMER_MATCH, 0, self.on_rc_edge, RC_CYCLES, slot=RC_SLOT, name="timer0 capture")
        # keys, display, lights and buzzer
        panel = FrontPanel(self)
        self.carry(panel)
        self.keypad = Keypad(self.gpio, board.report)
        self.lcd = Lcd(self.gpio, board.report)
        self.leds = ColourLeds(SspMaster(self, panel.ssp), self.gpio)
        pwm = Pwm(self, period=PERIOD_AT_START, phase_ns=phase_ns)
        self.buzzer = Buzzer(pwm, quirks.buzzer_beeps, quirks.song_repeats_for_ever)
        self.sync_light = SyncLight(self.gpio, self.keypad, self.leds)
        self.subscribe()
        self.on_timer_tick = self.lcd_tick
        self.filter_frames()
        self.start(self.schedule(), phase_ns)

    def subscribe(self) -> None:
        """Fill the receive list (robot.md N2.4)."""
        subscribe = self.can.subscribe
        subscribe(table.TIMESTAMP, self.time)
        for quarter in range(4):
            subscribe(getattr(table, f"UI_SET_LCD_QUAD_{quarter + 1}"), LcdQuarter(self.lcd, quarter))
        for led in range(6):
            subscribe(getattr(table, f"UI_SET_LED_{led + 1}"), LedReceiver(self.leds, led))
        subscribe(table.UI_SET_BUZZER_FREQ, BuzzerFrequency(self.buzzer))
        subscribe(table.UI_SET_BUZZER_AMPL, TuneStart(self.buzzer))
        subscribe(table.UI_EMPTY_TX2, TuneStart(self.buzzer))
        if self.quirks.buzzer_beeps:
            subscribe(table.ERROR_LCD, ErrorSound(self.buzzer))

    def schedule(self) -> Schedule:
        """Source: robot.md N3.6.

        Costs: no instructions of this board were counted. Functions and lines that the motor boards have too cost what
        was counted there (robot.md T2), keys and lights as much as similar functions (a test of a bit 21 instructions,
        three timers 31). The logs' slot of 155 to 178 us (T1) is then 65 us and the six lights that the main brain of
        2016 sends in every slot. A limit is a third above the most that a call can take: twelve lights for the frames,
        a ring full of bytes for the sensor.

        UI_ROLL, UI_PITCH and UI_YAW are 0 while the IMU sends rates alone. If the IMU falls silent, the last values are
        sent on.
        """
        board: object = self  # a compiled class would hand out wrappers of its parts' methods
        imu: object = self.imu
        rc: object = self.rc
        return Schedule(
            slot_us=table.SLOT_US,
            tick_cost=TICK_CYCLES,
            tick_slot=TIMER_SLOT,
            every=(
                #    function                   cost (cycles)  limit
                Task(board.can.receive_all,     cost=2 * 15,   limit=14000, per_item=2 * 115, item="frame"),
                Task(board.heartbeat.beat,      cost=2 * 21,   limit=90),
                Task(board.heartbeat.update,    cost=2 * 31,   limit=130),
                Task(self.update_imu,           cost=IMU_CYCLES, limit=12000, per_item=IMU_BYTE_CYCLES, item="byte"),
                Task(self.update_errors,        cost=2 * 39,   limit=5500, per_item=2 * 213, item="error"),
                Task(board.can.feed,            cost=2 * 5,    limit=600, per_item=2 * 35, item="frame"),
                Task(self.watch_sync_key,       cost=2 * 21,   limit=90),
                Task(self.update_sync_light,    cost=2 * 31,   limit=900,
                     per_item=CYCLES_PER_WRITE, item="transfer"),
                Task(self.update_buzzer,        cost=2 * 31,   limit=200),
            ),
            **laid_out(table, self.can, (
                #    variable                 value                              cost limit
                Send("UI_ROLL",               lambda: imu.roll,                   2 * 160, 2 * 240),
                Send("UI_ANG_RATE_X",         lambda: imu.rate_x,                 2 * 160, 2 * 240),
                # the occasional list, as far as not above; RC channel 2's pin drives the sync light, so it is 0
                Send("ERROR_UI",              board.errors,                       2 * 8,   2 * 300, 2 * 196),
                Send("UI_BUTTONS",            board.keypad.buttons,               2 * 174, 2 * 240),
                Send("UI_RC_0",               lambda: rc.width(0),                2 * 261, 2 * 400),
                Send("UI_RC_1",               lambda: rc.width(1),                2 * 261, 2 * 400),
                Send("UI_STATUS",             1.0,                                2 * 156, 2 * 210),
                Send("UI_EXECUTION_TIME",     board.execution.seconds,            2 * 276, 2 * 370),
                Send("UI_MAX_EXECUTION_TIME", board.execution.longest_seconds,    2 * 276, 2 * 370),
                Send("UI_PITCH",              lambda: imu.pitch,                  2 * 160, 2 * 240),
                Send("UI_YAW",                lambda: imu.yaw,                    2 * 160, 2 * 240),
                Send("UI_ANG_RATE_Y",         lambda: imu.rate_y,                 2 * 160, 2 * 240),
                Send("UI_ANG_RATE_Z",         lambda: imu.rate_z,                 2 * 160, 2 * 240),
                Send("UI_RC_2",               lambda: rc.width(2),                2 * 261, 2 * 400),
                Send("UI_RC_3",               lambda: rc.width(3),                2 * 261, 2 * 400),
            )),
            extra_idle_call=self.quirks.occasional_idle_call,
            transmitters=("feed", "can_transmit"),
            last=(
                Task(board.can.transmit,        cost=TRANSMIT_CYCLES, limit=100, name="can_transmit"),
                Task(board.execution.record,    cost=2 * 22,   limit=60, name="record_execution_time"),
            ),
        )  # fmt: skip

    # --- interrupts -------------------------------------------------------------------------------------

    def on_uart(self, queue) -> object:
        """UART1: empty the FIFO into the parser's ring; returns the bytes."""
        return self.imu.receive(self.uart1)

    def on_rc_edge(self, queue) -> None:
        """Timer0: every capture that is flagged."""
        flags: cython.longlong = self.timer0.IR
        channel: cython.longlong
        for channel in range(4):
            if flags & (16 << channel):
                self.rc.capture(channel, self.gpio.level(self.timer0.pins[channel]), self.timer0.CR(channel))
        self.timer0.clear(flags & 240)

    def lcd_tick(self) -> None:
        """The display's share of the slot timer's interrupt."""
        if self.lcd.tick():
            self.extra_cycles += LCD_BYTE_CYCLES
        else:
            self.extra_cycles += LCD_IDLE_CYCLES

    # --- tasks of every slot ----------------------------------------------------------------------------

    def update_imu(self) -> object:
        """Ask for packets once, then take at most one per slot; returns the bytes looked at."""
        byte: cython.longlong
        if self.slots <= self.imu_start_slots:
            if self.slots == self.imu_start_slots:
                for byte in self.imu_command:
                    self.uart1.THR(byte)
            self.slots += 1
        return self.imu.update()

    def update_errors(self) -> object:
        """Collect the slot's errors, each with its sound; returns how many codes there were."""
        i: cython.longlong
        for i in range(self.errors.flagged_count):
            self.buzzer.error_sound(self.errors.flagged[i])
        return self.errors.update()

    def watch_sync_key(self) -> None:
        """Key 4 toggles the sync light."""
        self.sync_light.watch_key()

    def update_sync_light(self) -> object:
        """One millisecond of its pattern; returns the light transfers it took."""
        return self.sync_light.update()

    def update_buzzer(self) -> None:
        """One millisecond of beeps and tune."""
        self.buzzer.update()
