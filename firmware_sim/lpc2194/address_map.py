# cython: boundscheck=False, wraparound=False
# (the place of a block is worked out from the address's bits, below the size of the table)
"""The targets of the processor's loads and stores that are neither flash nor RAM: the blocks, by address.

An access acts at the time at which its instruction begins: later events in the chip come after it.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.arm7.core import Core, Device
from ranger_sim.firmware_sim.lpc2194.block import Block, NotModelledError
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.foundation.user_error import FirmwareError

BLOCK_BITS: Final = 14  # a block of the peripheral bus has 16 KB
BLOCKS: Final = 128

NAME_OF_ACCESS = {1: "byte", 2: "half-word", 4: "word"}


class NotModelledAccess(FirmwareError):  # noqa: N818  (it is what the program did)
    """The program accessed something that is not modelled; `address` and `pc` give the place, as numbers."""

    def __init__(self, text, address, pc) -> None:
        FirmwareError.__init__(self, text)
        self.address = address
        self.pc = pc


@cython.cclass
class AddressedBoard(Microcontroller):
    """A board as an access to one of its devices needs it."""

    @cython.cfunc
    @cython.exceptval(check=True)
    def reach(self) -> cython.void:
        """Begin the present instruction's access to a device: devices see the time at which the instruction began."""
        raise NotImplementedError

    @cython.cfunc
    @cython.exceptval(check=True)
    def work(self) -> cython.void:
        """Note that the present access has an effect: if the main program makes it, the program is at work."""
        raise NotImplementedError

    @cython.cfunc
    def settle(self, block: Block) -> cython.int:
        """After an access: the levels of what the block drives, and how far the processor may run on."""
        raise NotImplementedError


@cython.final
@cython.cclass
class AddressMap(Device):
    """Blocks of the peripheral bus (0xE...), the fast GPIO and the VIC.

    `touched` counts accesses that may do something or give another value another time, `reads` the others.
    """

    board: AddressedBoard
    core: Core
    image: object
    places: list
    fast_gpio: Block
    vic: Block
    touched: cython.longlong
    reads: cython.longlong

    def __init__(self, board: AddressedBoard, core: Core, image) -> None:
        self.board = board
        self.core = core
        self.image = image
        self.places = [None] * BLOCKS
        self.fast_gpio = None
        self.vic = None
        self.touched = 0
        self.reads = 0

    def add(self, block) -> None:
        """Put a block at its address."""
        if block.base == 0x3FFFC000:
            self.fast_gpio = block
        elif block.base == 0xFFFFF000:
            self.vic = block
        else:
            self.places[(block.base & 0x1FFFFF) >> BLOCK_BITS] = block

    def blocks(self) -> list:
        """All of them, by address."""
        return [self.fast_gpio, *(block for block in self.places if block is not None), self.vic]

    def answers(self, address: cython.longlong) -> cython.bint:
        """Whether an address below the peripheral bus is a device's."""
        return self.find(address) is not None

    @cython.ccall
    def find(self, address: cython.longlong) -> Block:
        """The block that an address belongs to, or None."""
        page: cython.longlong = address >> BLOCK_BITS
        if page >> 7 == 0x700:  # 0xE0000000 ... 0xE01FFFFF
            return self.places[page & 127]
        if page == 0xFFFF:  # 0x3FFFC000
            return self.fast_gpio
        if address >> 12 == 0xFFFFF:
            return self.vic
        return None

    def read(self, address: cython.longlong, size: cython.longlong) -> cython.longlong:
        """A load."""
        block: Block = self.find(address)
        value: cython.longlong
        offset: cython.longlong
        if block is None:
            self.fail(address, size, False, 0, "no device is modelled there")
        offset = (address - block.base) & ~3
        self.board.reach()
        block.steady = False
        try:
            value = block.read(offset)
        except NotModelledError as error:
            self.fail(address, size, False, 0, str(error))
        if block.steady:
            self.reads += 1
        else:
            self.touched += 1
            self.board.work()
            self.board.settle(block)
        if size == 4:
            return value
        value >>= 8 * (address & 3)
        return value & 0xFF if size == 1 else value & 0xFFFF

    @cython.ccall
    @cython.locals(offset=cython.longlong, value=cython.longlong)
    def peek(self, address: cython.longlong, size: cython.longlong) -> cython.longlong:
        """The value of a load, for a debugger, without side effects. LookupError for a load with side effects, or an
        unmapped address."""
        block: Block = self.find(address)
        if block is None:
            raise LookupError(f"no device is modelled at {address:#010x}")
        offset = (address - block.base) & ~3
        if offset in block.READ_ACTS:
            raise LookupError(f"a read of {block.name} {block.REGISTERS[offset][0]} does something")
        try:
            value = block.read(offset)
        except NotModelledError as error:
            raise LookupError(str(error)) from None
        value >>= 8 * (address & 3)
        return value if size == 4 else value & (0xFF if size == 1 else 0xFFFF)

    def write(self, address: cython.longlong, size: cython.longlong, value: cython.longlong) -> cython.int:
        """A store."""
        block: Block = self.find(address)
        if block is None:
            self.fail(address, size, True, value, "no device is modelled there")
        self.board.reach()
        self.board.work()
        self.touched += 1
        try:
            if size == 4:
                block.write(address - block.base, value)
            else:
                block.write_part(address - block.base, size, value)
        except NotModelledError as error:
            self.fail(address, size, True, value, str(error))
        self.board.settle(block)
        return 0

    def fail(self, address, size, writing, value, why) -> None:
        """End the run with an error: the access, the program's place, and the reason."""
        block = self.find(address)
        name = ""
        if block is not None:
            register = block.REGISTERS.get((address - block.base) & ~3)
            name = f" ({block.name}: {register[0]})" if register is not None else f" ({block.name})"
        pc = self.core.pc
        inside = self.image.place_of(pc) if self.image is not None else ""
        what = f"writes {value:#x} to" if writing else "reads"
        raise NotModelledAccess(
            f"{self.board.name}: the program {what} {address:#010x}{name} as a {NAME_OF_ACCESS[size]} at pc {pc:#010x}"
            f"{f' in {inside}' if inside else ''}: {why}",
            address,
            pc,
        )
