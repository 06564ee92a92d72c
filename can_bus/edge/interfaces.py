"""CAN interfaces that python-can finds on this machine."""

import logging

import can

# Left out: `virtual` and `udp_multicast` always exist; finding a socketcand server means listening to the network for
# seconds.
NOT_LOOKED_FOR = {"virtual", "udp_multicast", "socketcand"}


def available_interfaces() -> list[str]:
    """`interface:channel` of every adapter or kernel interface found, e.g. `socketcan:vcan0`; sorted."""
    log = logging.getLogger("can")
    level = log.level
    log.setLevel(logging.CRITICAL)  # missing drivers print messages, which are not needed here
    try:
        found = can.detect_available_configs(sorted(can.VALID_INTERFACES - NOT_LOOKED_FOR))
    finally:
        log.setLevel(level)
    return sorted({f"{each['interface']}:{each['channel']}" for each in found})


def known_interfaces() -> tuple[str, ...]:
    """Names of the interfaces that python-can has, adapters' drivers installed or not; sorted."""
    return tuple(sorted(can.VALID_INTERFACES))
