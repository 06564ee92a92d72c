"""A bench for one motor board: a bus that acknowledges everything, pins, and a motor of R, L and a gear."""

from collections import Counter

from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.inner_feet import InnerFeetBoard
from ranger_sim.boards.motor_board import ANALOG, PINS
from ranger_sim.boards.outer_feet import OuterFeetBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.steering import SteeringBoard
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE, PIN_EDGE, PIN_OUTPUT, PWM_UPDATE
from ranger_sim.foundation.numbers import float_of_word, word_of_float

BOARDS = {"MCH": HipBoard, "MCFO": OuterFeetBoard, "MCFI": InnerFeetBoard, "MCSI": SteeringBoard}
FRAME_NS = 37_000  # 111 bits at 3 Mbit/s
SLOT_NS = 500_000
SENT = 0


class Bench:
    """One board with a bus that takes a frame in 37 us and a clock that an outside router sends each ms."""

    def __init__(self, name="MCH", quirks=None, sync=True, phase_ns=0, ppb=0):
        self.board = BOARDS[name](Crystal(10_000_000, ppb), quirks or Quirks(), phase_ns)
        self.name = name
        self.table = self.board.table
        self.controller = self.board.can_controller.number
        self.now = phase_ns
        self.sync = sync
        self.last_ms = phase_ns // 1_000_000
        self.bus_free = 0
        self.frames = []  # (time, identifier, value word, time word)
        self.pwm = (0, 0)
        self.pwm_log = []  # (time, MR2, MR6)
        self.pins = {}
        self.pin_log = []  # (time, pin, level)
        self.answers = True
        encoder = self.board.encoder
        if encoder is not None:  # hip straight, ankles at 1.5 rad, where no direction is blocked
            self.board.words[0] = encoder.zero + (encoder.sign * 1956 if name != "MCH" else 0)
        self.motor = None

    def run(self, ms=0.0, slots=0, step_ns=125_000):
        """Advance the board, the bus and the motor."""
        end = self.now + int(ms * 1_000_000) + slots * SLOT_NS
        while self.now < end:
            until = min(self.now + step_ns, end)
            if self.sync and until // 1_000_000 > self.last_ms:
                self.last_ms = until // 1_000_000
                self.receive(self.table.TIMESTAMP, self.last_ms & 0xFFFFFFFF, self.last_ms & 0xFFFFFFFF)
            if self.motor is not None:
                self.motor.step(self, self.now, until)
            self.board.advance(until)
            self.now = until
            self.drain()
        return self

    def drain(self):
        queue = self.board.outbox
        while queue.take():
            if queue.kind == CAN_REQUEST:
                if not self.answers:
                    continue
                assert queue.d & 15 == 8
                self.bus_free = max(self.bus_free, queue.time) + FRAME_NS
                self.frames.append((queue.time, queue.c, queue.e, queue.f))
                done = max(self.bus_free, self.now)
                self.board.inbox.push(done, 512, CAN_TX_DONE, self.controller, queue.b, SENT)
            elif queue.kind == PWM_UPDATE:
                self.pwm = (queue.a, queue.b)
                self.pwm_log.append((queue.time, queue.a, queue.b))
            elif queue.kind == PIN_OUTPUT:
                self.pins[queue.a] = queue.b
                self.pin_log.append((queue.time, queue.a, queue.b))

    def receive(self, identifier, word, stamp=0, flags=8):
        self.board.inbox.push(self.now + 1, 512, CAN_RX, self.controller, identifier, flags, word, stamp)

    def command(self, suffix, value):
        """A float or int command of the main brain by the variable's name without the board."""
        identifier = getattr(self.table, f"{self.name}_{suffix}")
        whole = suffix in ("SHUTDOWN", "SLEEP")
        self.receive(identifier, value if whole else word_of_float(value))

    def volts(self, place, value):
        self.board.analog.set_pair(ANALOG[place], self.now, value, self.now + 1, value)

    def counts(self, place, counts, gain=2):
        """Hold the voltage that the 14-bit converter reads as `counts`."""
        self.volts(place, counts * 2.5 / (gain * 8192.0))

    def edge(self, a, b, pair="01", after_ns=0):
        """An edge of channel A to level `a` while B is at `b`."""
        self.board.inbox.push(
            self.now + after_ns,
            256,
            PIN_EDGE,
            PINS[f"encoder_{pair}_a"],
            a,
            PINS[f"encoder_{pair}_b"],
            b,
        )

    def turn(self, edges, period_ns, forward=True, pair="01"):
        """Edges of a turning encoder from now on; run on afterwards."""
        for i in range(edges):
            a = 1 - (i & 1)
            b = (1 - a) if forward else a
            self.edge(a, b, pair, after_ns=(i + 1) * period_ns)

    def rates(self):
        """How many frames of each variable went out."""
        return Counter(self.table_name(identifier) for _, identifier, _, _ in self.frames)

    def table_name(self, identifier):
        names = {value: key for key, value in vars(self.table).items() if isinstance(value, int)}
        return self.table.NAMES[identifier] if hasattr(self.table, "NAMES") else names[identifier]

    def values(self, suffix):
        identifier = getattr(self.table, f"{self.name}_{suffix}")
        return [float_of_word(word) for _, i, word, _ in self.frames if i == identifier]

    def errors(self):
        """Events by error name."""
        names = {value: key for key, value in vars(codes).items() if isinstance(value, int)}
        totals = self.board.errors.totals
        return {names[code]: totals[code] for code in range(len(totals)) if totals[code]}


class Winding:
    """A motor winding of R and L with a back-EMF, seen through the current sensor of the board."""

    def __init__(self, resistance=1.34, inductance=67e-6, volts=25.9):
        self.resistance = resistance
        self.inductance = inductance
        self.volts = volts
        self.current = 0.0
        self.back_emf = 0.0
        self.log = []

    def step(self, bench, start, end):
        from math import exp

        net = (bench.pwm[0] - bench.pwm[1]) / 600.0 * bench.board.output.sign
        final = (net * self.volts - self.back_emf) / self.resistance
        share = exp(-(end - start) * 1e-9 * self.resistance / self.inductance)
        before = self.current
        self.current = final + (self.current - final) * share
        reading = bench.board.readings
        scale = 2.5 / (2 * 8192.0)
        bench.board.analog.set_pair(
            ANALOG["motor_current"],
            start,
            (reading.motor_offset - before / reading.motor_gain) * scale,
            end,
            (reading.motor_offset - self.current / reading.motor_gain) * scale,
        )
        self.log.append((end, self.current))
