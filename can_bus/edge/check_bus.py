"""Check that a CAN interface exists, is up and is configured correctly, from the kernel's report and its traffic.

Every finding is (what, ok, text, mend): `mend` is the command that corrects it, empty where nothing is wrong. Functions
supply all input, so that everything can be tested without an interface.
"""

from __future__ import annotations

import dataclasses
import pathlib
import subprocess
from collections.abc import Callable, Mapping
from typing import Any

import can

from ranger_sim.foundation import json_text, wallclock

WARNING_LEVEL = 96  # of the error counters: ISO 11898-1
FEW_TO_WAIT = 100  # frames; the kernel's default of 10 overflows when a slot's commands go out together (chosen by us)
IP_TIMEOUT_S = 10.0
ARPHRD_CAN = 280  # include/uapi/linux/if_arp.h
IFF_UP = 1  # include/uapi/linux/if.h
NO_DEVICE = "does not exist"


@dataclasses.dataclass(frozen=True)
class Finding:
    """One checked item. `ok` None: informative, neither good nor bad."""

    what: str
    ok: bool | None
    text: str
    mend: str = ""


@dataclasses.dataclass(frozen=True)
class Traffic:
    """Traffic while listening: frames, error frames, frames by identifier."""

    seconds: float
    frames: int
    error_frames: int
    identifiers: Mapping[int, int]


class NotReadError(Exception):
    """Why an interface could not be read or opened, in one line."""


def read_link(device: str, sys_folder: pathlib.Path = pathlib.Path("/sys/class/net")) -> dict[str, Any]:
    """Output of `ip -details -statistics -json link show` for a network device; NotReadError when it does not exist.

    Without the program `ip`, only the contents of /sys: flags and link type.
    """
    call = ["ip", "-details", "-statistics", "-json", "link", "show", "dev", device]
    try:
        done = subprocess.run(call, capture_output=True, text=True, check=False, timeout=IP_TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired, ValueError):
        return read_sys(device, sys_folder)
    if done.returncode != 0:
        message = " ".join(done.stderr.split())
        raise NotReadError(NO_DEVICE if "does not exist" in message else message or f"ip left with {done.returncode}")
    return parse_link(done.stdout, device)


def parse_link(text: str, device: str) -> dict[str, Any]:
    """The one link in the JSON of `ip`; NotReadError when it is not that."""
    try:
        found = json_text.loads(text, "ip")
    except json_text.JsonError:
        raise NotReadError("ip gave no JSON: a version before 4.14, or busybox's") from None
    links = (
        [one for one in found if isinstance(one, dict) and one.get("ifname") == device]
        if isinstance(found, list)
        else []
    )
    if not links:
        raise NotReadError(NO_DEVICE)
    return links[0]


def read_sys(device: str, folder: pathlib.Path) -> dict[str, Any]:
    """The same form as `read_link` from /sys/class/net, as far as that goes."""
    place = folder / device
    if "/" in device or not place.is_dir():
        raise NotReadError(NO_DEVICE)
    try:
        flags = int((place / "flags").read_text(encoding="ascii"), 16)
        kind = int((place / "type").read_text(encoding="ascii"))
        queue = int((place / "tx_queue_len").read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise NotReadError(f"{place} cannot be read: {error}") from None
    return {
        "ifname": device,
        "flags": ["UP"] if flags & IFF_UP else [],
        "link_type": "can" if kind == ARPHRD_CAN else str(kind),
        "txqlen": queue,
        "only_sys": True,
    }


def observe(arguments: Mapping[str, Any], seconds: float) -> Traffic:
    """Open a python-can bus and receive for that long; NotReadError when it cannot be opened."""
    try:
        bus = can.Bus(**arguments)
    except Exception as error:  # drivers raise many types: missing libraries, devices, permissions
        raise NotReadError(" ".join(f"{type(error).__name__}: {error}".split())) from None
    frames = errors = 0
    identifiers: dict[int, int] = {}
    try:
        end = wallclock.monotonic_s() + seconds
        while (left := end - wallclock.monotonic_s()) > 0:
            received = bus.recv(timeout=left)
            if received is None:
                continue
            if received.is_error_frame:
                errors += 1
            else:
                frames += 1
                identifiers[received.arbitration_id] = identifiers.get(received.arbitration_id, 0) + 1
    except can.CanError as error:
        raise NotReadError(" ".join(f"{type(error).__name__}: {error}".split())) from None
    finally:
        bus.shutdown()
    return Traffic(seconds, frames, errors, identifiers)


def check_link(device: str, bit_rate: int, read: Callable[[str], dict[str, Any]] = read_link) -> list[Finding]:
    """Findings about a SocketCAN device that should run at `bit_rate` (bit/s)."""
    virtual = device.startswith(("vcan", "vxcan"))
    try:
        link = read(device)
    except NotReadError as error:
        if str(error) != NO_DEVICE:
            return [Finding("there", False, f"cannot be read: {error}", f"ip -details link show {device}")]
        mend = f"ip link add dev {device} type vcan && ip link set {device} up" if virtual else "ip link show type can"
        why = "" if virtual else " (is the adapter plugged in, and its driver loaded?)"
        return [Finding("there", False, f"there is no interface {device}{why}", mend)]
    kind = link.get("link_type", "")
    if kind != "can":
        return [
            Finding("there", False, f"{device} not a CAN interface, its link type is {kind!r}", "ip link show type can")
        ]
    info = link.get("linkinfo") or {}
    virtual = info.get("info_kind", "vcan" if virtual else "can") in ("vcan", "vxcan")
    found = [Finding("there", True, f"{device}, {'virtual' if virtual else 'CAN controller'}")]
    data = info.get("info_data") or {}
    set_rate = f"ip link set {device} type can bitrate {bit_rate}"
    mend_rate = f"ip link set {device} down && {set_rate} && ip link set {device} up"
    rate = (data.get("bittiming") or {}).get("bitrate")
    if virtual:
        found.append(Finding("bit rate", None, f"virtual: none (profile {bit_rate})"))
    elif link.get("only_sys"):
        found.append(Finding("bit rate", None, "not known without the program ip (iproute2)", "apt install iproute2"))
    elif rate is None:
        found.append(
            Finding(
                "bit rate", False, f"never set, the profile says {bit_rate}", f"{set_rate} && ip link set {device} up"
            )
        )
    elif rate != bit_rate:
        found.append(Finding("bit rate", False, f"{rate}, the profile says {bit_rate}", mend_rate))
    else:
        found.append(Finding("bit rate", True, str(rate)))
    up = "UP" in link.get("flags", [])
    found.append(Finding("up", up, "up" if up else "down", "" if up else f"ip link set {device} up"))
    if not virtual and not link.get("only_sys"):
        found += _controller(device, link, info, data, up)
    queue = link.get("txqlen")
    if isinstance(queue, int) and queue < FEW_TO_WAIT and not virtual:
        text = f"{queue} frames can wait to be sent; a burst of commands is longer"
        found.append(Finding("queue", None, text, f"ip link set {device} txqueuelen 1000"))
    return found


def _controller(
    device: str, link: Mapping[str, Any], info: Mapping[str, Any], data: Mapping[str, Any], up: bool
) -> list[Finding]:
    """State and error counters of a real controller."""
    found = []
    state = data.get("state", "unknown")
    counters = data.get("berr_counter") or {}
    transmit, receive = counters.get("tx", 0), counters.get("rx", 0)
    statistics = info.get("info_xstats") or {}
    times = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in statistics.items() if count)
    counted = f"error counters tx {transmit}, rx {receive}" + (f"; since it is there: {times}" if times else "")
    watch = f"ip -details -statistics link show {device}"
    if not up:
        found.append(Finding("state", None, state))
    elif state == "ERROR-ACTIVE":
        found.append(Finding("state", True, state))
    elif state == "BUS-OFF":
        text = f"{state}: no node acknowledges, or all run at another bit rate; check wires and termination first"
        found.append(Finding("state", False, text, f"ip link set {device} type can restart"))
    elif state in ("ERROR-WARNING", "ERROR-PASSIVE"):
        text = f"{state}: check wires, 120 ohm at both ends, and that all run at one bit rate"
        found.append(Finding("state", False, text, f"ip link set {device} down && ip link set {device} up"))
    else:
        found.append(Finding("state", None, str(state)))
    bad = up and max(transmit, receive) >= WARNING_LEVEL
    found.append(Finding("errors", not bad, counted, watch if bad else ""))
    return found


def check_traffic(
    device: str, traffic: Traffic, known: Mapping[int, str], expected: Mapping[int, str]
) -> list[Finding]:
    """Findings about the traffic: `known` identifier -> name; `expected`: identifiers of which some must be seen."""
    rate = traffic.frames / traffic.seconds if traffic.seconds > 0 else 0.0
    watch = f"candump -e {device}"
    names = [name for identifier, name in sorted(known.items()) if identifier in traffic.identifiers]
    strange = sorted(identifier for identifier in traffic.identifiers if identifier not in known)
    found = []
    text = f"{traffic.frames} frames in {traffic.seconds:g} s ({rate:.0f}/s)"
    if expected and not any(identifier in traffic.identifiers for identifier in expected):
        boards = ", ".join(sorted({name.partition("_")[0] for name in expected.values()}))
        found.append(
            Finding("traffic", False, f"{text}, none of them from {boards}: is it powered and on this bus?", watch)
        )
    else:
        first = ", ".join(names[:4]) + (" ..." if len(names) > 4 else "")
        found.append(Finding("traffic", True if traffic.frames else None, text + (f": {first}" if first else "")))
    if strange:
        listed = ", ".join(str(identifier) for identifier in strange[:8]) + (" ..." if len(strange) > 8 else "")
        found.append(Finding("identifiers", False, f"not of this bus: {listed}", watch))
    if traffic.error_frames:
        found.append(Finding("error frames", False, f"{traffic.error_frames} while listening", watch))
    return found
