"""The ARM7TDMI by known answers: exceptions, both states, odd addresses, user registers, cycles, faults."""

import pytest

from ranger_sim.firmware_sim.arm7.core import FIQ_LINE, IRQ_LINE, BusFault, Core, ProcessorError
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.arm7.against_unicorn import CODE, DATA, LENGTH, Generator

RAM = 0x40000000
SUPERVISOR, SYSTEM, USER = 0xD3, 0xDF, 0x10


def core(*operations, at=RAM, **options):
    """A core that is about to execute these words of ARM code."""
    made = Core(**options)
    made.place(at, b"".join(op.to_bytes(4, "little") for op in operations))
    made.pc = at
    return made


def half_words(made, at, *operations):
    made.place(at, b"".join(op.to_bytes(2, "little") for op in operations))


@pytest.mark.parametrize(
    "operation", [0xE7F000F0, 0xEE010F10, 0xEC410F00, 0xE16F0F11], ids=["udf", "mcr", "ldc", "clz"]
)
def test_what_the_processor_does_not_have_is_taken_as_undefined(operation):
    made = core(operation)
    made.step()
    assert (made.pc, made.r[14], made.cpsr(), made.spsr()) == (4, RAM + 4, 0xDB, SUPERVISOR)


def test_a_software_interrupt_enters_supervisor_mode_and_movs_returns_from_it():
    made = core(0xEF000011)  # swi 0x11
    made.place(8, (0xE1B0F00E).to_bytes(4, "little"))  # movs pc, lr
    made.set_cpsr(0x60000000 | USER)
    made.r[14] = 7
    made.step()
    assert (made.pc, made.r[14], made.cpsr(), made.spsr()) == (8, RAM + 4, 0x60000093, 0x60000010)
    made.step()
    assert (made.pc, made.r[14], made.cpsr()) == (RAM + 4, 7, 0x60000010)


def test_the_fast_interrupt_comes_before_the_other_and_has_its_own_registers():
    made = core(0xE1A00000, 0xE1A00000)
    made.set_cpsr(SYSTEM & 0x1F)
    made.r[8], made.r[13] = 88, 1313
    made.lines = IRQ_LINE | FIQ_LINE
    made.place(0x1C, (0xE3A08001).to_bytes(4, "little"))  # mov r8, #1
    made.step()
    assert (made.r[8], made.r[14], made.cpsr(), made.pc) == (1, RAM + 4, 0xD1, 0x20)
    made.set_cpsr(made.spsr())
    assert (made.r[8], made.r[13]) == (88, 1313)
    made.pc, made.lines = RAM, IRQ_LINE
    made.place(0x18, (0xE25EF004).to_bytes(4, "little"))  # subs pc, lr, #4
    made.step()
    assert (made.pc, made.cpsr()) == (RAM, 0x1F)


def test_interrupts_that_are_off_wait():
    made = core(0xE1A00000)
    made.lines = IRQ_LINE | FIQ_LINE
    made.step()
    assert (made.pc, made.cpsr()) == (RAM + 4, SUPERVISOR)


def test_an_access_to_an_empty_address_is_reported_with_the_program_counter():
    made = core(0xE5910000)  # ldr r0, [r1]
    made.r[1] = 0xE0004000
    with pytest.raises(BusFault, match="read from an address where nothing is: 0xe0004000, 4 bytes, at pc 0x40000000"):
        made.step()
    made = core(0xE5C10000)  # strb r0, [r1]
    with pytest.raises(BusFault, match="write to flash: 0x00000000, 1 bytes, at pc 0x40000000"):
        made.step()


def test_with_aborts_the_program_gets_them_its_base_is_updated_and_nothing_loaded():
    made = core(0xE5B10004)  # ldr r0, [r1, #4]!
    made.takes_aborts = True
    made.r[0], made.r[1] = 5, 0x80000000
    made.step()
    assert (made.pc, made.r[14], made.r[0], made.r[1], made.cpsr()) == (0x10, RAM + 8, 5, 0x80000004, 0xD7)
    assert made.fault_address == 0x80000004
    made.pc = 0x80000000
    made.step()
    assert (made.pc, made.r[14]) == (0x0C, 0x80000004)


def test_loads_from_odd_addresses_rotate():
    made = core(0xE5910000, 0xE1D120B0, 0xE1D130F0)  # ldr r0, [r1]; ldrh r2, [r1]; ldrsh r3, [r1]
    made.place(RAM + 0x100, bytes((0x11, 0x92, 0x33, 0x44)))
    made.r[1] = RAM + 0x101
    for _ in range(3):
        made.step()
    assert (made.r[0], made.r[2], made.r[3]) == (0x11443392, 0x11000092, 0xFFFFFF92)


def test_the_program_counter_is_stored_twelve_bytes_on_and_read_eight():
    made = core(0xE581F000, 0xE1A0200F, 0xE1A0331F)  # str pc, [r1]; mov r2, pc; mov r3, pc, lsl r3
    made.r[1] = RAM + 0x100
    made.r[3] = 0
    for _ in range(3):
        made.step()
    assert (made.peek(RAM + 0x100), made.r[2], made.r[3]) == (RAM + 12, RAM + 12, RAM + 20)


def test_ldm_with_a_hat_loads_user_registers_and_with_the_program_counter_returns():
    made = core(0xE8D16000, 0xE8D18001)  # ldmia r1, {sp, lr}^; ldmia r1, {r0, pc}^
    made.place(RAM + 0x100, (RAM + 0x200).to_bytes(4, "little") + (RAM + 0x300).to_bytes(4, "little"))
    made.r[1], made.r[13], made.r[14] = RAM + 0x100, 1, 2
    made.set_spsr(0x80000010)
    made.step()
    assert (made.r[13], made.r[14]) == (1, 2)
    made.step()
    assert (made.pc, made.cpsr()) == (RAM + 0x300, 0x80000010)
    assert (made.r[0], made.r[13], made.r[14]) == (RAM + 0x200, RAM + 0x200, RAM + 0x300)


def test_a_base_lowest_in_the_list_is_stored_as_it_was_and_else_as_it_becomes():
    made = core(0xE8A10006, 0xE8A30006 | 8)  # stmia r1!, {r1, r2}; stmia r3!, {r1, r2, r3}
    made.r[1], made.r[2], made.r[3] = RAM + 0x100, 22, RAM + 0x200
    made.step()
    made.step()
    assert (made.peek(RAM + 0x100), made.peek(RAM + 0x104), made.r[1]) == (RAM + 0x100, 22, RAM + 0x108)
    assert made.peek(RAM + 0x208) == RAM + 0x20C


def test_bx_changes_the_state_and_pop_and_loads_of_the_program_counter_do_not():
    made = core(0xE12FFF11)  # bx r1
    made.r[1], made.r[13] = RAM + 0x101, RAM + 0x200
    # push {lr}; bl +4 (two halves); pop {pc} in between; bx lr
    half_words(made, RAM + 0x100, 0xB500, 0xF000, 0xF801, 0xBD00, 0x4770)
    made.r[14] = RAM + 0x300
    for expected in (0x100, 0x102, 0x104, 0x108, 0x106, 0x300):
        made.step()
        assert made.pc == RAM + expected
    assert made.cpsr() & 0x20
    half_words(made, RAM + 0x300, 0x4778)  # bx pc
    made.step()
    assert (made.pc, made.cpsr() & 0x20) == (RAM + 0x304, 0)


def test_user_mode_changes_its_flags_and_nothing_else_of_its_status():
    made = core(0xE129F000)  # msr cpsr_fc, r0
    made.set_cpsr(USER)
    made.r[0] = 0xF00000D3
    made.step()
    assert made.cpsr() == 0xF0000010


def test_an_unknown_mode_is_reported():
    made = core(0xE121F000)  # msr cpsr_c, r0
    with pytest.raises(UserError, match="mode 0x00 set at pc 0x40000000: there is no such mode"):
        made.step()


# r0 counts down: subs r0, r0, #1; bne to it.
LOOP = (0xE3A00064, 0xE2500001, 0x1AFFFFFD)


def test_a_run_ends_at_its_cycle_and_goes_on_the_same_in_pieces():
    whole, pieces = core(*LOOP, 0xEAFFFFFB), core(*LOOP, 0xEAFFFFFB)
    whole.run(5000)
    for until in range(0, 5001, 7):
        pieces.run(until)
    pieces.run(5000)
    assert (whole.cycles, whole.pc, list(whole.r)) == (pieces.cycles, pieces.pc, list(pieces.r))


class Port:
    """One register at 0xE0000000."""

    def __init__(self):
        self.log = []

    def read(self, address, size):
        if address != 0xE0000000:
            raise LookupError
        return 0x5A

    def write(self, address, size, value):
        if address != 0xE0000000:
            raise LookupError
        self.log.append((size, value))


def test_a_device_is_asked_for_what_is_neither_flash_nor_ram():
    port = Port()
    made = core(0xE5910000, 0xE5C10000, 0xE1C120B0, 0xE5910004, device=port)
    made.r[1], made.r[2] = 0xE0000000, 0x12345678
    for _ in range(3):
        made.step()
    assert made.r[0] == 0x5A
    assert port.log == [(1, 0x5A), (2, 0x5678)]
    with pytest.raises(BusFault, match="0xe0000004"):
        made.step()


def test_memory_that_cannot_be_is_one_line():
    with pytest.raises(UserError, match="RAM of 6 bytes: must be a whole number of words"):
        Core(ram_size=6)
    with pytest.raises(UserError, match="8 bytes at 0x4000fffc fit neither flash"):
        Core().place(0x4000FFFC, bytes(8))
    with pytest.raises(UserError, match="MAM mode 3 of 4 clocks"):
        Core().set_mam(3, 4)


def test_the_same_place_in_flash_is_another_instruction_in_the_other_state_and_after_it_was_written():
    made = Core()
    made.place(0x100, (0x2001_2002).to_bytes(4, "little"))  # movs r0, #2; movs r0, #1; in ARM state: andcs r2, r1, r2
    made.r[1], made.r[2] = 0xF, 0x3A
    made.set_cpsr(SYSTEM & 0x1F | 0x20)
    made.pc = 0x100
    made.step()
    assert (made.r[0], made.pc) == (2, 0x102)
    made.set_cpsr(SYSTEM & 0x1F | 0x20000000)
    made.pc = 0x100
    made.step()
    assert (made.r[0], made.r[2], made.pc) == (2, 0xA, 0x104)
    made.set_cpsr(SYSTEM & 0x1F | 0x20)
    made.pc = 0x100
    made.step()
    assert (made.r[0], made.pc) == (2, 0x102)
    half_words(made, 0x100, 0x2007)  # movs r0, #7
    made.pc = 0x100
    made.step()
    made.step()
    assert (made.r[0], made.pc) == (1, 0x104)
    assert made.instructions == 5


@pytest.mark.parametrize("thumb", [False, True], ids=["arm", "thumb"])
def test_random_code_in_flash_run_in_one_go_does_what_it_does_in_ram_step_by_step(thumb):
    generator = Generator(20)
    make = generator.thumb if thumb else generator.arm
    width = 2 if thumb else 4
    compared = 0
    for _ in range(100):
        pool = b"" if thumb else b"".join((CODE + 4 * i).to_bytes(4, "little") for i in range(LENGTH + 1))
        code = b"".join(make(LENGTH - i).to_bytes(width, "little") for i in range(LENGTH)) + pool
        code += generator.random.randbytes(256 * 4)
        registers = [generator.random.getrandbits(32) for _ in range(15)]
        registers[4:7] = DATA, DATA + 0x1000, 4 * generator.random.randrange(32)
        stepped = Core(ram_base=CODE, ram_size=0x10000)
        run = Core(flash_base=CODE, flash_size=0x4000, ram_base=CODE + 0x4000, ram_size=0xC000)
        for each in (stepped, run):
            each.place(CODE, code)
            for i, value in enumerate(registers):
                each.r[i] = value
            each.set_cpsr(SYSTEM | (0x20 if thumb else 0))
            each.pc = CODE
        try:
            while CODE <= stepped.pc < CODE + LENGTH * width:
                stepped.step()
        except ProcessorError:  # a mode that does not exist, where Unicorn's saved status would be
            continue
        while run.instructions < stepped.instructions:
            run.run(run.cycles + 1 + (stepped.instructions - run.instructions) // 2)
        assert (list(run.r)[:15], run.cpsr(), run.pc) == (list(stepped.r)[:15], stepped.cpsr(), stepped.pc)
        assert list(run.ram) == list(stepped.ram)[0x1000:]
        compared += 1
    assert compared > 60
