"""A robot with its data link in this process, on virtual time: what it sends goes to a session, or is lost."""

from ranger_sim.harness.outside import serial_ports
from ranger_sim.ranger import serial_ports as robot_ports
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

LOOK_S = 0.005


class InMemory(serial_ports.Port):
    """Both ends of a line."""

    path = "a line in memory"

    def __init__(self):
        self.to_robot = self.from_robot = b""

    def read(self, limit):
        data, self.to_robot = self.to_robot[:limit], self.to_robot[limit:]
        return data

    def write(self, data):
        self.from_robot += data
        return len(data)

    def filenos(self):
        return []

    def close(self):
        pass


class OnALine:
    """A robot that has been sending at its full rate for long."""

    def __init__(self):
        self.robot = Ranger(Scenario())
        self.port = InMemory()
        robot_ports.connect_daq(self.robot, self.port)
        self.robot.board("MB").computer.rate_sum = 40_960  # not ten seconds of ramp

    def pass_on(self, session, seconds, loses=False):
        """Let time pass; bytes of the robot are received, or lost on the line."""
        for _ in range(round(seconds / LOOK_S)):
            self.port.to_robot += session.outgoing(self.robot.time_s)
            self.robot.run_for(LOOK_S)
            data, self.port.from_robot = self.port.from_robot, b""
            session.receive(b"" if loses else data, self.robot.time_s)
