"""Hip motor board (MCH): B2A, 0.5 ms slots, 4 rows.

Source: robot.md N3.2 (schedule, laid out below line by line), N4.1, N4.2, N4.5, N4.7, N4.8, N5.
Positive hip angle: inner legs swung forward.
"""

from typing import TYPE_CHECKING

import cython

from ranger_sim.boards.firmware_board import TICK_CYCLES
from ranger_sim.boards.modules.can_link import TRANSMIT_CYCLES
from ranger_sim.boards.modules.joint_safety import HipSafety
from ranger_sim.boards.modules.publishing import Send, laid_out
from ranger_sim.boards.motor_board import MotorBoard
from ranger_sim.datatable.generated import mch as table
from ranger_sim.firmware_sim.peripherals.can_controller import ICR_BUS_ERROR, ICR_ERROR_WARNING
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_RI, ICR_TI1
from ranger_sim.firmware_sim.scheduler import Schedule, Task, Wait

if TYPE_CHECKING:
    from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder

CAN_INTERRUPTS = ICR_RI | ICR_TI1 | ICR_ERROR_WARNING | ICR_BUS_ERROR  # its TX1 bit reaches no handler

# (place, multiplexer code, gain code): motor current on 4-5, battery current on 2-3, both times 2
SEQUENCE = (("motor_current", 2, 1), ("battery_current", 1, 1))
READINGS = dict(
    motor_gain=0.00154,
    motor_offset=-9,
    battery_gain=0.000506,
    battery_offset=-4,
    voltage_gain=0.0323,
)
LIMITS = dict(
    target_min=-4.0,
    target_max=4.0,
    current_min=-5.0,
    current_max=5.0,
    thermal_current=3.1,
    thermal_time=10.0,
    excess_limit=20,
)
JOINT_ENCODER = (2048, 1.0)  # pulses, gear
MOTOR_ENCODER = (192, 66.0)
REZERO_SHARE: cython.double = 0.05


@cython.cclass
class HipBoard(MotorBoard):
    """Position of the compliant law: absolute encoder. Velocity: motor encoder / 66."""

    joint: "QuadratureDecoder"
    safety: HipSafety

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
            largest_duty=250,
            gear=66.0,
            interrupts=CAN_INTERRUPTS,
        )
        self.add_encoders(phase_ns, cap01=JOINT_ENCODER, cap23=MOTOR_ENCODER)
        self.joint = self.cap01
        self.motor = self.cap23
        self.add_absolute_encoder(second_connector=0, zero=4590, sign=1, rpm=94)
        self.safety = HipSafety(self.encoder, self.current_control, self.heartbeat)
        self.start_slots(phase_ns)

    def schedule(self) -> Schedule:
        """One pass takes 2 ms; each row's variable goes out at 500 Hz, the occasional ones at 45.45 Hz."""
        board: object = self
        return Schedule(
            slot_us=table.SLOT_US,
            tick_cost=TICK_CYCLES,
            every=(
                #    function                            cost limit per item          name
                Task(board.start_external_adc,             2 * 37,   110,       0, "",      "adcx_convert_all"),
                Task(board.start_internal_adc,             2 * 31,    90,       0, "",      "adci_convert_all"),
                Task(board.joint.update_angle,             2 * 23,    70,       0, "",      "qdc_cap01_angle"),
                Task(board.joint.update_rate,             2 * 633,  6000,  2 * 24, "edge",  "qdc_cap01_rate"),
                Task(board.motor.update_angle,             2 * 23,    70,       0, "",      "qdc_cap23_angle"),
                Task(board.motor.update_rate,             2 * 614,  6000,  2 * 24, "edge",  "qdc_cap23_rate"),
                Task(board.start_absolute_encoder,         2 * 21,    60,       0, "",      "ae_update"),
                Task(board.can.receive_all,                2 * 15,  7500, 2 * 115, "frame", "can_rx_dispatch_all"),
                Task(board.heartbeat.beat,                 2 * 21,    90,       0, "",      "hb_beat"),
                Task(board.heartbeat.update,               2 * 31,   130,       0, "",      "mcu_led_update"),
                Task(board.safety.check,                   2 * 34,   140,       0, "",      "dn_safety"),
                Task(board.errors.update,                  2 * 39,  5500, 2 * 213, "error", "error_update"),
                Task(board.can.feed,                        2 * 5,   600,  2 * 35, "frame", "can_tx1"),
                Wait(board.adc_external.sequence_done,      2 * 6,  6500,                   "adcx_conversion_wait"),
                Task(board.compliant_control,             2 * 735,  2100,       0, "",      "mc_compliant_control"),
            ),
            **laid_out(table, self.can, (
                #    variable                   value                              cost      limit      more
                Send("MCH_ANGLE",               board.encoder.angle_rad,            2 * 187, 2 * 450, 2 * 140),
                Send("MCH_ANG_RATE",            board.joint.rate_rad_s,             2 * 165, 2 * 320, 2 * 70),
                Send("MCH_BATT_POWER",          board.readings.battery_power,       2 * 262, 2 * 350),
                # the occasional list, as far as not above
                Send("ERROR_MCH",               board.errors,                       2 * 8,   2 * 300, 2 * 196),
                Send("MCH_MOTOR_POSITION",      board.motor.position_rad,           2 * 165, 2 * 350, 2 * 90),
                Send("MCH_MOTOR_CURRENT",       board.readings.motor_current,       2 * 320, 2 * 440),
                Send("MCH_STATUS",              1.0,                                2 * 154, 2 * 210),
                Send("MCH_BATT_CURRENT",        board.readings.battery_current,     2 * 320, 2 * 440),
                Send("MCH_BATT_VOLTAGE",        board.readings.battery_voltage,     2 * 308, 2 * 410),
                Send("MCH_MOTOR_VELOCITY",      board.motor.rate_rad_s,             2 * 155, 2 * 320, 2 * 70),
                Task(board.motor_encoder_rezero,                                    2 * 3730, 2 * 5000),
                Send("MCH_EXECUTION_TIME",      board.execution.seconds,            2 * 276, 2 * 370),
                Send("MCH_MAX_EXECUTION_TIME",  board.execution.longest_seconds,    2 * 276, 2 * 370),
            )),
            extra_idle_call=self.quirks.occasional_idle_call,
            transmitters=("can_tx1", "can_transmit"),
            last=(
                Task(board.end_line,             TRANSMIT_CYCLES, 100, 0, "", "can_transmit"),
                Task(board.execution.record,         2 * 22,           60, 0, "", "execution_time_record"),
            ),
        )  # fmt: skip

    @cython.ccall
    def set_start_values(self) -> None:
        """Encoders start at the absolute angle; the firmware of 2016 forgets the motor's."""
        self.joint.set_position(self.encoder.angle)
        if self.quirks.hip_motor_encoder_preset:
            self.motor.set_position(self.encoder.angle)

    @cython.ccall
    @cython.exceptval(check=False)
    def controlled_position(self) -> cython.longlong:
        """The joint's own angle, rad x 65536."""
        return self.encoder.angle

    def motor_encoder_rezero(self) -> None:
        """5 % of the difference per call, always."""
        if self.quirks.hip_rezero:
            self.rezero_motor(REZERO_SHARE)
