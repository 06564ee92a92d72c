"""Three hip boards side by side: in Python, in C compiled for this computer, and the same C as an image for the chip.

    python examples/hip_in_c/three_boards.py            # builds what is to be built, prints a table

All three get the same edges, voltages, angles and frames, each in the rest of a slot, where none of them works: then
what they answer can be the same bit for bit although cycles are modelled on two of them and real on the third.
What cannot be the same is left out: EXECUTION_TIME, which is of cycles, and rates until the first edges are forgotten,
whose time since power-up the image counts from when its start-up code has started the timer.
"""

import contextlib
import dataclasses
import pathlib
import platform
import statistics

from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.modules.encoder_capture import EDGE_CYCLES
from ranger_sim.datatable.generated import mch
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.lpc2194 import image
from ranger_sim.firmware_sim.lpc2194.board import ImageBoard
from ranger_sim.firmware_sim.lpc2194.hardware import BoardHardware
from ranger_sim.firmware_sim.native.native_board import NativeBoard
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE, PIN_EDGE, PWM_UPDATE, TX_SENT
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.ranger.firmware import native_boards
from ranger_sim.ranger.robot import Ranger

FOLDER = pathlib.Path(__file__).resolve().parent
SLOT_NS = 500_000
FIRST_SLOT_NS = 500_000
REST_NS = 350_000  # from a slot's start: no slot of these boards takes so long
STEP_NS = 50_000
SETTLED = 520  # slots: commands come from then on; the rate filter has forgotten the first edges (1/16 per slot)
ENCODERS = ((22, 27), (16, 29))  # pins of joint and motor, A and B
CURRENTS, VOLTAGE = (0, 1), 5  # places on the board's `analog`
COMMANDS = (mch.MCH_COMMAND_CURRENT, mch.MCH_STIFFNESS, mch.MCH_DAMPNESS)
OF_CYCLES = (mch.MCH_EXECUTION_TIME, mch.MCH_MAX_EXECUTION_TIME)
RATES = (mch.MCH_ANG_RATE, mch.MCH_MOTOR_VELOCITY)


@dataclasses.dataclass
class Answers:
    """What a board did: frames (stamp, identifier, words), duties (stamp, MR2, MR6), cycles of each slot."""

    frames: list
    duties: list
    cycles: list

    def comparable(self):
        """Frames without what cannot be the same: (identifier, words)."""
        settled_ns = FIRST_SLOT_NS + SETTLED * SLOT_NS
        return [
            (identifier, value, time)
            for stamp, identifier, value, time in self.frames
            if identifier not in OF_CYCLES and (stamp > settled_ns or identifier not in RATES)
        ]

    def settled_duties(self):
        """(MR2, MR6) from when commands come."""
        return [leads for stamp, *leads in self.duties if stamp > FIRST_SLOT_NS + SETTLED * SLOT_NS + SLOT_NS // 2]


def answers(board, slots, seed=1):
    """Run `board` over so many slots in the same world."""
    record = board.image.address_of("chip_slots") if isinstance(board, ImageBoard) else None
    world = World(RandomStream(seed, "three hip boards"))
    found = Answers([], [], [])
    for slot in range(slots):
        begin_ns = FIRST_SLOT_NS + slot * SLOT_NS
        for at_ns in range(begin_ns + STEP_NS, begin_ns + SLOT_NS + 1, STEP_NS):
            board.advance(at_ns)
            out = board.outbox
            while out.take():
                if out.kind == CAN_REQUEST:
                    found.frames.append((out.time, out.c, out.e, out.f))
                    board.inbox.push(at_ns + 1000, 0, CAN_TX_DONE, out.a, out.b, TX_SENT)
                elif out.kind == PWM_UPDATE:
                    found.duties.append((out.time, out.a, out.b))
            if at_ns == begin_ns + REST_NS:
                if record is None:
                    found.cycles.append(board.scheduler.last_slot_cycles)
                else:
                    found.cycles.append(board.core.peek(record + 12))
                world.change(board, slot, at_ns)
    return found


class World:
    """What happens to a board in the rest of each slot."""

    def __init__(self, draw):
        self.draw = draw
        self.levels = {pin: 0 for pin, _ in ENCODERS}
        self.word = 4590

    def change(self, board, slot, now_ns):
        """Edges, the absolute angle, voltages, frames; all drawn, whatever the board does."""
        draw = self.draw
        time_ns = now_ns
        for _ in range(draw.integer(9)):
            pin, partner = ENCODERS[0] if draw.integer(4) == 0 else ENCODERS[1]
            # whole microseconds/20, so that every timer of 60 MHz counts the same times whenever it was started
            time_ns += 12_000 + 50 * draw.integer(60)
            self.levels[pin] ^= 1
            backwards = draw.integer(20) == 0
            board.inbox.push(time_ns, 0, PIN_EDGE, pin, self.levels[pin], partner, self.levels[pin] ^ 1 ^ backwards)
        if slot < SETTLED:  # not with commands: in which slot the law first uses an angle depends on cycles
            self.word += draw.integer(21) - 10
        board.words[0] = self.word
        for place in CURRENTS:
            self.hold(board, place, now_ns, 0.4 * draw.uniform() - 0.2)
        self.hold(board, VOLTAGE, now_ns, 2.6 * draw.uniform())
        if slot % 2 == 0:  # the network time
            board.inbox.push(now_ns + 20_000, 0, CAN_RX, mch.CONTROLLER, mch.TIMESTAMP, 8, slot // 2, slot // 2)
        for number in range(draw.integer(4)):
            identifier = COMMANDS[draw.integer(3)]
            value = word_of_float(4.0 * draw.uniform() - 2.0)
            if slot > SETTLED:
                at_ns = now_ns + 25_000 + 20_000 * number
                board.inbox.push(at_ns, 0, CAN_RX, mch.CONTROLLER, identifier, 8, value, slot)

    @staticmethod
    def hold(board, place, now_ns, volts):
        """From now on this voltage."""
        board.analog.set_pair(place, now_ns, volts, now_ns + 1, volts)


def boards():
    """The three: name and a function that gives a fresh one."""
    library = native_boards.build(FOLDER).library
    program = image.read(native_boards.build_image(FOLDER).path)
    hardware = native_boards.hardware_of("MCH")
    on_chip = BoardHardware(external=hardware.external, internal=hardware.internal)
    return {
        "Python": lambda: HipBoard(Crystal(10_000_000)),
        "C, this computer": lambda: NativeBoard("MCH", library, Crystal(10_000_000), 0, hardware),
        "C, image": lambda: ImageBoard("MCH", program, Crystal(10_000_000), 0, on_chip),
    }


def fast_interrupt_cycles(new):
    """Cycles in the fast interrupt for one edge at rest, of an image."""
    fiq = 0x11
    board = new()
    rest_ns = FIRST_SLOT_NS + 10 * SLOT_NS + REST_NS
    board.inbox.push(rest_ns, 0, PIN_EDGE, 16, 1, 29, 0)
    time_ns, cycles, begun = rest_ns - 1000, 0, 0
    while time_ns < rest_ns + 40_000:
        time_ns += 16
        begun = board.core.cycles
        board.advance(time_ns)
        if board.core.cpsr() & 0x1F == fiq:
            cycles += board.core.cycles - begun
    return cycles


def seconds_of(new, slots, rounds):
    """Processor time for so many slots, the quietest of several rounds."""
    spent = []
    for _ in range(rounds):
        board = new()
        begun = wallclock.process_cpu_s()
        answers(board, slots)
        spent.append(wallclock.process_cpu_s() - begun)
    return min(spent)


def walking_seconds(firmware, rounds):
    """Processor time for a second of the whole walking robot, the quietest of several."""
    spent = []
    with contextlib.closing(Ranger(firmware=firmware, in_process=True)) as robot:
        robot.run_for(3.0)
        for _ in range(rounds):
            begun = wallclock.process_cpu_s()
            robot.run_for(1.0)
            spent.append(wallclock.process_cpu_s() - begun)
    return min(spent)


def main(slots=4000, rounds=5):
    made = boards()
    found = {name: answers(new(), slots) for name, new in made.items()}
    model = found["Python"]
    print(f"{slots} slots; {platform.machine()}, Python {platform.python_version()}")
    print("| hip board | frames as the Python board's | stamps, us later | duties | cycles per slot: mean, most |")
    print("|---|---|---|---|---|")
    for name, each in found.items():
        same = sum(a == b for a, b in zip(each.comparable(), model.comparable(), strict=False))
        later = [(a[0] - b[0]) / 1000 for a, b in zip(each.frames, model.frames, strict=False)]
        duties = sum(a == b for a, b in zip(each.settled_duties(), model.settled_duties(), strict=False))
        cycles = each.cycles[SETTLED:]
        print(
            f"| {name} | {same} of {len(model.comparable())} | {min(later):.1f} ... {max(later):.1f} "
            f"| {duties} of {len(model.settled_duties())} "
            f"| {statistics.mean(cycles):.0f}, {max(cycles)} |"
        )
    edge = fast_interrupt_cycles(made["C, image"])
    print(f"an edge's fast interrupt: {EDGE_CYCLES} cycles by the model, {edge} on the image")
    for name, new in made.items():
        seconds = seconds_of(new, slots, rounds)
        print(f"{name}: {1000 * seconds / (slots * SLOT_NS * 1e-9):.1f} ms of processor time for a second of the board")
    library = native_boards.build(FOLDER)
    for name, firmware in (("Python", None), ("C, this computer", {"MCH": library})):
        seconds = walking_seconds(firmware, rounds)
        print(f"the walking robot with the hip board in {name}: {1000 * seconds:.1f} ms for a second")


if __name__ == "__main__":
    main()
