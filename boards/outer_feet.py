"""Outer feet motor board (MCFO): B2A, 0.5 ms slots, 9 rows.

Source: robot.md N3.3 (schedule, laid out below line by line), N4.1, N4.2, N4.5, N4.7-N4.9, N5.
Ankle angle: 0 with the foot flipped up, growing as the foot is pushed down.
"""

import cython

from ranger_sim.boards.ankle_board import FOOT_OFF_LEVEL, AnkleBoard
from ranger_sim.boards.firmware_board import TICK_CYCLES
from ranger_sim.boards.modules.can_link import TRANSMIT_CYCLES
from ranger_sim.boards.modules.publishing import Send, laid_out
from ranger_sim.boards.motor_board import NOT_CONVERTED
from ranger_sim.datatable.generated import mcfo as table
from ranger_sim.firmware_sim.scheduler import Schedule, Task, Wait

READINGS = dict(
    motor_gain=-0.00152,
    motor_offset=0,
    battery_gain=0.000502,
    battery_offset=-9,
    voltage_gain=0.0327,
)
MOTOR_ENCODER = (512, -34.0)  # pulses, gear; the sign is the mounting
JOINT_ENCODER = (2048, -1.0)
ABSOLUTE_ENCODER = dict(zero=6562, sign=-1, rpm=186)
REZERO_SHARE = 0.2
OPERATION_SIGN = -1  # the motor is mounted the other way round


@cython.cclass
class OuterFeetBoard(AnkleBoard):
    """Outer ankle motor, two foot sensors, two limit switches."""

    def __init__(self, crystal=None, quirks=None, phase_ns=0) -> None:
        AnkleBoard.__init__(
            self,
            table,
            crystal,
            quirks,
            phase_ns,
            readings=READINGS,
            sign=OPERATION_SIGN,
            motor_encoder=MOTOR_ENCODER,
            joint_encoder=JOINT_ENCODER,
            absolute_encoder=ABSOLUTE_ENCODER,
            rezero_share=REZERO_SHARE,
            right_off_level=FOOT_OFF_LEVEL,
        )
        self.start_slots(phase_ns)

    def schedule(self) -> Schedule:
        """One pass takes 4.5 ms; each row's variable goes out at 222.2 Hz, the occasional ones at 14.81 Hz."""
        board: object = self
        return Schedule(
            slot_us=table.SLOT_US,
            tick_cost=TICK_CYCLES,
            every=(
                #    function                            cost limit per item          name
                Task(board.start_external_adc,             2 * 37,   110,       0, "",      "adcx_convert_all"),
                Task(board.start_internal_adc,             2 * 31,    90,       0, "",      "adci_convert_all"),
                Task(board.motor.update_angle,             2 * 23,    70,       0, "",      "qdc_cap01_angle"),
                Task(board.motor.update_rate,             2 * 617,  6000,  2 * 24, "edge",  "qdc_cap01_rate"),
                Task(board.joint.update_angle,             2 * 23,    70,       0, "",      "qdc_cap23_angle"),
                Task(board.joint.update_rate,             2 * 617,  6000,  2 * 24, "edge",  "qdc_cap23_rate"),
                Task(board.start_absolute_encoder,         2 * 26,    80,       0, "",      "ae_update"),
                Task(board.can.receive_all,                2 * 15,  7500, 2 * 115, "frame", "can_rx_dispatch_all"),
                Task(board.heartbeat.beat,                 2 * 21,    90,       0, "",      "hb_beat"),
                Task(board.heartbeat.update,               2 * 31,   130,       0, "",      "mcu_led_update"),
                Task(board.update_switches,               2 * 140,   390,       0, "",      "ls_update"),
                Task(board.safety.check,                  2 * 413,  1300,       0, "",      "dn_safety"),
                Task(board.errors.update,                  2 * 39,  5500, 2 * 213, "error", "error_update"),
                Task(board.can.feed,                        2 * 5,   600,  2 * 35, "frame", "can_tx1"),
                Wait(board.adc_external.sequence_done,      2 * 6, 10500,                   "adcx_conversion_wait"),
                Task(board.compliant_control,             2 * 613,  2100,       0, "",      "mc_compliant_control"),
            ),
            **laid_out(table, self.can, (
                #    variable                    value                              cost      limit      more
                Send("MCFO_RIGHT_ANKLE_ANGLE",   board.encoder.angle_rad,            2 * 172, 2 * 420, 2 * 140),
                Send("MCFO_RIGHT_ANKLE_RATE",    board.joint.rate_rad_s,             2 * 165, 2 * 350, 2 * 96),
                Send("MCFO_RIGHT_HEEL_SENSE",    board.right_heel_sense,             2 * 174, 2 * 350, 2 * 87),
                Send("MCFO_RIGHT_HS",            board.right_foot.contact,           2 * 176, 2 * 440, 2 * 154),
                Send("MCFO_LEFT_HS",             board.left_foot.contact,            2 * 176, 2 * 440, 2 * 154),
                Send("MCFO_MOTOR_POSITION",      board.motor.position_rad,           2 * 165, 2 * 320, 2 * 70),
                Send("MCFO_LEFT_HEEL_SENSE",     board.left_heel_sense,              2 * 174, 2 * 350, 2 * 87),
                Send("MCFO_BATT_POWER",          board.readings.battery_power,       2 * 265, 2 * 360),
                # the occasional list, as far as not above
                Send("ERROR_MCFO",              board.errors,                       2 * 8,   2 * 300, 2 * 196),
                Send("MCFO_MOTOR_VELOCITY",      board.motor.rate_rad_s,             2 * 155, 2 * 320, 2 * 70),
                Send("MCFO_MOTOR_CURRENT",       board.readings.motor_current,       2 * 322, 2 * 440),
                Send("MCFO_STATUS",              1.0,                                2 * 156, 2 * 210),
                Send("MCFO_BATT_CURRENT",        board.readings.battery_current,     2 * 322, 2 * 440),
                Send("MCFO_BATT_VOLTAGE",        board.readings.battery_voltage,     2 * 310, 2 * 420),
                Send("MCFO_HBRIDGE_TEMP",        NOT_CONVERTED,                      2 * 174, 2 * 240),
                Send("MCFO_RIGHT_LS",            board.right_switch.contact,         2 * 170, 2 * 230, 2 * 154),
                Send("MCFO_LEFT_LS",             board.left_switch.contact,          2 * 170, 2 * 230, 2 * 154),
                Task(board.motor_encoder_rezero,                                     2 * 161, 2 * 4800),
                Send("MCFO_EXECUTION_TIME",      board.execution.seconds,            2 * 276, 2 * 370),
                Send("MCFO_MAX_EXECUTION_TIME",  board.execution.longest_seconds,    2 * 276, 2 * 370),
            )),
            extra_idle_call=self.quirks.occasional_idle_call,
            transmitters=("can_tx1", "can_transmit"),
            last=(
                Task(board.end_line,             TRANSMIT_CYCLES, 100, 0, "", "can_transmit"),
                Task(board.execution.record,         2 * 22,           60, 0, "", "execution_time_record"),
            ),
        )  # fmt: skip
