cimport cython

from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.arm7.core cimport FAST, INTERRUPT, STATE, Core
from ranger_sim.firmware_sim.edge_line cimport EdgeLine
from ranger_sim.firmware_sim.lpc2194.address_map cimport AddressMap
from ranger_sim.firmware_sim.lpc2194.block cimport Block, Clocks
from ranger_sim.firmware_sim.lpc2194.can cimport AFMR_BYPASS, CanFilterBlock
from ranger_sim.firmware_sim.lpc2194.converter cimport ConverterBlock
from ranger_sim.firmware_sim.lpc2194.pins cimport PinSelectBlock
from ranger_sim.firmware_sim.lpc2194.system cimport SystemBlock
from ranger_sim.firmware_sim.lpc2194.timer cimport ProgrammedTimer
from ranger_sim.firmware_sim.lpc2194.vic cimport VicBlock
from ranger_sim.firmware_sim.microcontroller cimport INDICES_PER_KIND, MESSAGE_KINDS, Microcontroller
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.peripherals.ssp cimport SspDevice
from ranger_sim.foundation.events cimport CAN_RX, NEVER, PIN_EDGE, EventQueue

cpdef enum:
    STINT = 256
    LONGEST_PASS = 600
    DOUBTS = 8
    SLOT_SHARES = 20
    PART_WORDS = 64

cdef class ImageBoard(Microcontroller):
    cdef public Core core
    cdef public AddressMap map
    cdef public VicBlock vic_block
    cdef public SystemBlock system
    cdef public PinSelectBlock pin_select
    cdef public ConverterBlock converter
    cdef public CanFilterBlock acceptance
    cdef public list can_blocks, asking
    cdef public object image
    cdef public Clocks clocks
    cdef public bint skips_idle, asleep, idle, pass_looks
    cdef public long long base_cycles, base_ns, running_to
    cdef public ProgrammedTimer slot_match
    cdef public long long slots_begun, slot_begin, worked_until, most_cycles, all_cycles
    cdef public long long[21] slots_by_cycles
    cdef public long long pass_cycles, pass_instructions, idle_cycles, idle_instructions, doubts
    cdef public long long[::1] kept_registers, now_registers, kept_ram
    cdef public long long[::1] waits
    cpdef long long time_of(self, long long cycles) except? <long long>-1
    cdef long long cycles_at(self, long long time) except? <long long>-1
    cpdef object set_clocks(self, cclk, divider)
    cpdef object sleep(self)
    cdef void reach(self)
    cdef void work(self) noexcept
    cdef void _begin_slot(self, long long time) noexcept
    cpdef object slot_counters(self)
    cdef int settle(self, Block block) except -1
    cdef int _run(self, long long stop) except -1
    cdef bint _may_wait(self) noexcept
    cdef bint _waits(self, long long target) except? -1
    cdef long long _flash_place(self, long long pc) noexcept
    cdef void _keep(self) noexcept
    cdef bint _is_as_kept(self) noexcept
    cdef int _catch_up(self, long long time) except -1
    cdef int _wake(self, long long time) except -1
    cdef int _take_in(self, long long time) except -1
    cdef int _message(self, EventQueue queue) except -1
