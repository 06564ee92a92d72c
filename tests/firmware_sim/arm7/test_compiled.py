"""What the cross compiler makes of C gives what the same arithmetic gives in Python; and its cycles per instruction."""

import struct

import pytest

from tests.firmware_sim.arm7 import compiled

pytestmark = pytest.mark.skipif(
    not compiled.is_there(), reason="no cross compiler (apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi)"
)


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    return {state: compiled.Program(tmp_path_factory.mktemp(state), state) for state in ("arm", "thumb")}


def signed(word):
    return word - (word >> 31 << 32)


def rounded(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def scale(x):
    """Each operation in double and rounded: for single operands that is the single result."""
    product = rounded(x * rounded(0.0012345))
    return rounded(rounded(product / rounded(x + 1.75)) - 0.25)


@pytest.mark.parametrize("state", ["arm", "thumb"])
def test_soft_floating_point_gives_every_bit(programs, state):
    for i in range(-40, 40):
        x = rounded(1.37 * i * i * i + 0.01)
        word = compiled.float_bits(x)
        assert programs[state].call("scale", word) == compiled.float_bits(scale(x)), x


@pytest.mark.parametrize("state", ["arm", "thumb"])
def test_a_check_sum_over_a_copied_block_is_the_crc_of_the_block(programs, state):
    for seed in range(3):
        total = 0xFFFF
        for i in range(96):
            total ^= (seed + i * 7 & 0xFF) << 8
            for _ in range(8):
                total = (total << 1 ^ (0x1021 if total & 0x8000 else 0)) & 0xFFFF
        assert programs[state].call("copy_and_sum", seed) == total


@pytest.mark.parametrize("state", ["arm", "thumb"])
def test_a_table_is_searched_and_what_lies_between_is_divided(programs, state):
    assert signed(programs[state].call("search_table", -2000)) == 312
    assert signed(programs[state].call("search_table", 175)) == 1077 + (1122 - 1077) * (175 - 110) // 123
    assert signed(programs[state].call("search_table", 1999)) == 1955 + (2050 - 1955) * (1999 - 1790) // (2000 - 1790)


def test_both_states_control_and_dispatch_alike(programs):
    for name in ("control", "comply", "dispatch"):
        for arguments in compiled.CALLS[name]:
            arm, thumb = (programs[state].call(name, *arguments) for state in ("arm", "thumb"))
            assert arm == thumb, (name, arguments)


def test_compiled_code_takes_between_one_and_a_half_and_two_cycles_per_instruction(programs):
    """docs/explanation/arm7.md has the figures; other releases of the compiler move them by some per cent."""
    program = programs["arm"]
    cycles, instructions = program.core.cycles, program.core.instructions
    found = {name: program.measure(name, calls) for name, calls in compiled.CALLS.items()}
    assert 1.5 < (program.core.cycles - cycles) / (program.core.instructions - instructions) < 2.0
    assert found["scale"] < found["comply"] < found["dispatch"]  # arithmetic, floats in memory, pointers and calls
