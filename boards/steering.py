# cython: boundscheck=False, wraparound=False
# (results are those of SEQUENCE)
"""Steering motor board (MCSI): B2A, 0.5 ms slots, 4 rows, no incremental encoders.

Source: robot.md N3.5 (schedule, laid out below line by line), N4.2, N4.5, N5, N6.1, C1.6.
The controller of May 2011 commands the duty itself, in counts of 600 (at most 75); see `steering_output` in
quirks.py for what the firmware of 2016 made of it.
"""

import cython

from ranger_sim.boards.firmware_board import TICK_CYCLES
from ranger_sim.boards.modules.can_link import TRANSMIT_CYCLES
from ranger_sim.boards.modules.publishing import Send, laid_out
from ranger_sim.boards.motor_board import CONVERSION_NS, MotorBoard
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import mcsi as table
from ranger_sim.firmware_sim.scheduler import Schedule, Task, Wait

# (place, multiplexer code, gain code): single-ended 0 times 2, 4-5 times 2, 2-3 times 20
SEQUENCE = (("steering_sensor", 8, 1), ("motor_current", 2, 1), ("battery_current", 1, 7))
READINGS = dict(
    motor_gain=0.0001535,
    motor_offset=25,
    battery_gain=0.0000505,
    battery_offset=-75,
    voltage_gain=0.0327,
)
LIMITS = dict(
    target_min=-0.25,
    target_max=0.25,
    current_min=-0.3,
    current_max=0.3,
    thermal_current=0.3,
    thermal_time=10.1,
    excess_limit=10,
)
CENTRE_COUNTS: cython.longlong = 4803
LIMIT_COUNTS: cython.longlong = 200
# mc_compliant_control was counted at 465 instructions, all values 0; with others it takes up to 764 on the other boards
# (robot.md T2). With 765 the slot is as long as the logs' 142-145 us (T1).
CONTROL_CYCLES = 2 * 765
SENSOR: cython.longlong = 0


@cython.ccall
@cython.exceptval(check=False)
def whole(value: cython.longlong) -> cython.longlong:
    """The whole part of a 16.16 number, towards zero."""
    return value >> 16 if value >= 0 else -(-value >> 16)


@cython.cclass
class SteeringBoard(MotorBoard):
    """`zero`: sensor counts at power-up, subtracted from what is published and controlled."""

    zero: cython.longlong
    direct: cython.bint
    closed_loop: cython.bint
    check_limits: cython.bint

    def __init__(self, crystal=None, quirks=None, phase_ns=0) -> None:
        MotorBoard.__init__(
            self,
            table,
            crystal,
            quirks,
            phase_ns,
            sequence=SEQUENCE,
            readings=READINGS,
            limits=LIMITS,
            sign=1,
            largest_duty=200,
            gear=0,
            conversion_ns=CONVERSION_NS,
        )
        self.zero = 0
        self.direct = self.quirks.steering_output in ("duty", "duty_then_current")
        self.closed_loop = self.quirks.steering_output in ("current", "duty_then_current")
        self.check_limits = self.quirks.steering_limit_check
        self.start_slots(phase_ns)

    def schedule(self) -> Schedule:
        """One pass takes 2 ms; each row's variable goes out at 500 Hz, the occasional ones at 100 Hz.

        Functions not counted here cost the same as similar ones on MCFI; the lines of a row cost the most that one was
        counted to (robot.md T2: 154 to 284).
        """
        board: object = self
        return Schedule(
            slot_us=table.SLOT_US,
            tick_cost=TICK_CYCLES,
            every=(
                #    function                            cost limit per item          name
                Task(board.start_external_adc,             2 * 37,   110,       0, "",      "adcx_convert_all"),
                Task(board.start_internal_adc,             2 * 31,    90,       0, "",      "adci_convert_all"),
                Task(board.can.receive_all,                2 * 15,  7500, 2 * 115, "frame", "can_rx_dispatch_all"),
                Task(board.heartbeat.beat,                 2 * 21,    90,       0, "",      "hb_beat"),
                Task(board.heartbeat.update,               2 * 31,   130,       0, "",      "mcu_led_update"),
                Task(board.errors.update,                  2 * 39,  5500, 2 * 213, "error", "error_update"),
                Task(board.can.feed,                        2 * 5,   600,  2 * 35, "frame", "can_tx2"),
                Wait(board.adc_external.sequence_done,      2 * 6,  8500,                   "adcx_conversion_wait"),
                Task(board.update_pwm,                     2 * 88,   240,       0, "",      "dn_update_pwm"),
                Task(board.steering_control,         CONTROL_CYCLES,  2100,       0, "",      "mc_compliant_control"),
            ),
            **laid_out(table, self.can, (
                #    variable                    value                                 cost      limit      more
                Send("MCSI_STEER_ANGLE",         board.steer_angle_counts,           2 * 280, 2 * 380),
                Send("MCSI_MOTOR_CURRENT",       board.readings.motor_current,       2 * 284, 2 * 380),
                Send("MCSI_BATT_POWER",          board.readings.battery_power_fixed, 2 * 284, 2 * 380),
                # the occasional list, as far as not above
                Send("ERROR_MCSI",              board.errors,                       2 * 8,   2 * 300, 2 * 196),
                Send("MCSI_STATUS",              1.0,                                2 * 156, 2 * 210),
                Send("MCSI_EXECUTION_TIME",      board.execution.seconds,            2 * 276, 2 * 370),
                Send("MCSI_MAX_EXECUTION_TIME",  board.execution.longest_seconds,    2 * 276, 2 * 370),
            )),
            extra_idle_call=self.quirks.occasional_idle_call,
            transmitters=("can_tx2", "can_transmit"),
            last=(
                Task(board.end_line,             TRANSMIT_CYCLES, 100, 0, "", "can_transmit"),
                Task(board.execution.record,         2 * 22,           60, 0, "", "execution_time_record"),
            ),
        )  # fmt: skip

    @cython.ccall
    def read_sensors_once(self) -> None:
        """Before the first slot: one sequence of the converter."""
        self.output.enable_low_side(1)
        self.start_external_adc()

    @cython.ccall
    def set_start_values(self) -> None:
        """The present steering angle is the zero."""
        self.zero = self.adc_external.results[SENSOR]

    @cython.ccall
    @cython.exceptval(check=False)
    def controlled_position(self) -> cython.longlong:
        """Steering angle in counts x 65536, the only unit on this board."""
        return (self.adc_external.results[SENSOR] - self.zero) << 16

    @cython.ccall
    @cython.exceptval(check=False)
    def controlled_velocity(self) -> cython.longlong:
        """No velocity is measured."""
        return 0

    def update_pwm(self) -> None:
        """dn_update_pwm: COMMAND_CURRENT, whole counts, straight to the duty, past every limiter but the largest duty.

        The monitors of the current loop can still switch the motor off. A blocked direction, which the robot never has,
        is blocked here too.
        """
        duty: cython.longlong
        if self.check_limits:
            self.check()
        if not self.direct:
            return
        duty = whole(self.compliance.command)
        if not -self.output.largest <= duty <= self.output.largest:
            self.errors.report(codes.MC_PWM_LIMIT)
        if (duty > 0 and self.current_control.block_positive) or (duty < 0 and self.current_control.block_negative):
            duty = 0
        self.output.write(duty)

    def steering_control(self) -> None:
        """mc_compliant_control: the loops if they are wanted, otherwise only watchdog and monitors.

        Either way a motor that may not run is an error in every slot (robot.md N4.3), so a board that the main
        brain has shut down reports MC_NOT_RUNNING 2000 times a second, as on the robot.
        """
        if self.closed_loop:
            self.compliant_control()
        elif self.current_control.supervise(self.readings.motor_current_fixed()) and self.output.off:
            self.errors.report(self.current_control.code_stopped)

    @cython.ccall
    def check(self) -> None:
        """The limit check of the firmware, which never calls it: +/-200 counts about 4803.

        Positive duty turns towards higher counts (chosen by us: no record shows it).
        """
        counts: cython.longlong = self.adc_external.results[SENSOR] - CENTRE_COUNTS
        high: cython.bint = counts > LIMIT_COUNTS
        low: cython.bint = counts < -LIMIT_COUNTS
        if high:
            self.errors.report(codes.MCSI_RIGHT)
        elif low:
            self.errors.report(codes.MCSI_LEFT)
        self.current_control.block_positive = high
        self.current_control.block_negative = low

    @cython.ccall
    @cython.exceptval(check=False)
    def steer_angle_counts(self) -> cython.longlong:
        """MCSI_STEER_ANGLE: counts from the zero."""
        return self.adc_external.results[SENSOR] - self.zero
