"""The devices in a board's chip and at its pins: given by the builder of the board, not by its program."""

import dataclasses
from collections.abc import Callable
from typing import Any

from ranger_sim.firmware_sim.peripherals import adc_external

DEFAULT_HZ = 60_000_000  # the most that an LPC2194 allows (user manual UM10114), as on the robot


CAN_KINDS = ("classic", "fd")


@dataclasses.dataclass(frozen=True)
class ExternalConverter:
    """An ADS7871 on the SSP. `inputs`: the analog place behind each multiplexer code; by default the code itself."""

    eint: int = 1
    conversion_ns: int = adc_external.CONVERSION_NS
    reference_V: float = adc_external.REFERENCE_V
    scale: float = 1.0
    offset_counts: int = 0
    inputs: dict[int, int] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class InternalConverter:
    """The chip's own. `inputs`: the analog place behind each channel; by default the channel's number."""

    reference_V: float = 3.3
    scale: float = 1.0
    offset_counts: int = 0
    inputs: dict[int, int] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class SpiDevice:
    """An absolute encoder on an SPI: which of the chip's `words` it holds out, and how it sends it."""

    word: int = 0
    bits: int = 14
    bit_rate: int = 1_000_000
    value_bits: int = 13


@dataclasses.dataclass(frozen=True)
class Hardware:
    """Core clock (Hz; 0: that of the master table, DEFAULT_HZ without one), converters (None: no converter), and the
    device on each SPI.

    can: "fd": its CAN controllers are those of peripherals/can_fd_controller.py; "classic", those of the LPC2194; "":
    as the master table states, classic without one.

    panel: makes, from the chip, what a person sees of the board, as boards/modules/front_panel.py: it has `words`,
    `move` and, as `ssp`, the device on the SSP. None: nothing to see, and no SspDevice.
    """

    hz: int = 0
    can: str = ""
    external: ExternalConverter | None = dataclasses.field(default_factory=ExternalConverter)
    internal: InternalConverter = dataclasses.field(default_factory=InternalConverter)
    spi: dict[int, SpiDevice] = dataclasses.field(default_factory=lambda: {0: SpiDevice()})
    panel: Callable[[Any], Any] | None = None
