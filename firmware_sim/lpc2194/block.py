"""The base of all blocks of registers, and the clocks that they run on."""

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral


class NotModelledError(Exception):
    """The program asks a register for something that no device here does; the text names it."""


@cython.final
@cython.cclass
class Clocks:
    """The processor's clock (Hz) and the peripherals', which is it divided by VPBDIV."""

    crystal_hz: cython.longlong
    cclk: cython.longlong
    divider: cython.longlong

    def __init__(self, crystal_hz) -> None:
        self.crystal_hz = crystal_hz
        self.cclk = crystal_hz  # until the PLL is connected
        self.divider = 4  # VPBDIV after reset

    @property
    def pclk(self) -> int:
        """Clock of the peripherals, Hz."""
        return self.cclk // self.divider


@cython.cclass
class Block(Peripheral):
    """Registers from `base` on, the front of one device of firmware_sim/peripherals.

    `read` and `write` take the offset of a register, a multiple of 4; unknown offsets go to `unknown`. `steady` is set
    by a read that does nothing and gives the same until a write or an event of the chip: a loop that does nothing else
    can be skipped. `mask`: the inputs of the VIC that it drives, `requests` their levels.
    """

    clocks: Clocks
    name: str
    base: cython.longlong
    mask: cython.longlong
    steady: cython.bint
    partner: "Block"

    # {offset: (name, "r", "w" or "rw")}: what the reference lists, and a test holds against `read` and `write`
    REGISTERS: dict[int, tuple[str, ...]] = {}
    MEMORY = 0  # bytes from `base` on that only keep what is written; REGISTERS has the first word
    READ_ACTS: frozenset[int] = frozenset()  # offsets at which a read does something: a debugger does not look there

    def __init__(self, chip, clocks, name, base, mask=0) -> None:
        Peripheral.__init__(self, chip)
        self.clocks = clocks
        self.name = name
        self.base = base
        self.mask = mask
        self.steady = False
        self.partner = None  # a block whose levels an access to this one can change

    @cython.ccall
    def read(self, offset: cython.longlong) -> cython.longlong:
        """Read the register at `offset`."""
        return self.unknown(offset, False)

    @cython.ccall
    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        """Write it."""
        self.unknown(offset, True)
        return 0

    @cython.ccall
    def write_part(self, offset: cython.longlong, size: cython.longlong, value: cython.longlong) -> cython.int:
        """Write `size` bytes, 1 or 2: the register's other bytes are zero, as STRB and STRH to a device are meant."""
        if offset & 3:
            self.not_modelled("bytes inside this register")
        return self.write(offset, value)

    @cython.ccall
    def requests(self) -> cython.longlong:
        """Levels of its inputs of the VIC."""
        return 0

    @cython.ccall
    def clocked(self) -> object:
        """The peripherals' clock has changed."""

    @cython.cfunc
    def unknown(self, offset: cython.longlong, writing: cython.bint) -> cython.longlong:
        """Handle an access that `read` and `write` do not know: to no register, or in the wrong direction.

        A write-only register reads 0; a write to a read-only one does nothing.
        """
        if offset not in self.REGISTERS:
            raise NotModelledError("no register is modelled there")
        return 0

    @cython.ccall
    def not_modelled(self, what) -> object:
        """End the run: the register is known, the request to it is not modelled."""
        raise NotModelledError(f"{what} is not modelled")
