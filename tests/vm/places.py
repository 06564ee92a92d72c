"""Where a test of this folder may run: on a host with vcan, in the virtual machine, or not now."""

import contextlib
import os
import pathlib
import socket
import subprocess

PLACE = "RANGER_SIM_TEST_VM"  # host or guest: set by `make test-vm`, which runs what is here
VCANS = ("vcan0", "vcan1", "vcan2", "vcan3")


def run_by_make_test_vm() -> bool:
    """False in an ordinary run of the suite."""
    return os.environ.get(PLACE, "") != ""


def in_virtual_machine() -> bool:
    """True inside `python -m dev.vm`, where network interfaces are ours to change."""
    return os.environ.get("RANGER_SIM_VM") == "1"


def interface_is_up(name: str) -> bool:
    """True when the kernel has this interface and it is up (flag 1 of linux/if.h)."""
    flags = pathlib.Path("/sys/class/net", name, "flags")
    return flags.exists() and int(flags.read_text(), 16) & 1 == 1


def why_no_vcan_here() -> str:
    """Empty when vcan0 ... vcan3 are up (made, if we may), else the reason in a few words."""
    if not hasattr(socket, "AF_CAN"):
        return "this Python has no AF_CAN"
    with contextlib.suppress(OSError):
        for name in VCANS:
            if not interface_is_up(name):
                subprocess.run(["ip", "link", "add", name, "type", "vcan"], capture_output=True)
                subprocess.run(["ip", "link", "set", name, "up"], capture_output=True)
    missing = [name for name in VCANS if not interface_is_up(name)]
    if missing:
        return f"no {', '.join(missing)} on this machine"
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as error:
        return f"this kernel has no SocketCAN ({error.strerror})"
    return ""
