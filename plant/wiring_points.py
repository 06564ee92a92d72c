"""Where the plant meets the boards: the index of every voltage, word and encoder that leaves it.

Plain numbers, no behaviour: the plant fills arrays in this order and the assembly wires them to pins.
"""

import cython

# C constants when compiled: the same numbers stand in the .pxd, and a test holds them together.
if not cython.compiled:
    # Motors, drives and boards.
    HIP = 0
    OUTER_ANKLE = 1
    INNER_ANKLE = 2
    STEERING = 3
    MOTOR_COUNT = 4

    # Voltages (V at the converter's pin; differential inputs: the difference). Per motor three in a row, so
    # index = PER_MOTOR x motor + one of the first three numbers.
    MOTOR_CURRENT = 0
    BATTERY_CURRENT = 1
    BATTERY_VOLTAGE = 2
    PER_MOTOR = 3
    HIP_MOTOR_CURRENT = 0
    HIP_BATTERY_CURRENT = 1
    HIP_BATTERY_VOLTAGE = 2
    OUTER_ANKLE_MOTOR_CURRENT = 3
    OUTER_ANKLE_BATTERY_CURRENT = 4
    OUTER_ANKLE_BATTERY_VOLTAGE = 5
    INNER_ANKLE_MOTOR_CURRENT = 6
    INNER_ANKLE_BATTERY_CURRENT = 7
    INNER_ANKLE_BATTERY_VOLTAGE = 8
    STEERING_MOTOR_CURRENT = 9
    STEERING_BATTERY_CURRENT = 10
    STEERING_BATTERY_VOLTAGE = 11
    OUTER_FOOT_LEFT = 12
    OUTER_FOOT_RIGHT = 13
    INNER_FOOT_LEFT = 14
    INNER_FOOT_RIGHT = 15
    STEERING_ANGLE = 16
    ROUTER_CURRENT = 17
    ROUTER_VOLTAGE = 18
    ANALOG_COUNT = 19

    # Absolute encoders: 13-bit words.
    HIP_WORD = 0
    OUTER_ANKLE_WORD = 1
    INNER_ANKLE_WORD = 2
    WORD_COUNT = 3

    # Incremental encoders: edges of channel A (robot.md N4.1: which capture input each one has).
    HIP_JOINT_EDGES = 0  # MCH capture 0
    HIP_MOTOR_EDGES = 1  # MCH capture 2
    OUTER_MOTOR_EDGES = 2  # MCFO capture 0
    OUTER_ANKLE_EDGES = 3  # MCFO capture 2
    INNER_MOTOR_EDGES = 4  # MCFI capture 0
    INNER_ANKLE_EDGES = 5  # MCFI capture 2
    ENCODER_COUNT = 6

# In the order of these numbers.
MOTOR_NAMES = ("hip", "outer_ankle", "inner_ankle", "steering")
ANALOG_NAMES = (
    "hip_motor_current",
    "hip_battery_current",
    "hip_battery_voltage",
    "outer_ankle_motor_current",
    "outer_ankle_battery_current",
    "outer_ankle_battery_voltage",
    "inner_ankle_motor_current",
    "inner_ankle_battery_current",
    "inner_ankle_battery_voltage",
    "steering_motor_current",
    "steering_battery_current",
    "steering_battery_voltage",
    "outer_foot_left",
    "outer_foot_right",
    "inner_foot_left",
    "inner_foot_right",
    "steering_angle",
    "router_current",
    "router_voltage",
)
WORD_NAMES = ("hip_absolute", "outer_ankle_absolute", "inner_ankle_absolute")
ENCODER_NAMES = ("hip_joint", "hip_motor", "outer_motor", "outer_ankle", "inner_motor", "inner_ankle")
