"""Every wire of the robot, as tables: which sensor is on which pin of which board, which board on which bus.

Source: robot.md N1.1 (buses), N4.1 (encoders), N4.5-N4.9 (converters, switches), N4.10, N4.11 (user interface).
Read a line from left to right in the direction of the signal.
"""

from ranger_sim.boards import can_router, motor_board, user_interface
from ranger_sim.boards.modules import ssp_link
from ranger_sim.harness.wiring.wires import (
    AnalogInput,
    BridgeWire,
    CanWire,
    EncoderWire,
    EncoderWord,
    ImuUart,
    LinkWire,
    Wiring,
)
from ranger_sim.plant import wiring_points as point

# The order in which boards are advanced and their messages sorted within one time.
BOARDS = ("MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB")

# Boards on which frames, edges and bytes wait for a task: no handler and no main loop answers them at once, or reads
# a sensor because of them.
RECEIVE_IN_SLOTS = ("MCH", "MCFO", "MCFI", "MCSI", "UI")


CAN = (
    CanWire("CSR", 1, 1),
    CanWire("CSR", 2, 2),
    CanWire("CSR", 3, 3),
    CanWire("CSR", 4, 4),
    CanWire("MCH", 1, 1),
    CanWire("UI", 2, 2),
    CanWire("MCFO", 1, 3),
    CanWire("MCFI", 2, 4),
    CanWire("MCSI", 2, 4),
)


ENCODERS = (
    EncoderWire(point.HIP_JOINT_EDGES, "MCH", "encoder_01_a", "encoder_01_b"),
    EncoderWire(point.HIP_MOTOR_EDGES, "MCH", "encoder_23_a", "encoder_23_b"),
    EncoderWire(point.OUTER_MOTOR_EDGES, "MCFO", "encoder_01_a", "encoder_01_b"),
    EncoderWire(point.OUTER_ANKLE_EDGES, "MCFO", "encoder_23_a", "encoder_23_b"),
    EncoderWire(point.INNER_MOTOR_EDGES, "MCFI", "encoder_01_a", "encoder_01_b"),
    EncoderWire(point.INNER_ANKLE_EDGES, "MCFI", "encoder_23_a", "encoder_23_b"),
)


ANALOG = (
    AnalogInput(point.HIP_MOTOR_CURRENT, "MCH", "motor_current"),
    AnalogInput(point.HIP_BATTERY_CURRENT, "MCH", "battery_current"),
    AnalogInput(point.HIP_BATTERY_VOLTAGE, "MCH", "battery_voltage"),
    AnalogInput(point.OUTER_ANKLE_MOTOR_CURRENT, "MCFO", "motor_current"),
    AnalogInput(point.OUTER_ANKLE_BATTERY_CURRENT, "MCFO", "battery_current"),
    AnalogInput(point.OUTER_ANKLE_BATTERY_VOLTAGE, "MCFO", "battery_voltage"),
    AnalogInput(point.OUTER_FOOT_LEFT, "MCFO", "left_foot"),
    AnalogInput(point.OUTER_FOOT_RIGHT, "MCFO", "right_foot"),
    AnalogInput(point.INNER_ANKLE_MOTOR_CURRENT, "MCFI", "motor_current"),
    AnalogInput(point.INNER_ANKLE_BATTERY_CURRENT, "MCFI", "battery_current"),
    AnalogInput(point.INNER_ANKLE_BATTERY_VOLTAGE, "MCFI", "battery_voltage"),
    AnalogInput(point.INNER_FOOT_LEFT, "MCFI", "left_foot"),
    AnalogInput(point.INNER_FOOT_RIGHT, "MCFI", "right_foot"),
    AnalogInput(point.STEERING_MOTOR_CURRENT, "MCSI", "motor_current"),
    AnalogInput(point.STEERING_BATTERY_CURRENT, "MCSI", "battery_current"),
    AnalogInput(point.STEERING_BATTERY_VOLTAGE, "MCSI", "battery_voltage"),
    AnalogInput(point.STEERING_ANGLE, "MCSI", "steering_sensor"),
    AnalogInput(point.ROUTER_CURRENT, "CSR", "supply_current"),
    AnalogInput(point.ROUTER_VOLTAGE, "CSR", "supply_voltage"),
)
ANALOG_INPUTS = {
    **dict.fromkeys(("MCH", "MCFO", "MCFI", "MCSI"), motor_board.ANALOG),
    "CSR": can_router.ANALOG,
}


WORDS = (
    EncoderWord(point.HIP_WORD, "MCH", "absolute_encoder"),
    EncoderWord(point.OUTER_ANKLE_WORD, "MCFO", "absolute_encoder"),
    EncoderWord(point.INNER_ANKLE_WORD, "MCFI", "absolute_encoder"),
)
WORD_REGISTERS = motor_board.WORDS

# Board -> the motor its bridge drives. PWM, low-side enables and the watchdog line go there.
MOTORS = {
    "MCH": point.HIP,
    "MCFO": point.OUTER_ANKLE,
    "MCFI": point.INNER_ANKLE,
    "MCSI": point.STEERING,
}
MOTOR_PINS = motor_board.PINS
PINS = {**dict.fromkeys(("MCH", "MCFO", "MCFI", "MCSI"), motor_board.PINS), "UI": user_interface.PINS}

# The inertial unit is connected to UART 1 of the user interface board.
IMU_BOARD, IMU_UART = "UI", user_interface.IMU_UART

# The router asks the main brain for a segment.
LINK = LinkWire("CSR", "MB", ssp_link.EXCHANGE_NS, ssp_link.empty_segment)

MOTOR_BOARDS = ("MCH", "MCFO", "MCFI", "MCSI")
RANGER = Wiring(
    receive_in_slots=RECEIVE_IN_SLOTS,
    can=CAN,
    encoders=ENCODERS,
    analog=ANALOG,
    words=WORDS,
    bridges=[BridgeWire(board, motor, "motor_watchdog", "low_side_2", "low_side_6") for board, motor in MOTORS.items()],
    link=LINK,
    imu=ImuUart(IMU_BOARD, IMU_UART),
    names={
        **dict.fromkeys(MOTOR_BOARDS, {**MOTOR_PINS, **motor_board.ANALOG, **WORD_REGISTERS}),
        "UI": PINS["UI"],
        "CSR": ANALOG_INPUTS["CSR"],
    },
)
