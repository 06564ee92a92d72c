"""Error frames in the format of Linux (linux/can/error.h): classes in the identifier, details in eight data bytes."""

from ranger_sim.can_bus.frame import FIELD_ACK_SLOT
from ranger_sim.can_bus.node import (
    ICR_BUS_ERROR,
    ICR_ERROR_PASSIVE,
    ICR_ERROR_WARNING,
    ICR_FIELD_MASK,
    ICR_FIELD_SHIFT,
    ICR_KIND_SHIFT,
    ICR_RECEIVING,
    KIND_BIT,
    KIND_FORM,
    KIND_OTHER,
    KIND_STUFF,
    PASSIVE_LIMIT,
    WARNING_LIMIT,
)
from ranger_sim.foundation.events import FLAG_ERROR

# Classes, bits of the identifier.
CAN_ERR_CRTL = 0x004
CAN_ERR_PROT = 0x008
CAN_ERR_ACK = 0x020
CAN_ERR_BUSOFF = 0x040
CAN_ERR_BUSERROR = 0x080
CAN_ERR_RESTARTED = 0x100
CAN_ERR_CNT = 0x200  # the last two bytes hold the counters
# Places of the details.
CONTROLLER, PROTOCOL, LOCATION, TRANSMIT_ERRORS, RECEIVE_ERRORS = 1, 2, 3, 6, 7
CRTL_RX_OVERFLOW = 0x01
CRTL_RX_WARNING, CRTL_TX_WARNING, CRTL_RX_PASSIVE, CRTL_TX_PASSIVE, CRTL_ACTIVE = 0x04, 0x08, 0x10, 0x20, 0x40
PROT_OF_KIND = {KIND_BIT: 0x01, KIND_FORM: 0x02, KIND_STUFF: 0x04, KIND_OTHER: 0x00}
PROT_TX = 0x80

KIND_MASK = 3
COUNTER_LIMIT = 255

Frame = tuple[int, int, int, int]  # identifier, flags, lo, hi


def frame_of_status(interrupts: int, counters: tuple[int, int], was_off: bool, off: bool) -> Frame | None:
    """The error frame for a CAN_STATUS: `interrupts` (ICR_*), `counters` (transmit errors, receive errors), and
    whether the controller was and is bus-off. None when only the counters changed."""
    transmit_errors, receive_errors = counters
    classes, data = CAN_ERR_CNT, bytearray(8)
    data[TRANSMIT_ERRORS] = min(transmit_errors, COUNTER_LIMIT)
    data[RECEIVE_ERRORS] = min(receive_errors, COUNTER_LIMIT)
    if interrupts & ICR_BUS_ERROR:
        field, kind = interrupts >> ICR_FIELD_SHIFT & ICR_FIELD_MASK, interrupts >> ICR_KIND_SHIFT & KIND_MASK
        classes |= CAN_ERR_BUSERROR
        if kind == KIND_OTHER and field == FIELD_ACK_SLOT:
            classes |= CAN_ERR_ACK
        else:
            classes |= CAN_ERR_PROT
            data[PROTOCOL] = PROT_OF_KIND[kind] | (0 if interrupts & ICR_RECEIVING else PROT_TX)
        data[LOCATION] = field  # the codes of the SJA1000, which linux/can/error.h has adopted
    if off and not was_off:
        classes |= CAN_ERR_BUSOFF
    elif was_off and not off:
        classes |= CAN_ERR_RESTARTED
    elif interrupts & (ICR_ERROR_WARNING | ICR_ERROR_PASSIVE):
        classes |= CAN_ERR_CRTL
        for count, warning, passive in (
            (transmit_errors, CRTL_TX_WARNING, CRTL_TX_PASSIVE),
            (receive_errors, CRTL_RX_WARNING, CRTL_RX_PASSIVE),
        ):
            data[CONTROLLER] |= passive if count >= PASSIVE_LIMIT else warning if count >= WARNING_LIMIT else 0
        if max(counters) < WARNING_LIMIT:
            data[CONTROLLER] = CRTL_ACTIVE
    return None if classes == CAN_ERR_CNT else _frame(classes, data)


def overflow() -> Frame:
    """The error frame for an overrun: frames are missing here, because the reader was too slow."""
    data = bytearray(8)
    data[CONTROLLER] = CRTL_RX_OVERFLOW
    return _frame(CAN_ERR_CRTL, data)


def _frame(classes: int, data: bytearray) -> Frame:
    return classes, FLAG_ERROR | 8, int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
