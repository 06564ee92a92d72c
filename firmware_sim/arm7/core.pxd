cimport cython

cpdef enum:
    WRITTEN_BITS = 8
    USER = 0x10
    FAST = 0x11
    INTERRUPT = 0x12
    SUPERVISOR = 0x13
    ABORT = 0x17
    UNDEFINED = 0x1B
    SYSTEM = 0x1F
    IRQ_LINE = 1
    FIQ_LINE = 2
    STATE = 53
    LOOK_CYCLES = 60_000

cdef long long _MASK
cdef long long _SIGN
cdef long long _STATUS

cdef class Device:
    cpdef long long read(self, long long address, long long size) except? <long long>-1
    cpdef int write(self, long long address, long long size, long long value) except -1

@cython.final
cdef class Core:
    cdef public long long pc, following, cycles, began, instructions
    cdef public long long n, z, c, v, carry, control, lines, faulted, stopped
    cdef public long long flash_base, flash_size, ram_base, ram_size
    cdef public long long line, data_line, mam_mode, mam_timing, device_waits, bridge_base
    cdef public long long cycles_per_instruction
    cdef public long long[::1] trail, ahead, ready
    cdef public long long ram_open, flash_open
    cdef public bint takes_aborts, armed
    cdef public object debugger, hit
    cdef public set points
    cdef public tuple watches
    cdef public long long stepping, passing, return_pc, return_mode, next_look
    cdef public long long fault_address
    cdef public long long[::1] r, high, banked, saved
    cdef public long long[::1] flash, ram
    cdef public object device
    cdef public Device bridge
    cdef public long long[::1] written
    cdef public str name

    cpdef long long cpsr(self) noexcept
    cdef long long bank(self, long long mode) noexcept
    cpdef int set_cpsr(self, long long value) except -1
    @cython.locals(old=cython.longlong, new=cython.longlong, i=cython.longlong)
    cdef int switch_mode(self, long long mode) except -1
    @cython.locals(before=cython.longlong)
    cdef int enter(self, long long mode, long long vector, long long back) except -1
    cdef int undefined(self) except -1
    @cython.locals(begun=cython.longlong, bank=cython.longlong)
    cdef int fetch_line(self, long long line) noexcept
    cdef int read_flash(self, long long line) noexcept
    @cython.locals(place=cython.longlong, value=cython.longlong)
    cdef long long load(self, long long address, long long size) except? <long long>-1
    @cython.locals(value=cython.longlong)
    cdef long long load_elsewhere(self, long long address, long long size) except? <long long>-1
    cdef int store_elsewhere(self, long long address, long long size, long long value) except -1
    @cython.locals(place=cython.longlong, moved=cython.longlong, mask=cython.longlong)
    cdef int store(self, long long address, long long size, long long value) except -1
    cdef int nothing(self, long long address, long long size, bint writing) except -1
    @cython.locals(value=cython.longlong, turn=cython.longlong)
    cdef long long load_word(self, long long address) except? <long long>-1
    @cython.locals(value=cython.longlong)
    cdef long long load_half(self, long long address, bint signed) except? <long long>-1
    @cython.locals(value=cython.longlong)
    cdef long long load_byte(self, long long address, bint signed) except? <long long>-1
    cdef int jump(self, long long address) noexcept
    cdef bint passes(self, long long condition) noexcept
    @cython.locals(total=cython.longlong, result=cython.longlong)
    cdef long long add(self, long long a, long long b, long long carry) noexcept
    cdef int mark(self, long long result) noexcept
    cdef long long shift(self, long long kind, long long value, long long amount) noexcept
    cdef long long shift_fixed(self, long long kind, long long value, long long amount) noexcept
    cdef int multiplier_cycles(self, long long value, bint signed) noexcept
    cpdef int run(self, long long until) except -1
    @cython.locals(count=cython.longlong)
    cpdef int step(self) except -1
    cdef int run_debugged(self, long long until) except -1
    @cython.locals(pc=cython.longlong, mode=cython.longlong)
    cdef int debugged(self) except -1
    cdef bint is_memory(self, long long address) noexcept
    cdef int open_memory(self) noexcept
    cdef int close_memory(self) noexcept
    cdef int look_for_watch(self, long long address, long long size, long long kind) except -1
    cpdef int state_into(self, long long[::1] into) except -1
    @cython.locals(pc=cython.longlong, place=cython.longlong, op=cython.longlong)
    cdef int one(self) except -1
    cdef int interrupt(self) except -1
    @cython.locals(group=cython.longlong, offset=cython.longlong)
    cdef int arm(self, long long op) except -1
    @cython.locals(a=cython.longlong, b=cython.longlong, result=cython.longlong, rd=cython.longlong,
                   code=cython.longlong, turn=cython.longlong, writes=cython.bint)
    cdef int data(self, long long op) except -1
    @cython.locals(value=cython.longlong, mask=cython.longlong, turn=cython.longlong)
    cdef int status(self, long long op) except -1
    @cython.locals(a=cython.longlong, b=cython.longlong, low=cython.longlong, top=cython.longlong,
                   product=cython.longlong, rd=cython.longlong, rn=cython.longlong, kind=cython.longlong)
    cdef int multiply(self, long long op) except -1
    @cython.locals(address=cython.longlong, value=cython.longlong)
    cdef int swap(self, long long op) except -1
    @cython.locals(base=cython.longlong, offset=cython.longlong, address=cython.longlong, moved=cython.longlong,
                   value=cython.longlong, rd=cython.longlong, rn=cython.longlong, kind=cython.longlong)
    cdef int transfer(self, long long op) except -1
    cdef int finish_load(self, long long rd, long long value) except -1
    @cython.locals(base=cython.longlong, address=cython.longlong, last=cython.longlong, value=cython.longlong,
                   rn=cython.longlong, i=cython.longlong, count=cython.longlong, chosen=cython.longlong,
                   first=cython.bint, user=cython.bint)
    cdef int block(self, long long op) except -1
    cdef long long get_user(self, long long i) noexcept
    cdef int set_user(self, long long i, long long value) noexcept
    @cython.locals(rd=cython.longlong, rs=cython.longlong, a=cython.longlong, b=cython.longlong, kind=cython.longlong,
                   address=cython.longlong, result=cython.longlong)
    cdef int thumb(self, long long op) except -1
    @cython.locals(rd=cython.longlong, a=cython.longlong, b=cython.longlong, code=cython.longlong,
                   result=cython.longlong)
    cdef int thumb_register(self, long long op) except -1
    @cython.locals(address=cython.longlong, rd=cython.longlong, kind=cython.longlong)
    cdef int thumb_transfer(self, long long op) except -1
