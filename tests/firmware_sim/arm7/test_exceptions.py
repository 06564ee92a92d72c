"""Exceptions, banked registers, status registers and odd addresses by known answers.

Source: ARM Architecture Reference Manual (DDI 0100), A2.6 (exceptions), A2.4 (registers), A2.5 (status registers),
A2.8 (odd addresses before ARMv6), A4 (instructions by name); for what it leaves open, the ARM7TDMI data sheet
(DDI 0029E).
"""

import pytest

from ranger_sim.firmware_sim.arm7.core import FIQ_LINE, IRQ_LINE, Core
from ranger_sim.foundation.user_error import UserError

RAM = 0x40000000
DATA = RAM + 0x100
USER, FAST, INTERRUPT, SUPERVISOR, ABORT, UNDEFINED, SYSTEM = 0x10, 0x11, 0x12, 0x13, 0x17, 0x1B, 0x1F
WITH_SPSR = (FAST, INTERRUPT, SUPERVISOR, ABORT, UNDEFINED)
THUMB = 0x20


def core(*operations, width=4):
    made = Core()
    made.place(RAM, b"".join(op.to_bytes(width, "little") for op in operations))
    made.pc = RAM
    return made


# what: operation in ARM and in Thumb state, vector, mode after it, return address from the instruction's (ARM, Thumb),
# and whether it shuts FIQ out (A2.6)
ENTRIES = {
    "undefined": (0xE7F000F0, 0xDE00, 0x04, UNDEFINED, (4, 2), False),
    "swi": (0xEF000000, 0xDF00, 0x08, SUPERVISOR, (4, 2), False),
    "prefetch abort": (None, None, 0x0C, ABORT, (4, 4), False),
    "data abort": (0xE5910000, 0x6808, 0x10, ABORT, (8, 8), False),
    "irq": (0xE1A00000, 0x46C0, 0x18, INTERRUPT, (4, 4), False),
    "fiq": (0xE1A00000, 0x46C0, 0x1C, FAST, (4, 4), True),
}


@pytest.mark.parametrize("state", [0, THUMB])
@pytest.mark.parametrize("what", ENTRIES)
def test_an_exception_saves_status_and_return_address_and_goes_on_at_its_vector_in_arm_state(what, state):
    arm, thumb, vector, mode, back, shuts_fast = ENTRIES[what]
    at = RAM if arm else 0x50000000
    made = core(*([thumb] if state else [arm]) if arm else [0], width=2 if state else 4)
    made.takes_aborts = True
    made.set_cpsr(0xA0000000 | SYSTEM | state)
    made.r[1] = 0x60000000  # nothing is there
    made.r[13], made.r[14] = 1313, 1414
    made.pc = at
    if what in ("irq", "fiq"):
        made.lines = FIQ_LINE if what == "fiq" else IRQ_LINE
        made.run(1)
    else:
        made.step()
    assert made.pc == vector
    assert made.cpsr() == 0xA0000080 | mode | (0x40 if shuts_fast else 0)  # flags stay, T is clear, I is set
    assert made.spsr() == 0xA0000000 | SYSTEM | state
    assert made.r[14] == at + back[1 if state else 0]
    made.set_cpsr(SYSTEM)
    assert (made.r[13], made.r[14]) == (1313, 1414)


# the return of each (A2.6): subs pc, lr, #n, or movs pc, lr; what comes next, from the instruction that caused it
RETURNS = {
    "undefined": (0xE1B0F00E, (4, 2)),
    "swi": (0xE1B0F00E, (4, 2)),
    "prefetch abort": (0xE25EF004, (0, 0)),
    "data abort": (0xE25EF008, (0, 0)),
    "irq": (0xE25EF004, (0, 0)),
    "fiq": (0xE25EF004, (0, 0)),
}


@pytest.mark.parametrize("state", [0, THUMB])
@pytest.mark.parametrize("what", RETURNS)
def test_the_return_of_each_exception_restores_status_state_and_place(what, state):
    operation, after = RETURNS[what]
    arm, thumb, vector, *_ = ENTRIES[what]
    at = RAM if arm else 0x50000000
    made = core(*([thumb] if state else [arm]) if arm else [0], width=2 if state else 4)
    made.place(vector, operation.to_bytes(4, "little"))
    made.takes_aborts = True
    made.set_cpsr(0x60000000 | USER | state)
    made.r[1], made.pc = 0x60000000, at
    if what in ("irq", "fiq"):
        made.lines = FIQ_LINE if what == "fiq" else IRQ_LINE
        made.run(1)
        made.lines = 0
    else:
        made.step()
    made.step()
    assert (made.pc, made.cpsr()) == (at + after[1 if state else 0], 0x60000000 | USER | state)


def test_an_abort_comes_before_a_fast_interrupt_which_then_returns_to_the_abort_s_vector():
    """A2.6, priorities: data abort has priority over FIQ, so that the abort is not lost."""
    made = core(0xE5910000)
    made.takes_aborts = True
    made.set_cpsr(SYSTEM)
    made.r[1] = 0x60000000
    made.step()
    made.lines = FIQ_LINE
    made.run(made.cycles + 1)
    assert (made.pc, made.r[14], made.spsr() & 0x1F) == (0x1C, 0x10 + 4, ABORT)


def test_each_mode_has_its_own_stack_pointer_and_link_and_fiq_five_registers_more():
    made = Core()
    for mode in (SYSTEM, *WITH_SPSR):
        made.set_cpsr(mode)
        for i in range(15):
            made.r[i] = mode << 8 | i
    for mode in (SYSTEM, *WITH_SPSR):
        made.set_cpsr(mode)
        assert [made.r[13], made.r[14]] == [mode << 8 | 13, mode << 8 | 14]
        assert list(made.r[:8]) == [UNDEFINED << 8 | i for i in range(8)]
        last = FAST if mode == FAST else UNDEFINED
        assert list(made.r[8:13]) == [last << 8 | i for i in range(8, 13)]
    made.set_cpsr(USER)
    assert made.r[13] == SYSTEM << 8 | 13  # user and system mode share all


@pytest.mark.parametrize("mode", WITH_SPSR)
def test_stm_with_a_hat_stores_and_ldm_with_a_hat_loads_user_registers_from_every_mode(mode):
    made = core(0xE8C07F00, 0xE8D17F00)  # stmia r0, {r8 - lr}^; ldmia r1, {r8 - lr}^
    made.set_cpsr(SYSTEM)
    made.r[0], made.r[1] = DATA, DATA + 0x40
    made.place(DATA + 0x40, b"".join((900 + i).to_bytes(4, "little") for i in range(7)))
    for i in range(8, 15):
        made.r[i] = i
    made.set_cpsr(0xC0 | mode)
    own = [13, 14] if mode != FAST else range(8, 15)
    for i in own:
        made.r[i] = 100 + i
    made.step()
    assert [made.peek(DATA + 4 * i) for i in range(7)] == list(range(8, 15))
    made.step()
    assert [made.r[i] for i in own] == [100 + i for i in own]
    made.set_cpsr(SYSTEM)
    assert [made.r[i] for i in range(8, 15)] == list(range(900, 907))


def test_stm_with_a_hat_of_the_program_counter_stores_it_twelve_bytes_on():
    made = core(0xE8C08001)  # stmia r0, {r0, pc}^
    made.r[0] = DATA
    made.step()
    assert (made.peek(DATA), made.peek(DATA + 4)) == (DATA, RAM + 12)


def test_ldm_with_a_hat_and_the_program_counter_returns_to_thumb():
    made = core(0xE8FD8003)  # ldmia sp!, {r0, r1, pc}^
    made.place(DATA, b"".join(v.to_bytes(4, "little") for v in (1, 2, RAM + 0x203)))
    made.set_cpsr(0xC0 | INTERRUPT)
    made.set_spsr(0x40000000 | THUMB | USER)
    made.r[13] = DATA
    made.step()
    # bit 0 of what is loaded is dropped in Thumb state: the state comes from the status
    assert (made.pc, made.cpsr(), made.r[0], made.r[1]) == (RAM + 0x202, 0x40000030, 1, 2)
    made.set_cpsr(INTERRUPT)
    assert made.r[13] == DATA + 12


@pytest.mark.parametrize("spsr", [False, True])
@pytest.mark.parametrize(
    ("fields", "mask"),
    [(1, 0x000000FF), (2, 0), (4, 0), (8, 0xF0000000), (9, 0xF00000FF), (15, 0xF00000FF)],
    ids=["c", "x", "s", "f", "fc", "fsxc"],
)
def test_msr_writes_the_twelve_bits_that_a_status_register_has_field_by_field(spsr, fields, mask):
    """DDI 0029E, 3.8: twelve bits are defined; what is written to others is not kept, they read as zero."""
    made = core(0xE120F001 | fields << 16 | spsr << 22, 0xE10F2000 | spsr << 22)  # msr, mrs r2
    made.set_cpsr(0xC0 | SUPERVISOR)
    made.set_spsr(0xFFFFFFC0 | USER)
    before = made.spsr() if spsr else made.cpsr()
    assert before == (0xF00000D0 if spsr else 0xD3)
    made.r[1] = 0x5FFFFF00 | FAST | (THUMB if spsr else 0)
    made.step()
    made.step()
    assert made.r[2] == before & ~mask | made.r[1] & mask
    assert (made.cpsr() & 0x1F == FAST) == (not spsr and fields & 1 == 1)


def test_a_status_that_msr_changes_keeps_its_state_and_that_of_user_mode_its_lower_half():
    made = core(0xE32FF0F0, 0xE32FF000 | 0xF0)  # msr cpsr_fsxc, #0xF0: user mode, T
    made.step()
    assert made.cpsr() == 0xD0  # unpredictable (A4, MSR); ours ignores T
    made.set_cpsr(0x80000000 | USER)
    made.step()
    assert made.cpsr() == USER  # flags only


@pytest.mark.parametrize("mode", [USER, SYSTEM])
def test_modes_without_a_saved_status_read_their_own_and_write_none(mode):
    """Unpredictable (A4, MRS and MSR); ours is here."""
    made = core(0xE14F2000, 0xE16FF001)  # mrs r2, spsr; msr spsr_fsxc, r1
    made.set_cpsr(0x90000000 | mode)
    made.r[1] = 0x60000000 | FAST
    made.step()
    made.step()
    assert (made.r[2], made.cpsr()) == (0x90000000 | mode, 0x90000000 | mode)


WORD = bytes((0x11, 0x92, 0x33, 0xC4))  # at DATA; 0x55667788 after it


@pytest.mark.parametrize(
    ("odd", "ldr", "ldrh", "ldrsh", "swp"),
    [
        (0, 0xC4339211, 0x9211, 0xFFFF9211, 0xC4339211),
        (1, 0x11C43392, 0x11000092, 0xFFFFFF92, 0x11C43392),
        (2, 0x9211C433, 0xC433, 0xFFFFC433, 0x9211C433),
        (3, 0x339211C4, 0x330000C4, 0xFFFFFFC4, 0x339211C4),
    ],
)
def test_odd_addresses_turn_what_is_loaded_as_before_armv6(odd, ldr, ldrh, ldrsh, swp):
    """A word by its odd bytes (A2.8); a half-word on an odd address is unpredictable, the ARM7TDMI turns it by a byte,
    and loads a signed one as the byte that is there."""
    made = core(0xE5912000, 0xE1D130B0, 0xE1D140F0, 0xE1015090)
    made.place(DATA, WORD)
    made.r[0], made.r[1] = 0xA5A5A5A5, DATA + odd
    for _ in range(4):
        made.step()
    assert [made.r[i] for i in (2, 3, 4, 5)] == [ldr, ldrh, ldrsh, swp]
    assert made.peek(DATA) == 0xA5A5A5A5  # swp stores to the word


@pytest.mark.parametrize("odd", [1, 2, 3])
def test_odd_addresses_are_stored_to_the_word_or_half_word_that_holds_them(odd):
    made = core(0xE5810000, 0xE1C120B0, 0xE8810005)  # str r0; strh r2; stmia r1, {r0, r2}
    made.r[0], made.r[1], made.r[2] = 0x12345678, DATA + odd, 0xABCD
    made.step()
    assert made.peek(DATA) == 0x12345678
    made.step()
    assert made.peek(DATA) == (0xABCD5678 if odd > 1 else 0x1234ABCD)
    made.step()
    assert (made.peek(DATA), made.peek(DATA + 4)) == (0x12345678, 0xABCD)


@pytest.mark.parametrize("odd", [1, 2, 3])
def test_ldm_ignores_the_odd_bits_of_its_base_and_keeps_them_in_what_it_writes_back(odd):
    made = core(0xE8B10005)  # ldmia r1!, {r0, r2}
    made.place(DATA, WORD + (0x55667788).to_bytes(4, "little"))
    made.r[1] = DATA + odd
    made.step()
    assert (made.r[0], made.r[2], made.r[1]) == (0xC4339211, 0x55667788, DATA + odd + 8)


def test_thumb_loads_turn_what_is_at_odd_addresses_too():
    made = core(0x6808, 0x880A, 0x5E8B, width=2)  # ldr r0, [r1]; ldrh r2, [r1]; ldrsh r3, [r1, r2]
    made.set_cpsr(THUMB | SYSTEM)
    made.place(DATA, WORD)
    made.r[1] = DATA + 1
    made.step()
    made.step()
    assert (made.r[0], made.r[2]) == (0x11C43392, 0x11000092)
    made.r[2] = 2
    made.step()
    assert made.r[3] == 0xFFFFFFC4


@pytest.mark.parametrize(
    ("operation", "name"),
    [(0xE591F000, "ldr"), (0xE8918000, "ldm"), (0xE791F000, "ldr, register"), (0xE1A0F001, "mov")],
    ids=["ldr", "ldm", "ldr register", "mov"],
)
def test_loads_and_moves_to_the_program_counter_stay_in_arm_state_and_drop_two_bits(operation, name):
    """ARMv4T: only BX changes the state (A4, LDM and LDR)."""
    made = core(operation)
    made.place(DATA, (RAM + 0x203).to_bytes(4, "little"))
    made.r[1] = RAM + 0x203 if name == "mov" else DATA
    made.step()
    assert (made.pc, made.cpsr() & THUMB) == (RAM + 0x200, 0)


# What no compiler emits. The architecture says UNPREDICTABLE; what ours does is written down so that it stays.


@pytest.mark.parametrize(
    ("operation", "written"),
    [(0xE8A00000, 0x40), (0xE9200000, -0x40)],
    ids=["stmia r0!, {}", "stmdb r0!, {}"],
)
def test_an_empty_list_stores_the_program_counter_and_moves_the_base_by_64_bytes(operation, written):
    made = core(operation)
    made.r[0] = DATA
    made.step()
    assert made.r[0] == DATA + written
    assert made.peek(min(DATA, DATA + written)) == RAM + 12


def test_an_empty_list_in_thumb_stores_the_program_counter_six_bytes_on():
    made = core(0xC000, width=2)  # stmia r0!, {}
    made.set_cpsr(THUMB | SYSTEM)
    made.r[0] = DATA
    made.step()
    assert (made.peek(DATA), made.r[0]) == (RAM + 6, DATA + 0x40)


def test_a_base_that_is_loaded_keeps_what_was_loaded():
    made = core(0xE5B11004, 0xE8B20006 | 4)  # ldr r1, [r1, #4]!; ldmia r2!, {r1, r2}
    made.place(DATA + 4, (77).to_bytes(4, "little") + (88).to_bytes(4, "little"))
    made.r[1], made.r[2] = DATA, DATA + 4
    made.step()
    assert made.r[1] == 77
    made.step()
    assert (made.r[1], made.r[2]) == (77, 88)


def test_mul_into_its_own_factor_multiplies_and_a_product_leaves_carry_and_overflow():
    made = core(0xE0100090)  # muls r0, r0, r0
    made.set_cpsr(0x30000000 | SYSTEM)
    made.r[0] = 0x10000
    made.step()
    assert (made.r[0], made.cpsr()) == (0, 0x70000000 | SYSTEM)


def test_a_condition_of_never_does_nothing():
    made = core(0xFAFFFFFE)  # blx in ARMv5
    made.step()
    assert (made.pc, made.cycles) == (RAM + 4, 1)


def test_a_status_with_an_unknown_mode_is_reported_where_it_is_restored():
    made = core(0xE1B0F00E)  # movs pc, lr
    made.set_cpsr(0xC0 | INTERRUPT)  # its saved status was never written
    with pytest.raises(UserError, match="mode 0x00 set at pc 0x40000000: there is no such mode"):
        made.step()
