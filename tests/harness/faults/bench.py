"""Benches for faults: the plant alone, without boards, and one encoder on a motion that the test prescribes.

Both are open loops: what a sensor shows changes nothing of the motion, so that a run with a fault can be compared step
by step with one without.
"""

import math
import types

from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.plant.sensors.imu import HEADER_RATES, SET_MODE, SET_MODE_SECOND, SET_MODE_THIRD
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from ranger_sim.ranger.conditions import condition
from ranger_sim.ranger.faults.catalogue import CATALOGUE

STEP_NS = 250_000


class Loop:
    """What a fault asks of the loop."""

    def __init__(self):
        self.time = 0
        self.watchers = []


class Bench:
    """Takes the place of a robot: `inject` and `step`. `seed`: of the faults' randomness."""

    catalogue = CATALOGUE

    @staticmethod
    def condition(wanted):
        """As Ranger.condition."""
        return condition(wanted)

    def __init__(self, plant, seed=1):
        self.plant = plant
        self.seed = seed
        self.loop = Loop()
        self.start_ns = 0
        self.faults = []
        self.boards = {}

    def inject(self, place, mode, at=None, until=None, **parameters):
        """As Ranger.inject; conditions are times."""
        fault = CATALOGUE.fault(place, mode, at, until, parameters)
        fault.arm(self)
        self.faults.append(fault)
        return fault

    def move(self, start_ns, end_ns):
        """The plant's step."""
        raise NotImplementedError

    def step(self, steps=1):
        """So many steps of 250 us, as harness/lockstep.py takes them."""
        for _ in range(steps):
            start = self.loop.time
            for watch in list(self.loop.watchers):
                watch.before_step(start)
            self.before_the_move()
            self.move(start, start + STEP_NS)
            for watch in list(self.loop.watchers):
                watch.after_step(start, start + STEP_NS)
            self.loop.time = start + STEP_NS
            self.after_the_step()

    def before_the_move(self):
        """What boards would see at the start of the step."""

    def after_the_step(self):
        """What they would see of it at its end."""


class PlantBench(Bench):
    """The whole plant in the operator's hands: the inner legs swing free, all four motors are driven to and fro.

    `seen`: one tuple per step of everything that leaves for the boards: {place in the catalogue: what is seen}.
    """

    def __init__(self, seed=1, **parameters):
        super().__init__(RangerPlant(seed=seed, **parameters), seed)
        plant = self.plant
        plant.hold(hip_angle_rad=0.3)
        plant.body.lock_hip = False
        plant._settle()
        for byte in (SET_MODE, SET_MODE_SECOND, SET_MODE_THIRD, HEADER_RATES):
            plant.imu.receive_byte(0, byte)
        self.seen = []

    def move(self, start_ns, end_ns):
        if start_ns % 20_000_000 == 0:  # 10 ms forward, 10 ms back
            self.drive(start_ns, 300, 0)
        elif start_ns % 10_000_000 == 0:
            self.drive(start_ns, 0, 300)
        for motor in self.plant.motors:
            motor.drive.watchdog_edge(start_ns)
        self.plant.step()

    def drive(self, time_ns, mr2, mr6):
        """All motors get this duty."""
        for motor in self.plant.motors:
            motor.drive.write_pwm(time_ns, mr2, mr6, 600)

    def before_the_move(self):
        self.words = list(self.plant.words)

    def after_the_step(self):
        plant = self.plant
        seen = {}
        for place in CATALOGUE.places.values():
            details = place.details
            if "encoder" in details:
                buffer = plant.encoders[details["encoder"]].edges
                seen[place.name] = [int(edge) for edge in buffer.kept[: buffer.count]]
            elif "word" in details:
                seen[place.name] = self.words[details["word"]]
            elif "voltage" in details:
                number = details["voltage"]
                seen[place.name] = (plant.electrics.analog_start[number], plant.electrics.analog_end[number])
        line = plant.imu.bytes
        seen["UI.imu"] = [(int(line.times[i]), int(line.values[i])) for i in range(line.count)]
        self.seen.append(seen)


class EdgeBench(Bench):
    """One joint encoder whose joint is at `angle(seconds)` rad; `board` decodes as the firmware does."""

    PLACES = ("MCH.joint_encoder", "MCFO.joint_encoder")

    def __init__(self, angle, sign=1):
        self.encoder = IncrementalEncoder("test", 2048, 1.0, sign)
        self.angle = angle
        self.leg = types.SimpleNamespace(angle=0.0, foot_angle=0.0)
        plant = types.SimpleNamespace(
            encoders=[self.encoder] * 6, encoder_rad=lambda number: self.leg.angle + self.leg.foot_angle
        )
        super().__init__(plant)
        self.place = self.PLACES[0 if sign > 0 else 1]
        self.sign = sign
        self.encoder.reset(angle(0.0))
        self._stand(0.0)
        self.first = self.encoder.cell
        self.board = Decoder(self.encoder.level_a())

    def _stand(self, seconds):
        angle = self.angle(seconds)
        if self.sign > 0:
            self.leg.angle = angle  # of the hip: outer less inner leg
        else:
            self.leg.foot_angle = angle  # of the outer ankle: foot less leg

    def move(self, start_ns, end_ns):
        tiny = 1e-9
        t0, t1 = start_ns * 1e-9, end_ns * 1e-9
        rates = [(self.angle(t + tiny) - self.angle(t - tiny)) / (2.0 * tiny) for t in (t0, t1)]
        self.encoder.update(start_ns, end_ns, self.angle(t0), rates[0], self.angle(t1), rates[1])
        self._stand(t1)

    def after_the_step(self):
        buffer = self.encoder.edges
        self.board.take([buffer.edge(place) for place in range(buffer.count)], self.loop.time - STEP_NS, self.loop.time)

    @property
    def true(self):
        """Edges that the sensor has sent since the start, in the joint's sense."""
        return self.sign * (self.encoder.cell - self.first)

    @property
    def counted(self):
        """Edges that the board has counted, in the joint's sense."""
        return self.sign * self.board.count


class Decoder:
    """What a board makes of edges (robot.md N4.1): rising with B low +1, with B high -1; falling the reverse.

    It holds every edge against what a wire can do: levels that change, in order of time, within their step.
    """

    def __init__(self, level_a):
        self.level_a = level_a
        self.count = 0
        self.edges = 0
        self.latest_ns = -1
        self.shortest_ns = math.inf

    def take(self, edges, start_ns, end_ns):
        """The edges of a step as (time, A, B)."""
        for time_ns, level_a, level_b in edges:
            assert start_ns <= time_ns < end_ns
            assert time_ns >= self.latest_ns
            assert level_a == 1 - self.level_a
            if self.latest_ns >= 0:
                self.shortest_ns = min(self.shortest_ns, time_ns - self.latest_ns)
            rising = level_a == 1
            self.count += 1 if rising == (level_b == 0) else -1
            self.level_a, self.latest_ns = level_a, time_ns
            self.edges += 1
