"""A board with every peripheral under seeded random inputs; `python -m tests.firmware_sim.workload` prints a digest.

The digest covers every time of every task and handler, every message sent, and the final records.
"""

import hashlib

from ranger_sim.firmware_sim import microcontroller
from ranger_sim.firmware_sim.activity import ActivityLog
from ranger_sim.firmware_sim.clock import seeded_crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.spi_encoder import SpiEncoder
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.scheduler import Schedule, Task, Wait
from ranger_sim.firmware_sim.vic import ADC_DONE, EXTERNAL_INTERRUPT, FIQ, SPI_DONE, TIMER_MATCH
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE, PIN_EDGE, UART_BYTE
from ranger_sim.foundation.random_stream import RandomStream

QUANTUM_NS = 25_000


class BusyBoard(Microcontroller):
    def __init__(self, seed):
        stream = RandomStream(seed, "crystal")
        Microcontroller.__init__(self, "BUSY", 60_000_000, seeded_crystal(stream))
        self.trace = hashlib.sha256()
        self.random = RandomStream(seed, "cost")
        self.timer0 = TimerCapture(self, match_interrupt=True)
        self.timer0.use_channel(0, 22)
        self.timer0.use_channel(2, 16)
        self.adcx = Ads7871(self)
        self.adcx.set_sequence((2, 1, 0), (1, 3, 1), (8, 0, 2))
        self.adci = AdcInternal(self)
        self.spi = SpiEncoder(self)
        self.uart = Uart(self, number=1, divisor=6, divaddval=5, mulval=14)
        self.can1 = CanController(self)
        self.pwm = Pwm(self)
        self.gpio = Gpio(self)
        attach = self.vic.attach
        attach(PIN_EDGE, 22, self.noted("edge 0", self.edge_0), cost=150, slot=FIQ)
        attach(PIN_EDGE, 16, self.noted("edge 2", self.edge_2), cost=150, slot=FIQ)
        attach(TIMER_MATCH, 0, self.noted("wrap", lambda: self.timer0.clear(1)), cost=50, slot=FIQ)
        attach(CAN_RX, 1, self.noted("frame", self.can1.release), cost=90, slot=0)
        attach(EXTERNAL_INTERRUPT, 1, self.adcx.on_busy, cost=200, slot=1)
        attach(ADC_DONE, 0, self.noted("adc", lambda: None), cost=60, slot=3)
        attach(UART_BYTE, 1, self.noted("bytes", self.bytes), cost=60, per_item=25, slot=9)
        attach(SPI_DONE, 0, self.noted("spi", lambda: None), cost=60, slot=10)
        task = self.task
        table = Schedule(
            every=(
                task("adcx", self.adcx.start_sequence, 300),
                task("adci", lambda: self.adci.start(1), 100),
                task("spi", self.spi.start, 100),
                task("load", self.load, 200, per_item=700),
                Wait(self.adcx.sequence_done, cost=10, name="wait"),
                task("control", self.control, 4_000, limit=4_000),
            ),
            rows=(
                (task("send", self.send, 260),),
                (task("print", lambda: self.uart.THR(self.timer0.CR0 & 255) and None, 90),),
                (task("long", lambda: self.spend(self.random.integer(40_000)), 100, limit=20_000),),
                (),
            ),
            occasional=[task(f"occasional {i}", lambda: None, 100 + i) for i in range(3)],
            occasional_row=3,
        )
        self.start(table, 40_000)

    def note(self, *values):
        self.trace.update(repr(values).encode())

    def noted(self, name, function):
        def handler(queue=None):
            result = function()
            self.note(name, self.now, result, self.timer0.CR0, self.timer0.CR2)
            return result if isinstance(result, int) and not isinstance(result, bool) else None

        return handler

    def task(self, name, function, cost, **more):
        return Task(self.noted(name, function), cost=cost, name=name, **more)

    def edge_0(self):
        self.timer0.clear(16)

    def edge_2(self):
        self.timer0.clear(64)

    def bytes(self):
        taken = 0
        while self.uart.LSR() & 1:
            self.note(self.uart.RBR())
            taken += 1
        return taken

    def load(self):
        return self.random.integer(12)

    def control(self):
        self.gpio.toggle(6)
        self.pwm.write(MR2=abs(self.adcx.results[0]) % 600, MR6=self.spi.read() % 600)
        self.note(list(self.adcx.results), self.adci.result, self.cycles_since_tick(), self.timer0.TC())

    def send(self):
        self.can1.transmit(1, 21, 8, self.adcx.results[1] & 0xFFFFFFFF, self.now // 1_000_000)


def run(seed, duration_ns=200_000_000, log=None):
    """Digest (hex) and the board after `duration_ns` of random load; what it does is written into `log`."""
    board = BusyBoard(seed)
    board.keep_activity(log)
    inputs = RandomStream(seed, "inputs")
    level = 0
    for start in range(0, duration_ns, QUANTUM_NS):
        for _ in range(inputs.integer(5)):
            level = 1 - level
            pin = 22 if inputs.uniform() < 0.7 else 16
            board.inbox.push(start + inputs.integer(QUANTUM_NS), 256, PIN_EDGE, pin, level, pin + 5, inputs.integer(2))
        if inputs.uniform() < 0.2:
            board.inbox.push(start + inputs.integer(QUANTUM_NS), 512, CAN_RX, 1, 7, 8, inputs.integer(1 << 32), 5)
        if inputs.uniform() < 0.5:
            board.inbox.push(start + inputs.integer(QUANTUM_NS), 768, UART_BYTE, 1, inputs.integer(256))
        for pin in range(3):
            board.analog.set_pair(pin, start, inputs.normal(), start + QUANTUM_NS, inputs.normal())
        board.words[0] = inputs.integer(1 << 13)
        if board.due(start + QUANTUM_NS):
            board.advance(start + QUANTUM_NS)
        while board.outbox.take():
            box = board.outbox
            board.note(box.time, box.kind, box.a, box.b, box.c, box.d, box.e, box.f)
            if box.kind == CAN_REQUEST:
                board.inbox.push(box.time + 40_000, 512, CAN_TX_DONE, 1, box.b, inputs.integer(3))
    scheduler = board.scheduler
    board.note(
        scheduler.slot_count,
        scheduler.overruns,
        scheduler.dropped_tasks,
        scheduler.near_limits,
        scheduler.max_slot_cycles,
        list(scheduler.histogram),
        scheduler.task_cycles(),
        [(s.name, s.requests, s.merged, s.served, s.total_cycles) for s in board.vic.sources.values()],
        list(board.timer0.lost),
    )
    return board.trace.hexdigest(), board


def activity_digest(seed, duration_ns=50_000_000):
    """Digest (hex) of everything that an activity log gets."""
    log, rows = ActivityLog(1000), hashlib.sha256()
    log.add_sink(lambda time, block: rows.update(block))
    run(seed, duration_ns, log)
    log.flush()
    return rows.hexdigest()


if __name__ == "__main__":
    kind = "interpreted" if microcontroller.__file__.endswith(".py") else "compiled"
    print(kind, *[run(seed)[0] for seed in (1, 2)], activity_digest(1))
