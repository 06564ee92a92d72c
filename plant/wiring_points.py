"""Interface between plant and boards: the index of every voltage, word and encoder output.

Plain numbers, no behaviour: the plant fills arrays in this order and the assembly wires them to pins.
"""

from typing import Final

import cython  # noqa: F401  (compiled: its constants are C constants for other modules)

# Motors, drives and boards.
HIP: Final = 0
OUTER_ANKLE: Final = 1
INNER_ANKLE: Final = 2
STEERING: Final = 3
MOTOR_COUNT: Final = 4

# Voltages (V at the converter's pin; differential inputs: the difference). Per motor three in a row, so
# index = PER_MOTOR x motor + one of the first three numbers.
MOTOR_CURRENT: Final = 0
BATTERY_CURRENT: Final = 1
BATTERY_VOLTAGE: Final = 2
PER_MOTOR: Final = 3
HIP_MOTOR_CURRENT: Final = 0
HIP_BATTERY_CURRENT: Final = 1
HIP_BATTERY_VOLTAGE: Final = 2
OUTER_ANKLE_MOTOR_CURRENT: Final = 3
OUTER_ANKLE_BATTERY_CURRENT: Final = 4
OUTER_ANKLE_BATTERY_VOLTAGE: Final = 5
INNER_ANKLE_MOTOR_CURRENT: Final = 6
INNER_ANKLE_BATTERY_CURRENT: Final = 7
INNER_ANKLE_BATTERY_VOLTAGE: Final = 8
STEERING_MOTOR_CURRENT: Final = 9
STEERING_BATTERY_CURRENT: Final = 10
STEERING_BATTERY_VOLTAGE: Final = 11
OUTER_FOOT_LEFT: Final = 12
OUTER_FOOT_RIGHT: Final = 13
INNER_FOOT_LEFT: Final = 14
INNER_FOOT_RIGHT: Final = 15
STEERING_ANGLE: Final = 16
ROUTER_CURRENT: Final = 17
ROUTER_VOLTAGE: Final = 18
ANALOG_COUNT: Final = 19

# Absolute encoders: 13-bit words.
HIP_WORD: Final = 0
OUTER_ANKLE_WORD: Final = 1
INNER_ANKLE_WORD: Final = 2
WORD_COUNT: Final = 3

# Incremental encoders: edges of channel A (robot.md N4.1: which capture input each one has).
HIP_JOINT_EDGES: Final = 0  # MCH capture 0
HIP_MOTOR_EDGES: Final = 1  # MCH capture 2
OUTER_MOTOR_EDGES: Final = 2  # MCFO capture 0
OUTER_ANKLE_EDGES: Final = 3  # MCFO capture 2
INNER_MOTOR_EDGES: Final = 4  # MCFI capture 0
INNER_ANKLE_EDGES: Final = 5  # MCFI capture 2
ENCODER_COUNT: Final = 6

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
