"""UART 0's and 1's registers. LPC2194 user manual, UART0 and UART1.

The bytes are peripherals/uart.py: 8N1 whatever UnLCR says, FIFOs on. Not modelled: auto-baud, loopback, modem lines
(they rest), and a transmitter that is switched off.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.uart import IIR_NONE, IIR_RECEIVED, IIR_TIMEOUT, IIR_TRANSMIT, Uart

# UnIER
IER_RECEIVE: Final = 1
IER_TRANSMIT: Final = 2
IER_STATUS: Final = 4
IIR_STATUS: Final = 6
LCR_DLAB: Final = 0x80
TER_ON: Final = 0x80
TRIGGERS = (1, 4, 8, 14)  # by UnFCR bits 6-7


@cython.final
@cython.cclass
class UartBlock(Block):
    """`holds`: the transmit FIFO became empty, which asks for an interrupt until UnIIR reports it."""

    uart: Uart
    IER: cython.longlong
    LCR: cython.longlong
    MCR: cython.longlong
    SCR: cython.longlong
    FCR: cython.longlong
    FDR: cython.longlong
    TER: cython.longlong
    divisor: cython.longlong
    holds: cython.bint

    READ_ACTS = frozenset({0x00, 0x08, 0x14})
    REGISTERS = {
        0x00: ("RBR/THR/DLL", "rw"),
        0x04: ("IER/DLM", "rw"),
        0x08: ("IIR/FCR", "rw"),
        0x0C: ("LCR", "rw"),
        0x10: ("MCR", "rw"),
        0x14: ("LSR", "r"),
        0x18: ("MSR", "r"),
        0x1C: ("SCR", "rw"),
        0x20: ("ACR", "rw"),
        0x28: ("FDR", "rw"),
        0x30: ("TER", "rw"),
    }

    def __init__(self, chip, clocks, number) -> None:
        Block.__init__(self, chip, clocks, f"UART {number}", 0xE000C000 + 0x4000 * number, 1 << (6 + number))
        self.uart = Uart(chip, number, divisor=1, trigger=1)
        self.IER = 0
        self.LCR = 0
        self.MCR = 0
        self.SCR = 0
        self.FCR = 0
        self.divisor = 1
        self.FDR = 0x10
        self.TER = 0x80
        self.holds = False

    def clocked(self) -> None:
        self._set_rate()

    @cython.ccall
    def _set_rate(self) -> object:
        """By the divisor latch and the fractional divider."""
        self.uart.hz = self.clocks.pclk
        self.uart.set_divisor(self.divisor or 1, self.FDR & 15, self.FDR >> 4 & 15 or 1)

    @cython.cfunc
    def take_alarms(self) -> cython.void:
        """Take over what the UART's alarms have set."""
        if self.uart.IIR == IIR_TRANSMIT:
            self.uart.IIR = IIR_NONE
            self.holds = True

    @cython.cfunc
    @cython.exceptval(check=False)
    def identity(self) -> cython.longlong:
        """UnIIR's low four bits: the first reason for an interrupt."""
        uart: Uart = self.uart
        self.take_alarms()
        if self.IER & IER_STATUS and uart.errors:
            return IIR_STATUS
        if self.IER & IER_RECEIVE:
            if uart.fifo_count >= uart.trigger:
                return IIR_RECEIVED
            if uart.IIR == IIR_TIMEOUT and uart.fifo_count > 0:
                return IIR_TIMEOUT
        if self.IER & IER_TRANSMIT and self.holds:
            return IIR_TRANSMIT
        return IIR_NONE

    def requests(self) -> cython.longlong:
        if self.IER == 0:
            return 0
        return 0 if self.identity() == IIR_NONE else self.mask

    def read(self, offset: cython.longlong) -> cython.longlong:
        uart: Uart = self.uart
        value: cython.longlong
        if offset == 0x00:
            if self.LCR & LCR_DLAB:
                return self.divisor & 0xFF
            value = uart.RBR()
            if uart.IIR == IIR_TIMEOUT:
                uart.IIR = IIR_NONE
            return value
        if offset == 0x08:
            value = self.identity()
            if value == IIR_TRANSMIT:
                self.holds = False
            return value | (0xC0 if self.FCR & 1 else 0)
        if offset == 0x14:
            return uart.LSR()
        self.steady = True
        if offset == 0x04:
            return self.divisor >> 8 if self.LCR & LCR_DLAB else self.IER
        if offset == 0x0C:
            return self.LCR
        if offset == 0x10:
            return self.MCR
        if offset == 0x18:
            return 0
        if offset == 0x1C:
            return self.SCR
        if offset == 0x20:
            return 0
        if offset == 0x28:
            return self.FDR
        if offset == 0x30:
            return self.TER
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        uart: Uart = self.uart
        value &= 0xFF
        if offset == 0x00:
            if self.LCR & LCR_DLAB:
                self.divisor = self.divisor & 0xFF00 | value
                self._set_rate()
            else:
                if not self.TER & TER_ON:
                    self.not_modelled("a byte for a transmitter that is switched off (TER)")
                self.holds = False
                uart.THR(value)
        elif offset == 0x04:
            if self.LCR & LCR_DLAB:
                self.divisor = self.divisor & 0xFF | value << 8
                self._set_rate()
            else:
                self._enable(value)
        elif offset == 0x08:
            self.FCR = value
            if value & 2:
                uart.unplug()
            uart.trigger = TRIGGERS[value >> 6] if value & 1 else 1
        elif offset == 0x0C:
            self.LCR = value
        elif offset == 0x10:
            if value & 0x10:
                self.not_modelled("the loopback of a UART (MCR)")
            self.MCR = value
        elif offset == 0x1C:
            self.SCR = value
        elif offset == 0x20:
            if value & 1:
                self.not_modelled("the auto-baud of a UART (ACR)")
        elif offset == 0x28:
            self.FDR = value
            self._set_rate()
        elif offset == 0x30:
            self.TER = value & TER_ON
        else:
            self.unknown(offset, True)
        return 0

    @cython.ccall
    def _enable(self, value) -> object:
        """Write UnIER. An empty transmit FIFO asks for its interrupt at once."""
        uart: Uart = self.uart
        if value & IER_TRANSMIT and not self.IER & IER_TRANSMIT:
            self.holds = uart.transmit_free - uart.byte_ns <= self.chip.now
            uart.transmit_source.bit = 1
            if not self.holds:
                uart.transmit_alarm.set(uart.transmit_free - uart.byte_ns)
        elif not value & IER_TRANSMIT:
            uart.transmit_source.bit = 0
        self.IER = value & 15
