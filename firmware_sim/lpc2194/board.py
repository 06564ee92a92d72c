# cython: boundscheck=False, wraparound=False
# (every index below is a register's number, a place in RAM, or a pin 0 ... 63 that the board's wiring has checked)
"""A board whose processor runs a firmware image, instruction by instruction, on the models of the chip's devices.

How time passes: an instruction acts, on memory and devices, at the time at which it begins; it begins when the one
before it has taken its cycles. An input (an edge, a message, an alarm of a device) is handled at its stamp: before
every instruction that begins then or later. Interrupt lines are levels, checked before each instruction. So a run does
not depend on the steps in which `advance` is called.

A waiting loop is skipped: when memory, registers and the flash accelerator have the same state after a number of
instructions as before them, and no access to a device had an effect, then nothing but the cycles changes until the next
event. `skips_idle = False` executes every pass; results are the same.

A slot begins with the match of one timer; its work lasts until the main program's last access to a device, not counting
status reads and the accesses of interrupts.
"""

import array
import dataclasses
from typing import Final

import cython

from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.arm7.core import FAST, INTERRUPT, STATE, Core
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.counters import BoardCounters, CanCounters, ProcessorCounters, SlotCounters
from ranger_sim.firmware_sim.edge_line import EdgeLine
from ranger_sim.firmware_sim.lpc2194.address_map import AddressedBoard, AddressMap
from ranger_sim.firmware_sim.lpc2194.block import Block, Clocks
from ranger_sim.firmware_sim.lpc2194.can import AFMR_OFF, CanBlock, CanFilterBlock, CanFilterRam
from ranger_sim.firmware_sim.lpc2194.converter import ConverterBlock
from ranger_sim.firmware_sim.lpc2194.hardware import BoardHardware
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.firmware_sim.lpc2194.pins import FastGpioBlock, OldGpioBlock, PinSelectBlock, Ports
from ranger_sim.firmware_sim.lpc2194.pwm import PwmBlock
from ranger_sim.firmware_sim.lpc2194.spi import SpiBlock
from ranger_sim.firmware_sim.lpc2194.ssp import SegmentLink, SerialConverter, SspBlock
from ranger_sim.firmware_sim.lpc2194.system import SystemBlock
from ranger_sim.firmware_sim.lpc2194.timer import ProgrammedTimer, TimerBlock
from ranger_sim.firmware_sim.lpc2194.uart import UartBlock
from ranger_sim.firmware_sim.lpc2194.vic import VicBlock
from ranger_sim.firmware_sim.microcontroller import INDICES_PER_KIND, MESSAGE_KINDS, Microcontroller
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.ssp import SspDevice
from ranger_sim.foundation.events import CAN_RX, NEVER, PIN_EDGE, EventQueue

# Chosen by us: the number of cycles between two checks whether the program waits, and the longest loop that counts as
# waiting. A slot of the robot's boards takes some 10,000 cycles, their main loops below 200 instructions.
STINT: Final = 256
LONGEST_PASS: Final = 600
DOUBTS: Final = 8  # outside known wait loops, one stint in this many is checked
SLOT_SHARES: Final = 20
PART_WORDS: Final = 64  # of Core.written


@dataclasses.dataclass(frozen=True)
class ImageCounters(BoardCounters):
    """A board that runs an image."""

    processor: ProcessorCounters | None = None


@cython.cclass
class ImageBoard(AddressedBoard):
    """Board `name` with `image` in its memory, powered up at `phase_ns` (ns).

    `core` is the processor, `map` its devices by address, `skips_idle` whether loops that wait are skipped.
    """

    core: Core
    map: AddressMap
    vic_block: VicBlock
    system: SystemBlock
    pin_select: PinSelectBlock
    converter: ConverterBlock
    acceptance: CanFilterBlock
    can_blocks: list
    asking: list
    image: object
    clocks: Clocks
    skips_idle: cython.bint
    asleep: cython.bint
    idle: cython.bint
    pass_reads: cython.bint
    base_cycles: cython.longlong
    base_ns: cython.longlong
    running_to: cython.longlong
    slot_match: "ProgrammedTimer"
    slots_begun: cython.longlong
    slot_begin: cython.longlong
    worked_until: cython.longlong
    most_cycles: cython.longlong
    all_cycles: cython.longlong
    slots_by_cycles: cython.longlong[21]
    pass_cycles: cython.longlong
    pass_instructions: cython.longlong
    idle_cycles: cython.longlong
    idle_instructions: cython.longlong
    doubts: cython.longlong
    kept_registers: cython.longlong[::1]
    now_registers: cython.longlong[::1]
    kept_ram: cython.longlong[::1]
    waits: cython.longlong[::1]

    def __init__(
        self,
        name: str,
        image: Image,
        crystal: Crystal | None = None,
        phase_ns: int = 0,
        hardware: BoardHardware | None = None,
    ) -> None:
        hardware = hardware if hardware is not None else BoardHardware()
        Microcontroller.__init__(self, name, hardware.hz, crystal)
        self.image = image
        self.now = self.input_time = phase_ns
        self.clocks = Clocks(self.crystal.nominal_hz)
        self.core = Core(name=name)
        self.core.takes_aborts = self.core.needs_handlers = True
        self.core.place_of = image.place_of
        self._build(hardware)
        for address, content in image.segments:
            self.core.place(address, content)
        for pin in hardware.pulled_up:
            self.pins[pin] = 1
        self.skips_idle = True
        self.slots_begun = 0
        self.slot_begin = 0
        self.worked_until = 0
        self.most_cycles = 0
        self.all_cycles = 0
        self.slots_by_cycles = [0] * 21
        self.base_cycles = 0  # cycles and time from which time is counted: the clock's latest change
        self.base_ns = phase_ns
        self.running_to = 0
        self.asleep = False
        self.idle = False
        self.pass_cycles = 0
        self.pass_instructions = 0
        self.pass_reads = False
        self.idle_cycles = 0
        self.idle_instructions = 0
        self.kept_registers = array.array("q", [0]) * STATE
        self.now_registers = array.array("q", [0]) * STATE
        self.kept_ram = array.array("q", [0]) * len(self.core.ram)
        self.waits = array.array("q", [0]) * (self.core.flash_size >> 2)  # words of flash in loops that waited
        self.doubts = 0
        self.next_time = phase_ns

    def _build(self, hardware) -> None:
        """Build the chip's blocks and the devices connected to them."""
        clocks = self.clocks
        self.map = AddressMap(self, self.core, self.image)
        self.vic_block = VicBlock(self, clocks)
        external = hardware.external if not hardware.segment_interval_ns else None
        converter = None
        device: SspDevice
        if external is not None:
            it = external
            converter = Ads7871(self, it.eint, it.reference_V, it.conversion_ns, it.scale, it.offset_counts)
            converter.inputs = [it.inputs.get(code, code) for code in range(16)]
            device = SerialConverter(self, converter)
        elif hardware.segment_interval_ns:
            device = SegmentLink(self, hardware.segment_interval_ns)
        elif hardware.panel is not None:
            panel = hardware.panel(self)
            self.carry(panel)
            device = panel.ssp
        else:
            device = SspDevice(self)
        self.system = SystemBlock(self, clocks, converter)
        timers = [TimerBlock(self, clocks, number) for number in (0, 1)]
        self.slot_match = timers[hardware.slot_timer].timer
        pin_select = PinSelectBlock(self, clocks, [block.timer for block in timers])
        pin_select.external = self.system
        self.pin_select = pin_select
        ports = Ports(self)
        self.acceptance = CanFilterBlock(self, clocks)
        self.can_blocks = [CanBlock(self, clocks, number, self.acceptance) for number in (1, 2, 3, 4)]
        self.converter = ConverterBlock(self, clocks, hardware.internal)
        blocks = [
            self.vic_block,
            FastGpioBlock(self, clocks, ports),
            OldGpioBlock(self, clocks, ports),
            self.system,
            pin_select,
            *timers,
            UartBlock(self, clocks, 0),
            UartBlock(self, clocks, 1),
            PwmBlock(self, clocks),
            SpiBlock(self, clocks, 0, hardware.spi.get(0)),
            SpiBlock(self, clocks, 1, None),
            SspBlock(self, clocks, device),
            self.converter,
            *self.can_blocks,
            self.acceptance,
            CanFilterRam(self, clocks, self.acceptance),
        ]
        for block in blocks:
            self.map.add(block)
        self.asking = [block for block in blocks if block.mask]
        self.core.connect(self.map)

    # --- the processor's clock ----------------------------------------------------------------------------

    @cython.ccall
    def time_of(self, cycles: cython.longlong) -> cython.longlong:
        """The time (ns, rounded down) at which the processor has passed `cycles`."""
        return self.base_ns + self.crystal.cycles_to_ns(cycles - self.base_cycles, self.clocks.cclk)

    @cython.cfunc
    def cycles_at(self, time: cython.longlong) -> cython.longlong:
        """The first cycle that begins at `time` (ns) or later."""
        cycles: cython.longlong
        if time <= self.base_ns:
            return self.base_cycles
        cycles = self.base_cycles + self.crystal.ns_to_cycles(time - self.base_ns, self.clocks.cclk)
        while self.time_of(cycles) < time:
            cycles += 1
        return cycles

    @cython.ccall
    def set_clocks(self, cclk, divider) -> object:
        """Set PLL or VPBDIV by the program: the instruction that does it is the last one at the old rate."""
        if (cclk, divider) == (self.clocks.cclk, self.clocks.divider):
            return
        self.base_ns = self.time_of(self.core.began)
        self.base_cycles = self.core.began
        self.clocks.cclk = cclk
        self.clocks.divider = divider
        self.core.stop()
        for block in self.map.blocks():
            block.clocked()

    def retune(self, ppb, now) -> None:
        """As the chip's; the processor goes on in the middle of its loop."""
        self._catch_up(now)
        cycles = self.cycles_at(now)
        Microcontroller.retune(self, ppb, now)
        self.base_cycles = cycles
        self.base_ns = now

    @cython.ccall
    def sleep(self) -> object:
        """The program asks for idle mode: no cycles until an interrupt."""
        self.asleep = True
        self.core.stop()

    # --- what the address map calls -----------------------------------------------------------------------

    @cython.cfunc
    @cython.exceptval(check=True)
    def reach(self) -> cython.void:
        """Begin the present instruction's access to a device: devices see the time at which the instruction began."""
        self.now = self.time_of(self.core.began)

    @cython.cfunc
    @cython.exceptval(check=True)
    def work(self) -> cython.void:
        """Note that the present access has an effect: if the main program makes it, the program is at work."""
        mode: cython.longlong = self.core.control & 0x1F
        if mode != FAST and mode != INTERRUPT:
            self.worked_until = self.now

    @cython.cfunc
    def _begin_slot(self, time: cython.longlong) -> cython.void:
        """The slot timer matched at `time` (ns): the slot before is over."""
        cycles: cython.longlong
        place: cython.longlong = SLOT_SHARES
        length: cython.longlong = time - self.slot_begin
        if self.slots_begun:
            cycles = 0
            if self.worked_until > self.slot_begin:
                cycles = int((self.worked_until - self.slot_begin) * self.cycles_per_ns)
                place = SLOT_SHARES * (self.worked_until - self.slot_begin) // length
            else:
                place = 0
            self.slots_by_cycles[place if place < SLOT_SHARES else SLOT_SHARES] += 1
            self.all_cycles += cycles
            if cycles > self.most_cycles:
                self.most_cycles = cycles
        self.slots_begun += 1
        self.slot_begin = time

    @cython.cfunc
    def settle(self, block: Block) -> cython.int:
        """After an access: the levels of what the block drives, and how far the processor may run on."""
        vic: VicBlock = self.vic_block
        if block.mask:
            vic.raw = vic.raw & ~block.mask | block.requests()
        if block.partner is not None:
            vic.raw = vic.raw & ~block.partner.mask | block.partner.requests()
        self.core.lines = vic.settle()
        if self.stop_time < self.running_to:
            self.core.stop()
        return 0

    # --- passing time -------------------------------------------------------------------------------------

    def advance(self, until: cython.longlong) -> cython.longlong:
        """Run everything due before `until` (ns), or before `horizon` where an output brought that nearer.

        Returns `next_time`. NotModelledAccess, a UserError, for an access that no device here models; BoardFailure
        for an abort or an undefined instruction that the program does not handle.
        """
        core: Core = self.core
        inbox: EventQueue = self.inbox
        first: cython.longlong
        own: cython.longlong
        stop: cython.longlong
        self.horizon = until
        while True:
            first = self.alarm_time
            if inbox.head_time < first:
                first = inbox.head_time
            if self.edge_time < first:
                first = self.edge_time
            own = NEVER
            stop = first if first < self.horizon else self.horizon
            if self.idle and core.debugger is not None:  # a debugger must also find a program that waits for ever
                own = self.time_of(core.next_poll)
                if own < stop:
                    self._catch_up(own)
            if not self.idle and not self.asleep:
                own = self.time_of(core.cycles)
                if own < stop:
                    self._run(stop)
                    continue
            if first >= self.horizon:
                break
            self._take_in(first)
        if self.alarm_time < own:
            own = self.alarm_time
        self.next_time = own
        return own

    @cython.cfunc
    def _run(self, stop: cython.longlong) -> cython.int:
        """Run the processor until time `stop` (ns), or less far where an access asks for it."""
        core: Core = self.core
        target: cython.longlong
        touched: cython.longlong
        end: cython.longlong
        self.stop_time = stop
        self.running_to = stop
        target = self.cycles_at(stop)
        if not self.skips_idle:
            core.run(target)
            return 0
        while core.cycles < target:
            touched = self.map.touched
            end = core.cycles + STINT
            core.run(end if end < target else target)
            if core.stopped:
                return 0
            if self.map.touched == touched and core.cycles < target and self._may_wait():
                if self._waits(target):
                    return 0
                if core.stopped:
                    return 0
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _may_wait(self) -> cython.bint:
        """Whether to check if the program waits: always where it waited before, elsewhere now and then."""
        if self.waits[self._flash_place(self.core.pc)]:
            return True
        self.doubts += 1
        return self.doubts % DOUBTS == 0

    @cython.cfunc
    def _waits(self, target: cython.longlong) -> cython.bint:
        """Execute until the state repeats, or `target` cycles, or some hundred instructions. True: the program
        waits."""
        core: Core = self.core
        pc: cython.longlong = core.pc
        cycles: cython.longlong = core.cycles
        instructions: cython.longlong = core.instructions
        touched: cython.longlong = self.map.touched
        reads: cython.longlong = self.map.reads
        left: cython.longlong = LONGEST_PASS
        self._keep()
        core.stopped = 0
        while left:
            left -= 1
            core.step()
            if self.map.touched != touched or core.stopped or core.cycles >= target:
                return False
            if core.pc == pc and self._is_as_kept():
                self.idle = True
                self.pass_cycles = core.cycles - cycles
                self.pass_instructions = core.instructions - instructions
                self.pass_reads = self.map.reads != reads
                # not beyond `target`: the pass under way sees what arrives then
                if not self.waits[self._flash_place(pc)] and core.cycles + self.pass_cycles <= target:
                    self._learn(self.pass_instructions)
                return True
        return False

    @cython.cfunc
    @cython.exceptval(check=False)
    def _flash_place(self, pc: cython.longlong) -> cython.longlong:
        """The word of flash of an instruction; 0 for one in RAM."""
        place: cython.longlong = pc - self.core.flash_base
        return place >> 2 if 0 <= place < self.core.flash_size else 0

    def _learn(self, instructions) -> None:
        """Execute another pass, and note where the program is when it waits."""
        core: Core = self.core
        for _ in range(instructions):
            self.waits[self._flash_place(core.pc)] = 1
            core.step()

    @cython.cfunc
    def _keep(self) -> cython.void:
        """Keep registers and RAM as they are; RAM by the parts that were written since it was kept last."""
        core: Core = self.core
        ram: cython.longlong[::1] = core.ram
        part: cython.longlong
        i: cython.longlong
        core.state_into(self.kept_registers)
        for part in range(len(core.written)):
            if core.written[part]:
                core.written[part] = 0
                for i in range(part * PART_WORDS, min((part + 1) * PART_WORDS, len(ram))):
                    self.kept_ram[i] = ram[i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def _is_as_kept(self) -> cython.bint:
        """True when registers and RAM are as they were kept."""
        core: Core = self.core
        ram: cython.longlong[::1] = core.ram
        part: cython.longlong
        i: cython.longlong
        if core.r[13] != self.kept_registers[13] or core.r[14] != self.kept_registers[14]:
            return False
        core.state_into(self.now_registers)
        for i in range(STATE):
            if self.now_registers[i] != self.kept_registers[i]:
                return False
        for part in range(len(core.written)):
            if core.written[part]:
                for i in range(part * PART_WORDS, min((part + 1) * PART_WORDS, len(ram))):
                    if ram[i] != self.kept_ram[i]:
                        return False
        return True

    @cython.cfunc
    def _catch_up(self, time: cython.longlong) -> cython.int:
        """Repeat the loop of a waiting processor as often as it fits until `time` (ns), and begin it once more."""
        core: Core = self.core
        target: cython.longlong
        passes: cython.longlong
        i: cython.longlong
        if not self.idle:
            return 0
        self.idle = False
        target = self.cycles_at(time)
        passes = (target - core.cycles) // self.pass_cycles
        if passes > 0:
            for i in range(2):
                if core.ready[i] > core.cycles:
                    core.ready[i] += passes * self.pass_cycles
            core.cycles += passes * self.pass_cycles
            core.instructions += passes * self.pass_instructions
            self.idle_cycles += passes * self.pass_cycles
            self.idle_instructions += passes * self.pass_instructions
        self.stop_time = self.running_to = time
        if core.cycles < target:
            core.run(target)
        return 0

    @cython.cfunc
    def _wake(self, time: cython.longlong) -> cython.int:
        """A processor in idle mode goes on at `time` (ns): an interrupt asks for it."""
        cycles: cython.longlong = self.cycles_at(time)
        self.asleep = False
        if cycles > self.core.cycles:
            self.idle_cycles += cycles - self.core.cycles
            self.core.cycles = cycles
        return 0

    @cython.cfunc
    def _take_in(self, time: cython.longlong) -> cython.int:
        """Handle the first input at `time` (ns): edges before messages before alarms."""
        vic: VicBlock = self.vic_block
        inbox: EventQueue = self.inbox
        line: EdgeLine
        block: Block
        level: cython.longlong
        if self.idle and self.pass_reads:
            self._catch_up(time)  # the loop reads devices: they are as they were until now
        self.input_time = self.now = time
        if self.edge_time == time:
            line = self.first_line if self.first_line.next_time == time else self.second_line
            level = line.levels >> 1
            self.pins[line.pin] = level
            self.pins[line.partner_pin] = line.levels & 1
            line.buffer.read += 1
            line.find_next()
            self.edge_time = min(self.first_line.next_time, self.second_line.next_time)
            self.pin_select.on_pin(line.pin, level, time)
        elif inbox.head_time == time:
            inbox.take()
            self._message(inbox)
        else:
            cython.cast(Alarm, self.alarms[self.alarm_places[self.alarms_set - 1]]).ring(time)
        if self.slot_match.match_time > self.slot_begin:
            self._begin_slot(self.slot_match.match_time)
        for each in self.asking:
            block = each
            vic.raw = vic.raw & ~block.mask | block.requests()
        vic.settle()
        if vic.lines:
            self._catch_up(time)
            if self.asleep:
                self._wake(time)
        self.core.lines = vic.lines
        return 0

    @cython.cfunc
    def _message(self, queue: EventQueue) -> cython.int:
        """The message just taken."""
        if queue.kind == PIN_EDGE:
            self.pins[queue.a] = queue.b
            if queue.c >= 0:
                self.pins[queue.c] = queue.d
            if self.followers[queue.a] is not None:
                cython.cast(Peripheral, self.followers[queue.a]).on_level(queue.a, queue.b)
            self.pin_select.on_pin(queue.a, queue.b, queue.time)
        elif 0 <= queue.kind < MESSAGE_KINDS and 0 <= queue.a < INDICES_PER_KIND:
            if queue.kind != CAN_RX or self.acceptance.mode != AFMR_OFF:
                cython.cast(Peripheral, self.message_table[queue.a * MESSAGE_KINDS + queue.kind]).on_message(queue)
        else:
            self.others.on_message(queue)
        return 0

    # --- what the caller that passes time asks ---------------------------------------------------------------

    def earliest_transmit_ns(self) -> cython.longlong:
        """Earliest time (ns) at which the board can send on a bus, unless input arrives."""
        return self.next_time

    def quiet_until(self) -> cython.longlong:
        """Earliest time (ns) of any output: a handler may answer every input at once."""
        return 0

    def stop_at(self, time: cython.longlong) -> cython.longlong:
        """While it runs: run no further than to `time` (ns), which is later than now. Returns where it stops."""
        if time < self.horizon:
            self.horizon = time
            if time < self.stop_time:
                self.stop_time = time
        return self.horizon

    # --- inspection ---------------------------------------------------------------------------------------

    def catch_up(self) -> None:
        """Bring the processor to the time up to which the board has run: a waiting loop is only noted."""
        self._catch_up(self.horizon)

    def counters(self) -> object:
        """The board's counters, by name. Its program's own queues and slots are not known."""
        return ImageCounters(
            hz=self.hz,
            unclaimed=self.unclaimed,
            slots=self.slot_counters(),
            can=self.can_counters(),
            processor=self.processor_counters(),
        )

    def latest_slot(self) -> cython.longlong:
        """Start of its latest slot (ns); 0 before the first."""
        return self.slot_begin if self.slots_begun else 0

    @cython.ccall
    def slot_counters(self) -> SlotCounters:
        """Its slots: only its program knows whether one was left unfinished, or tasks were dropped."""
        return SlotCounters(
            count=self.slots_begun,
            latest_ns=self.latest_slot(),
            finished_ns=self.worked_until,
            overruns=0,
            dropped_tasks=0,
            near_limits=self.slots_by_cycles[18] + self.slots_by_cycles[19],
            max_cycles=self.most_cycles,
            total_cycles=self.all_cycles,
            histogram=list(self.slots_by_cycles),
            slot_ns=self.slot_match.period_ns,
        )

    def processor_counters(self) -> ProcessorCounters:
        """What its processor did up to now."""
        self.catch_up()
        core: Core = self.core
        return ProcessorCounters(core.instructions, core.cycles, self.idle_instructions, self.idle_cycles)

    def can_counters(self) -> list:
        """Counters of each controller that the program has taken out of reset mode."""
        return [
            CanCounters(
                block.number,
                block.can.received,
                block.can.sent,
                block.can.data_overruns,
                receive_lost=0,
                queue_full=block.can.refused,
            )
            for block in self.can_blocks
            if block.set_up
        ]
