"""Outer feet motor board (MCFO): B2A, 0.5 ms slots, 9 rows.

Source: robot.md N3.3 (schedule, laid out below line by line), N4.1, N4.2, N4.5, N4.7-N4.9, N5.
Ankle angle: 0 with the foot flipped up, growing as the foot is pushed down.
"""

from ranger_sim.boards.ankle_board import FOOT_OFF_LEVEL, AnkleBoard
from ranger_sim.boards.motor_board import ANALOG, PINS, WORDS
from ranger_sim.datatable.generated import mcfo as table
from ranger_sim.firmware_sim.scheduler import Schedule, Task, Wait

__all__ = ["ANALOG", "PINS", "WORDS", "OuterFeetBoard"]

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
REZERO_SHARE = 13107  # 20 %, 0.2 x 65536 truncated
OPERATION_SIGN = -1  # the motor is mounted the other way round


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
        self.id_ankle_angle = table.MCFO_RIGHT_ANKLE_ANGLE
        self.id_ankle_rate = table.MCFO_RIGHT_ANKLE_RATE
        self.begin(phase_ns)

    def schedule(self) -> Schedule:
        """One pass takes 4.5 ms; each row's variable goes out at 222.2 Hz, the occasional ones at 14.81 Hz."""
        board: object = self
        rate = Task(board.send_ankle_rate, 380, 510, 0, "", "MCFO_RIGHT_ANKLE_RATE")
        right_heel = Task(board.send_right_heel_sense, 330, 440, 0, "", "MCFO_RIGHT_HEEL_SENSE")
        return Schedule(
            slot_us=table.SLOT_US,
            every=(
                #    function                         cost limit  per item      name
                Task(board.start_external_adc,         200,  300,   0, "",      "adcx_convert_all"),
                Task(board.start_internal_adc,          60,  100,   0, "",      "adci_convert_all"),
                Task(board.motor.update_angle,         120,  160,   0, "",      "qdc_cap01_angle"),
                Task(board.motor.update_rate,          850, 3600,  30, "edge",  "qdc_cap01_rate"),
                Task(board.joint.update_angle,         120,  160,   0, "",      "qdc_cap23_angle"),
                Task(board.joint.update_rate,          850, 3600,  30, "edge",  "qdc_cap23_rate"),
                Task(board.start_absolute_encoder,      80,  110,   0, "",      "ae_update"),
                Task(board.can.receive_all,            120, 4000, 220, "frame", "can_rx_dispatch_all"),
                Task(board.heartbeat.beat,              40,   60,   0, "",      "hb_beat"),
                Task(board.leds.update,                 60,   80,   0, "",      "mcu_led_update"),
                Task(board.update_switches,            180,  240,   0, "",      "ls_update"),
                Task(board.safety.check,               140,  190,   0, "",      "dn_safety"),
                Task(board.errors.update,               90, 2700, 120, "error", "error_update"),
                Task(board.can.feed,                    50,  300,  80, "frame", "can_tx1"),
                Wait(board.adc_external.sequence_done,  20, 6500,              "adcx_conversion_wait"),
                Task(board.compliant_control,         3900, 5200,   0, "",      "mc_compliant_control"),
            ),
            rows=(
                (Task(board.send_ankle_angle,          420,  560,   0, "",      "MCFO_RIGHT_ANKLE_ANGLE"),),
                (rate,),
                (right_heel,),
                (Task(board.send_right_contact,        300,  400,   0, "",      "MCFO_RIGHT_HS"),),
                (Task(board.send_left_contact,         300,  400,   0, "",      "MCFO_LEFT_HS"),),
                (Task(board.send_motor_position,       380,  510,   0, "",      "MCFO_MOTOR_POSITION"),),
                (Task(board.send_left_heel_sense,      330,  440,   0, "",      "MCFO_LEFT_HEEL_SENSE"),),
                (Task(board.send_battery_power,        900, 1200,   0, "",      "MCFO_BATT_POWER"),),
                (),  # the occasional list
            ),
            occasional_row=8,
            occasional=(
                Task(board.send_error,                 200,  270,   0, "",      "ERROR_MCFO"),
                Task(board.send_motor_velocity,        380,  510,   0, "",      "MCFO_MOTOR_VELOCITY"),
                Task(board.send_motor_current,         480,  640,   0, "",      "MCFO_MOTOR_CURRENT"),
                Task(board.send_status,                260,  350,   0, "",      "MCFO_STATUS"),
                Task(board.send_battery_current,       480,  640,   0, "",      "MCFO_BATT_CURRENT"),
                Task(board.send_battery_voltage,       420,  560,   0, "",      "MCFO_BATT_VOLTAGE"),
                Task(board.send_bridge_temperature,    260,  350,   0, "",      "MCFO_HBRIDGE_TEMP"),
                Task(board.send_right_switch,          300,  400,   0, "",      "MCFO_RIGHT_LS"),
                Task(board.send_left_switch,           300,  400,   0, "",      "MCFO_LEFT_LS"),
                Task(board.rezero,                     700,  940,   0, "",      "motor_encoder_rezero"),
                Task(board.send_execution_time,        420,  560,   0, "",      "MCFO_EXECUTION_TIME"),
                Task(board.send_max_execution_time,    420,  560,   0, "",      "MCFO_MAX_EXECUTION_TIME"),
                rate,
                right_heel,
            ),
            extra_idle_call=self.quirks.occasional_idle_call,
            speakers=("can_tx1",),
            last=(
                Task(board.execution.record,            60,   80,   0, "",      "execution_time_record"),
            ),
        )  # fmt: skip
