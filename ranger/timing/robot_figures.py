"""Execution times of the robot's own boards: the figures of docs/robot.md T1 and T2, as data for tables and tests.

Two sources: RoboDAQ logs of EXECUTION_TIME (49 logs of 2015 and 2016), and the unmodified firmware images run
instruction by instruction, where one instruction takes 2.0 cycles at 60 MHz.
"""

from __future__ import annotations

CYCLES_PER_INSTRUCTION = 2  # the single calibration that makes logs and images agree (robot.md T1)

# EXECUTION_TIME in us (robot.md T1): medians while it stands or is held; then its range while it walks: from the
# usual slot up to the highest in the logs.
EXECUTION_TIME_US = {
    #         held         walking
    "MCH":  ((214, 248), (97, 396)),
    "MCFO": ((167, 181), (167, 446)),
    "MCFI": ((167, 181), (167, 497)),
    "MCSI": ((142, 145), (142, 145)),
    "UI":   ((155, 178), (155, 185)),
}  # fmt: skip
REZEROING_US = (286, 313)  # an ankle board whose motor encoder is being set

# Instructions per call (robot.md T2): least and most over 360 slots, interrupts excluded. MCFO has no counted figures.
# A variable's line includes the work of our `can_transmit` at the row's end (30 instructions).
INSTRUCTIONS = {
    "MCH": {
        "adcx_convert_all": (37, 37),
        "adci_convert_all": (31, 31),
        "qdc_cap01_angle": (23, 23),
        "qdc_cap01_rate": (614, 691),
        "qdc_cap23_angle": (23, 23),
        "qdc_cap23_rate": (614, 989),
        "ae_update": (21, 21),
        "can_rx_dispatch_all": (15, 716),
        "hb_beat": (21, 21),
        "mcu_led_update": (31, 31),
        "dn_safety": (34, 34),
        "error_update": (39, 274),
        "can_tx1": (5, 5),
        "adcx_conversion_wait": (6, 6),
        "mc_compliant_control": (707, 762),
        "MCH_ANGLE": (317, 342),
        "MCH_ANG_RATE": (228, 235),
        "MCH_BATT_POWER": (262, 262),
        "ERROR_MCH": (8, 204),
        "MCH_MOTOR_POSITION": (240, 264),
        "MCH_MOTOR_CURRENT": (314, 332),
        "MCH_STATUS": (154, 154),
        "MCH_BATT_CURRENT": (314, 332),
        "MCH_BATT_VOLTAGE": (308, 308),
        "MCH_MOTOR_VELOCITY": (216, 235),
        "motor_encoder_rezero": (3540, 3760),
        "MCH_EXECUTION_TIME": (276, 276),
        "MCH_MAX_EXECUTION_TIME": (276, 276),
        "execution_time_record": (22, 22),
    },
    "MCFI": {
        "adcx_convert_all": (37, 37),
        "adci_convert_all": (31, 31),
        "qdc_cap01_angle": (23, 23),
        "qdc_cap01_rate": (617, 1290),
        "qdc_cap23_angle": (23, 23),
        "qdc_cap23_rate": (617, 684),
        "can_rx_dispatch_all": (15, 632),
        "hb_beat": (21, 21),
        "mcu_led_update": (31, 31),
        "ae_update": (26, 26),
        "ls_update": (135, 145),
        "dn_safety": (413, 485),
        "error_update": (39, 501),
        "can_tx2": (5, 5),
        "adcx_conversion_wait": (6, 6),
        "mc_compliant_control": (600, 764),
        "MCFI_MID_ANKLE_ANGLE": (309, 315),
        "MCFI_ANKLE_RATE": (213, 261),
        "MCFI_LEFT_HEEL_SENSE": (261, 261),
        "MCFI_MOTOR_POSITION": (231, 237),
        "MCFI_RIGHT_HS": (176, 330),
        "MCFI_BATT_POWER": (265, 265),
        "MCFI_RIGHT_HEEL_SENSE": (261, 261),
        "ERROR_MCFI": (8, 206),
        "MCFI_MOTOR_VELOCITY": (219, 231),
        "MCFI_MOTOR_CURRENT": (316, 328),
        "MCFI_LEFT_HS": (176, 330),
        "MCFI_STATUS": (156, 156),
        "MCFI_BATT_CURRENT": (316, 328),
        "MCFI_BATT_VOLTAGE": (310, 310),
        "MCFI_HBRIDGE_TEMP": (174, 174),
        "MCFI_RIGHT_LS": (170, 170),
        "MCFI_LEFT_LS": (170, 170),
        "execution_time_record": (22, 22),
    },
    "MCSI": {
        "adcx_convert_all": (37, 37),
        "adci_convert_all": (31, 31),
        "can_rx_dispatch_all": (15, 130),
        "hb_beat": (21, 21),
        "mcu_led_update": (31, 31),
        "error_update": (39, 39),
        "can_tx2": (5, 5),
        "adcx_conversion_wait": (37, 37),
        "dn_update_pwm": (88, 88),
        "MCSI_STATUS": (156, 156),
        "execution_time_record": (22, 22),
    },
}


def cycles_of(board: str, function: str) -> tuple[int, int] | None:
    """Least and most cycles of a call in the board's own image; None where it was not counted."""
    counted = INSTRUCTIONS.get(board, {}).get(function)
    return None if counted is None else (CYCLES_PER_INSTRUCTION * counted[0], CYCLES_PER_INSTRUCTION * counted[1])
