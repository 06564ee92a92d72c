# cython: boundscheck=False, wraparound=False
# (results are those of SEQUENCE)
"""The common part of the boards of the outer and the inner feet: two feet, two limit switches, one ankle motor.

Source: robot.md N4.2, N4.7-N4.9, N5. The modules of the two boards have their constants and tables.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.boards.modules.foot_contact import FootContact
from ranger_sim.boards.modules.joint_safety import AnkleSafety
from ranger_sim.boards.modules.limit_switch import LimitSwitch
from ranger_sim.boards.motor_board import CONVERSION_NS, PINS, MotorBoard
from ranger_sim.datatable.generated import errors as codes

if TYPE_CHECKING:
    from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder

# (place, multiplexer code, gain code): differential 4-5 and 2-3 times 2, single-ended 0 and 1 times 1
SEQUENCE = (
    ("motor_current", 2, 1),
    ("battery_current", 1, 1),
    ("left_foot", 8, 0),
    ("right_foot", 9, 0),
)
# places in SEQUENCE
LEFT_FOOT: Final = 2
RIGHT_FOOT: Final = 3
LIMITS = dict(
    target_min=-1.0,
    target_max=6.0,
    current_min=-2.0,
    current_max=8.0,
    thermal_current=3.1,
    thermal_time=10.0,
    excess_limit=20,
)
GEAR = 34.0
FOOT_ON_LEVEL = 2000  # counts
FOOT_OFF_LEVEL = 1000
REZERO_ANGLE_RAD = 0.3
REZERO_RATE_RAD_S = 0.01
# Setting the motor's angle costs this in addition to the check: with it the slot is the 301 us of MCFI's image with the
# ankle at 0.1 rad, and within the logs' 286 to 313 (robot.md T1).
SET_CYCLES = 2 * 4010


@cython.cclass
class AnkleBoard(MotorBoard):
    """Position and velocity of the compliant law: motor encoder / 34. `rezero_share` of the difference per call."""

    joint: "QuadratureDecoder"
    safety: AnkleSafety
    left_foot: FootContact
    right_foot: FootContact
    left_switch: LimitSwitch
    right_switch: LimitSwitch
    rezero_share: cython.double
    rezero_angle: cython.double
    rezero_rate: cython.double

    def __init__(
        self,
        table,
        crystal,
        quirks,
        phase_ns,
        readings,
        sign,
        motor_encoder,
        joint_encoder,
        absolute_encoder,
        rezero_share,
        right_off_level,
    ) -> None:
        MotorBoard.__init__(
            self,
            table,
            crystal,
            quirks,
            phase_ns,
            sequence=SEQUENCE,
            readings=readings,
            limits=LIMITS,
            sign=sign,
            largest_duty=300,
            gear=GEAR,
            conversion_ns=CONVERSION_NS,
        )
        self.add_encoders(phase_ns, cap01=motor_encoder, cap23=joint_encoder)
        self.motor = self.cap01
        self.joint = self.cap23
        self.add_absolute_encoder(second_connector=1, **absolute_encoder)
        self.rezero_share = rezero_share
        self.rezero_angle = REZERO_ANGLE_RAD
        self.rezero_rate = REZERO_RATE_RAD_S
        samples = self.quirks.contact_equal_samples
        self.left_foot = FootContact(FOOT_ON_LEVEL, FOOT_OFF_LEVEL, samples)
        self.right_foot = FootContact(FOOT_ON_LEVEL, right_off_level, samples)
        self.left_switch = LimitSwitch(self, PINS["limit_switch_left"])
        self.right_switch = LimitSwitch(self, PINS["limit_switch_right"])
        board = table.BOARD
        self.safety = AnkleSafety(
            self.encoder,
            self.motor,
            self.left_switch,
            self.right_switch,
            self.current_control,
            self.heartbeat,
            self.errors,
            getattr(codes, board + "_ANKL_LS"),
            getattr(codes, board + "_CBL_STRCH"),
            getattr(codes, board + "_ANKL_LO"),
            getattr(codes, board + "_ANKL_HI"),
        )

    @cython.ccall
    def set_start_values(self) -> None:
        """Both incremental encoders start at the absolute angle."""
        self.motor.set_position(self.encoder.angle)
        self.joint.set_position(self.encoder.angle)

    def update_switches(self) -> None:
        """ls_update: both limit switches and both feet, with the newest converter results."""
        self.left_switch.read()
        self.right_switch.read()
        self.right_foot.read(self.adc_external.results[RIGHT_FOOT])
        self.left_foot.read(self.adc_external.results[LEFT_FOOT])

    def motor_encoder_rezero(self) -> None:
        """Motor encoder towards the ankle, only while the foot rests near its upper stop."""
        rate: cython.double = self.joint.rate_rad_s()
        if self.encoder.radians < self.rezero_angle and -self.rezero_rate < rate < self.rezero_rate:
            self.rezero_motor(self.rezero_share)
            self.spend(SET_CYCLES)

    # --- what is published ------------------------------------------------------------------------------

    @cython.ccall
    @cython.exceptval(check=False)
    def right_heel_sense(self) -> cython.longlong:
        """Counts of the right foot's sensor."""
        return self.adc_external.results[RIGHT_FOOT]

    @cython.ccall
    @cython.exceptval(check=False)
    def left_heel_sense(self) -> cython.longlong:
        """Counts of the left foot's sensor."""
        return self.adc_external.results[LEFT_FOOT]
