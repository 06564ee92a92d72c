"""The user interface board (UI, B8A): IMU, keys, radio control, display, colour lights, buzzer.

Source: robot.md N3.6, N4.10-N4.12, N4.16; appendix 3.7, 3.8. What a person sees and hears is public state:
`board.lcd.text()`, `board.leds.colour(i)`, `board.buzzer.hertz`, `board.sync_light.lit`.
"""

import cython

from ranger_sim.boards.modules.buzzer import Buzzer, BuzzerFrequency, ErrorSound, TuneStart
from ranger_sim.boards.modules.can_link import CanLink
from ranger_sim.boards.modules.colour_leds import CYCLES_PER_WRITE, ColourLeds, LedReceiver
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.execution_timer import ExecutionTimer
from ranger_sim.boards.modules.imu_parser import (
    HEADER_ANGLES_AND_RATES,
    HEADER_RATES_ONLY,
    ImuParser,
    start_command,
)
from ranger_sim.boards.modules.keypad import KEY_PINS, Keypad
from ranger_sim.boards.modules.lcd import Lcd, LcdQuarter
from ranger_sim.boards.modules.mcu_led import PINS as LED_PINS
from ranger_sim.boards.modules.mcu_led import Heartbeat
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.rc_receiver import RcReceiver
from ranger_sim.boards.modules.sync_light import SYNC_PIN, SyncLight
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import ui as table
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import ICR_BEI, ICR_DOI, ICR_EI, ICR_EPI, ICR_RI, CanController
from ranger_sim.firmware_sim.peripherals.gpio import Gpio, p0
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import TIMER_MATCH
from ranger_sim.foundation.events import UART_BYTE

# Processor pins by what hangs on them (robot.md N4.11); for the wiring table.
RC_PINS = (p0(22), p0(27), p0(16), p0(29))  # the third is driven by the sync light and hears no radio
PINS = {
    **{f"led_{colour}": pin for colour, pin in LED_PINS.items()},
    **{f"key_{key}": pin for key, pin in enumerate(KEY_PINS)},
    **{f"radio_{channel}": RC_PINS[channel] for channel in (0, 1, 3)},
    "sync_light": SYNC_PIN,
}
IMU_UART = 1

# VIC slots (robot.md N4.16)
CAN_RECEIVE_SLOT = 0
TIMER_SLOT = 1
RC_SLOT = 2
UART_SLOT = 3
CAN_ERROR_SLOT = 9

# ROBOT PARITY: the robot counts a float up to 20e6 before its first slot and only then asks the IMU for
# packets; here the board's slots begin at power-up and the request goes out after 20 of them (chosen by us,
# because that delay only waits for the IMU to wake, and every run would begin with it).
IMU_START_SLOTS = 20
RC_CYCLES = 130  # four flags tested, one width filtered: chosen by us, no measurement is known
UART_CYCLES = 90  # read of U1IIR and the loop: chosen by us, as above
UART_BYTE_CYCLES = 25  # U1LSR, U1RBR, store: chosen by us, as above
LCD_IDLE_CYCLES = 25  # chosen by us, as above
LCD_BYTE_CYCLES = 110  # eight data pins, three control pins, each a read-modify-write: chosen by us, as above


class UserInterfaceBoard(Microcontroller):
    """Slots of 1 ms, 3 rows. `phase_ns`: when it gets power, and its first slot begins."""

    def __init__(self, crystal, quirks, phase_ns=0) -> None:
        Microcontroller.__init__(self, table.BOARD, table.CLOCK_HZ, crystal)
        self.quirks = quirks
        self.time = NetworkTime()
        self.errors = ErrorModule(
            table.BOARD_NUMBER,
            self.time,
            per_event=quirks.errors_counted_per_event,
            lose_new_after_repeat=quirks.new_errors_lost_after_repeat,
        )
        self.gpio = Gpio(self)
        self.mcu_leds = self.heartbeat = Heartbeat(self.time, self.gpio, table.SLOT_US)
        self.execution = ExecutionTimer(self, self.time)
        # network
        interrupts = ICR_RI | ICR_EI | ICR_DOI | ICR_EPI | ICR_BEI
        self.can2 = CanController(self, table.CONTROLLER, IER=interrupts)
        self.can = CanLink(self, self.can2, self.time, self.errors, codes, quirks.full_queues_reported)
        self.can.attach(receive_slot=CAN_RECEIVE_SLOT, error_slot=CAN_ERROR_SLOT)
        # inertial sensor: 460 526 baud (robot.md N4.10)
        rates_only = quirks.imu_packets == "rates"
        header = HEADER_RATES_ONLY if rates_only else HEADER_ANGLES_AND_RATES
        self.uart1 = Uart(self, IMU_UART, divisor=6, divaddval=5, mulval=14, trigger=8)
        self.imu = ImuParser(self.report, header, not rates_only)
        self.imu_command = start_command(header)
        self.imu_start_slots = IMU_START_SLOTS
        self.slots = 0
        self.vic.attach(UART_BYTE, IMU_UART, self.on_uart, UART_CYCLES, UART_BYTE_CYCLES, slot=UART_SLOT, name="uart1")
        # radio control: one interrupt of the timer for its four captures
        self.timer0 = TimerCapture(self, 0, period=600_000, phase_ns=phase_ns)
        self.rc = RcReceiver(self.report)
        captures = self.vic.source(TIMER_MATCH, 0)
        for channel in (0, 1, 3):
            self.timer0.use_channel(channel, RC_PINS[channel], source=captures)
        self.vic.attach(TIMER_MATCH, 0, self.on_rc_edge, RC_CYCLES, slot=RC_SLOT, name="timer0 capture")
        # what a person touches, sees and hears
        self.keypad = Keypad(self.gpio, self.report)
        self.lcd = Lcd(self.report)
        self.leds = ColourLeds()
        self.buzzer = Buzzer(quirks.buzzer_beeps, quirks.song_repeats_for_ever)
        self.sync_light = SyncLight(self.gpio, self.keypad, self.leds)
        self.listen()
        self.on_timer_tick = self.lcd_tick
        self.on_overrun = self.note_overrun
        if quirks.warn_near_slot_limit:
            self.on_limit = self.note_limit
            self.on_near_limit = self.note_near_limit
        self.start(self.schedule(), phase_ns)

    def listen(self) -> None:
        """Receive list (robot.md N2.4)."""
        listen = self.can.listen
        listen(table.TIMESTAMP, self.time)
        for quarter in range(4):
            listen(getattr(table, f"UI_SET_LCD_QUAD_{quarter + 1}"), LcdQuarter(self.lcd, quarter))
        for led in range(6):
            listen(getattr(table, f"UI_SET_LED_{led + 1}"), LedReceiver(self.leds, led, self))
        listen(table.UI_SET_BUZZER_FREQ, BuzzerFrequency(self.buzzer))
        listen(table.UI_SET_BUZZER_AMPL, TuneStart(self.buzzer))
        listen(table.UI_EMPTY_TX2, TuneStart(self.buzzer))
        if self.quirks.buzzer_beeps:
            listen(table.ERROR_LCD, ErrorSound(self.buzzer))

    def schedule(self) -> Schedule:
        """Source: robot.md N3.6. Costs and limits are chosen by us; robot.md T1 has the board's measured slots."""
        # untyped names: the compiler cannot hand out a bound method of another module's compiled class
        can: object = self.can
        heartbeat: object = self.heartbeat
        mcu_leds: object = self.mcu_leds
        execution: object = self.execution
        return Schedule(
            slot_us=table.SLOT_US,
            tick_slot=TIMER_SLOT,
            every=(
                #    function                   cost (cycles)  limit
                Task(can.receive_all,           cost=80,       limit=9000, per_item=90, item="frame"),
                Task(heartbeat.beat,            cost=40,       limit=150),
                Task(mcu_leds.update,           cost=50,       limit=150),
                Task(self.update_imu,           cost=60,       limit=2800, per_item=16, item="byte"),
                Task(self.update_errors,        cost=60,       limit=4000, per_item=150, item="error"),
                Task(can.feed,                  cost=50,       limit=1000, per_item=110, item="frame"),
                Task(self.watch_sync_key,       cost=30,       limit=100),
                Task(self.update_sync_light,    cost=40,       limit=900,
                     per_item=CYCLES_PER_WRITE, item="transfer"),
                Task(self.update_buzzer,        cost=60,       limit=200),
            ),
            rows=(
                (Task(self.send_roll,           cost=260,      limit=500),),
                (Task(self.send_rate_x,         cost=260,      limit=500),),
                (),
            ),
            occasional_row=2,
            occasional=(
                Task(self.send_error,           cost=150,      limit=500),
                Task(self.send_buttons,         cost=280,      limit=500),
                Task(self.send_rc_0,            cost=260,      limit=500),
                Task(self.send_rc_1,            cost=260,      limit=500),
                Task(self.send_status,          cost=230,      limit=500),
                Task(self.send_execution_time,  cost=300,      limit=500),
                Task(self.send_max_execution_time, cost=300,   limit=500),
                Task(self.send_pitch,           cost=260,      limit=500),
                Task(self.send_roll,            cost=260,      limit=500, name="send_roll_again"),
                Task(self.send_yaw,             cost=260,      limit=500),
                Task(self.send_rate_y,          cost=260,      limit=500),
                Task(self.send_rate_z,          cost=260,      limit=500),
                Task(self.send_rc_2,            cost=260,      limit=500),
                Task(self.send_rc_3,            cost=260,      limit=500),
            ),
            extra_idle_call=self.quirks.occasional_idle_call,
            speakers=("feed",),
            last=(Task(execution.record,       cost=40,       limit=80, name="record_execution_time"),),
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

    # --- errors -----------------------------------------------------------------------------------------

    def report(self, code: cython.longlong) -> None:
        """Note an error of a module."""
        self.errors.report(code)

    def note_overrun(self) -> None:
        """A tick found the row unfinished."""
        self.errors.report(codes.ASCHED_DNF)

    def note_limit(self, task: Task) -> None:
        """A task took longer than its limit."""
        self.errors.report(codes.SCHED_TASK_LIMIT)

    def note_near_limit(self) -> None:
        """A slot took more than 90 % of its length."""
        self.errors.report(codes.SCHED_SLOT_NEAR_LIMIT)

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

    # --- what is published ------------------------------------------------------------------------------

    def send_roll(self) -> None:
        """UI_ROLL, rad; 0 while the IMU sends rates alone. Old values are sent on if the IMU falls silent."""
        self.can.send_float(table.UI_ROLL, self.imu.roll)

    def send_pitch(self) -> None:
        """UI_PITCH, rad."""
        self.can.send_float(table.UI_PITCH, self.imu.pitch)

    def send_yaw(self) -> None:
        """UI_YAW, rad."""
        self.can.send_float(table.UI_YAW, self.imu.yaw)

    def send_rate_x(self) -> None:
        """UI_ANG_RATE_X, rad/s."""
        self.can.send_float(table.UI_ANG_RATE_X, self.imu.rate_x)

    def send_rate_y(self) -> None:
        """UI_ANG_RATE_Y, rad/s."""
        self.can.send_float(table.UI_ANG_RATE_Y, self.imu.rate_y)

    def send_rate_z(self) -> None:
        """UI_ANG_RATE_Z, rad/s."""
        self.can.send_float(table.UI_ANG_RATE_Z, self.imu.rate_z)

    def send_error(self) -> None:
        """ERROR_UI, the error that waits longest, if one does."""
        self.can.send_error(table.ERROR_VARIABLE)

    def send_buttons(self) -> None:
        """UI_BUTTONS, bit mask of the keys that are down."""
        self.can.send_int(table.UI_BUTTONS, self.keypad.buttons())

    def send_rc_0(self) -> None:
        """UI_RC_0, pulse width in 1/60 us."""
        self.can.send_float(table.UI_RC_0, self.rc.width(0))

    def send_rc_1(self) -> None:
        """UI_RC_1."""
        self.can.send_float(table.UI_RC_1, self.rc.width(1))

    def send_rc_2(self) -> None:
        """UI_RC_2; its pin drives the sync light, so 0."""
        self.can.send_float(table.UI_RC_2, self.rc.width(2))

    def send_rc_3(self) -> None:
        """UI_RC_3."""
        self.can.send_float(table.UI_RC_3, self.rc.width(3))

    def send_status(self) -> None:
        """UI_STATUS, always 1."""
        self.can.send_float(table.UI_STATUS, 1.0)

    def send_execution_time(self) -> None:
        """UI_EXECUTION_TIME, s."""
        self.can.send_float(table.UI_EXECUTION_TIME, self.execution.seconds())

    def send_max_execution_time(self) -> None:
        """UI_MAX_EXECUTION_TIME, s."""
        self.can.send_float(table.UI_MAX_EXECUTION_TIME, self.execution.longest_seconds())
