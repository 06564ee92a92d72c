"""Every place of the robot for the faults of this package, from the tables of ranger/wiring.py.

A place is named by the board that receives its signal, or whose motor it belongs to, and by its function there.
"""

from ranger_sim.harness.faults import network_places
from ranger_sim.harness.faults.fault import Place
from ranger_sim.harness.faults.kinds import (
    BATTERY_CURRENT,
    BATTERY_VOLTAGE,
    BRIDGE,
    BURST_CONVERTER,
    CABLE,
    CONVERTER,
    EDGES,
    FLOOR,
    FOOT,
    IMU,
    INTERNAL_CONVERTER,
    JOINT,
    MOTOR,
    MOTOR_CURRENT,
    ROBOT,
    STEERING_ANGLE,
    SUPPLY_CURRENT,
    SUPPLY_VOLTAGE,
    WORD,
)
from ranger_sim.plant import wiring_points as point
from ranger_sim.ranger import wiring
from ranger_sim.ranger.faults.catalogue import CATALOGUE

# Each encoder of the plant's list: name at its board, what it is, joint, edges of channel A per turn.
ENCODERS = {
    point.HIP_JOINT_EDGES: ("joint_encoder", "the incremental encoder of the hip joint, 4096 edges a turn"),
    point.HIP_MOTOR_EDGES: ("motor_encoder", "the incremental encoder of the hip motor, 384 edges a turn, gear 66"),
    point.OUTER_MOTOR_EDGES: (
        "motor_encoder",
        "the incremental encoder of the outer ankles' motor, 1024 edges, gear 34",
    ),
    point.OUTER_ANKLE_EDGES: ("joint_encoder", "the incremental encoder of the outer ankles, 4096 edges a turn"),
    point.INNER_MOTOR_EDGES: (
        "motor_encoder",
        "the incremental encoder of the inner ankles' motor, 1024 edges, gear 34",
    ),
    point.INNER_ANKLE_EDGES: ("joint_encoder", "the incremental encoder of the inner ankles, 4096 edges a turn"),
}
# What restores a board's count after lost edges (robot.md N4.8).
KEPT_BY_THE_BOARD = {
    "MCH": {"motor_encoder": "the board's count, until its re-zeroing has drawn it back to the joint's: 5 % at 45 Hz"},
    "MCFO": {"motor_encoder": "the board's count, until its re-zeroing has: 20 % at 15 Hz, ankle flipped up at rest"},
    "MCFI": {"motor_encoder": "the board's count, until its re-zeroing has: 5 % at 17 Hz, ankle flipped up at rest"},
}
WORDS = {
    point.HIP_WORD: "the serial word of the hip's absolute encoder, 8192 counts a turn",
    point.OUTER_ANKLE_WORD: "the serial word of the outer ankles' absolute encoder, 8192 counts a turn",
    point.INNER_ANKLE_WORD: "the serial word of the inner ankles' absolute encoder, 8192 counts a turn",
}
# By name of the input: kind of place, what it is.
VOLTAGES = {
    "motor_current": (MOTOR_CURRENT, "the current sensor's voltage at the converter, differential"),
    "battery_current": (BATTERY_CURRENT, "the battery current sensor's voltage at the converter, differential"),
    "battery_voltage": (BATTERY_VOLTAGE, "the divided battery voltage at the processor's converter, single-ended"),
    "left_foot": (FOOT, "the left foot sensor's voltage at the converter, single-ended"),
    "right_foot": (FOOT, "the right foot sensor's voltage at the converter, single-ended"),
    "steering_sensor": (STEERING_ANGLE, "the steering sensor's voltage at the converter, single-ended"),
    "supply_current": (SUPPLY_CURRENT, "the electronics' current at the router's converter, single-ended"),
    "supply_voltage": (SUPPLY_VOLTAGE, "the battery voltage at the router's converter, single-ended"),
}
MOTOR_WORDS = {
    "MCH": "hip",
    "MCFO": "outer ankles",
    "MCFI": "inner ankles",
    "MCSI": "steering",
}
ANKLES = ("MCFO", "MCFI")


def sensors() -> list[Place]:
    """Places on the wires between the plant's sensors and the boards."""
    places = []
    for wire in wiring.ENCODERS:
        name, what = ENCODERS[wire.encoder]
        details = {
            "board": wire.board,
            "encoder": wire.encoder,
            "kept": KEPT_BY_THE_BOARD.get(wire.board, {}).get(name),
        }
        places.append(Place(f"{wire.board}.{name}", EDGES, what, details))
    for word in wiring.WORDS:
        places.append(
            Place(f"{word.board}.{word.register}", WORD, WORDS[word.word], {"board": word.board, "word": word.word})
        )
    for analog in wiring.ANALOG:
        kind, what = VOLTAGES[analog.input]
        details = {"board": analog.board, "voltage": analog.voltage}
        places.append(Place(f"{analog.board}.{analog.input}", kind, what, details))
    places.append(
        Place(f"{wiring.IMU_BOARD}.imu", IMU, "the packets of the inertial unit, rate about x", {"board": "UI"})
    )
    return places


def converters() -> list[Place]:
    """Places in the analog-digital converters of the boards."""
    places = []
    for board in wiring.MOTORS:
        details = {"board": board, "converter": "adc_external"}
        places.append(Place(f"{board}.adc_external", CONVERTER, "the 14-bit converter ADS7871", details))
        details = {"board": board, "converter": "adc_internal"}
        places.append(Place(f"{board}.adc_internal", INTERNAL_CONVERTER, "the processor's 10-bit converter", details))
    details = {"board": "CSR", "converter": "adc"}
    places.append(Place("CSR.adc_internal", BURST_CONVERTER, "the router's 10-bit converter, in burst mode", details))
    return places


def actuators() -> list[Place]:
    """Places from the bridges to the joints."""
    places = []
    for board, motor in wiring.MOTORS.items():
        name = MOTOR_WORDS[board]
        details = {"board": board, "motor": motor}
        places.append(Place(f"{board}.bridge", BRIDGE, f"the H-bridge of the motor of the {name}", details))
        places.append(Place(f"{board}.motor", MOTOR, f"the motor of the {name}", details))
        if board in ANKLES:
            places.append(Place(f"{board}.cable", CABLE, f"the cable from the motor to the {name}", details))
        places.append(Place(f"{board}.joint", JOINT, f"the joint of the {name}", details))
    return places


CATALOGUE.add_places(sensors())
CATALOGUE.add_places(converters())
CATALOGUE.add_places(actuators())
CATALOGUE.add_places(
    (
        Place("world.robot", ROBOT, "the robot's centre of mass"),
        Place("world.floor", FLOOR, "the floor under the feet"),
    )
)
CATALOGUE.add_places(network_places.controllers(wiring.CAN))
CATALOGUE.add_places(network_places.buses(4))
