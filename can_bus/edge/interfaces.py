"""Which CAN interfaces python-can finds on this machine."""

import logging

import can

SOFTWARE_ONLY = {"virtual", "udp_multicast"}  # always there, so nothing that is found


def available_interfaces() -> list[str]:
    """`interface:channel` of every adapter or kernel interface found, e.g. `socketcan:vcan0`; sorted."""
    log = logging.getLogger("can")
    level = log.level
    log.setLevel(logging.CRITICAL)  # drivers that are not installed announce themselves, which is no news here
    try:
        found = can.detect_available_configs(sorted(can.VALID_INTERFACES - SOFTWARE_ONLY))
    finally:
        log.setLevel(level)
    return sorted({f"{each['interface']}:{each['channel']}" for each in found})
