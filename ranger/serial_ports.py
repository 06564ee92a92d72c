"""The robot's serial lines at ports: the main brain's data link, and the inertial unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ranger_sim.boards.main_brain.board import COMPUTER_PORTS
from ranger_sim.harness.outside.serial_ports import Dropouts, ImuOffer, Port, Push, SerialLine
from ranger_sim.ranger import wiring

if TYPE_CHECKING:
    from ranger_sim.ranger.robot import Ranger


def daq_line(push: Push, board: Any, port: Port, dropouts: Dropouts | None = None) -> SerialLine:
    """The line between the main brain `board` and a port; `push` reaches the board's inbox."""
    uart = board.computer_uart
    cts_pin = COMPUTER_PORTS[board.quirks.computer_link].cts_pin
    return SerialLine(push, uart.number, port, uart.byte_ns, dropouts, cts_pin)


def connect_daq(robot: Ranger, port: Port, dropouts: Dropouts | None = None) -> SerialLine:
    """The main brain's data link on a port."""
    board = robot.boards["MB"]
    line = daq_line(board.inbox.push, board, port, dropouts)
    return _connect(robot, "MB", line)


def connect_imu(robot: Ranger, port: Port) -> SerialLine:
    """A real inertial unit at the port, instead of the plant's, on the user interface board's UART."""
    board = robot.boards[wiring.IMU_BOARD]
    line = SerialLine(board.inbox.push, wiring.IMU_UART, port, board.uart1.byte_ns)
    robot.loop.serial_device.unplug()
    return _connect(robot, wiring.IMU_BOARD, line)


def offer_imu(robot: Ranger, port: Port) -> ImuOffer:
    """The plant's inertial unit for a real host at the port."""
    offer = ImuOffer(robot.plant.imu, port)
    robot.loop.serial_device.tap = offer
    robot.attach(offer)
    return offer


def _connect(robot: Ranger, board: str, line: SerialLine) -> SerialLine:
    robot.loop.connect_serial_line(robot.boards[board], line.uart, line)
    robot.attach(line)
    return line
