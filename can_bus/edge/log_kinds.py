"""Kinds of recordings of CAN frames, known by what a file begins with, or by its ending."""

import pathlib
import re

SNIFFED_BYTES = 4096
SNIFFED_LINES = 3
BLF, SQLITE, ASC, TRC = "BLF", "python-can's SQLite", "ASC", "TRC"
CANDUMP, SCREEN, BUSMASTER = "candump", "candump's screen output", "BUSMASTER"
PYTHON_CAN, SAVVYCAN, PCAP = "python-can's CSV", "SavvyCAN's CSV", "packet capture"
# Packet captures of libpcap in us and in ns, little-endian and big-endian, and the one of pcapng.
CAPTURE_US, CAPTURE_NS, CAPTURE_NG = 0xA1B2C3D4, 0xA1B23C4D, 0x0A0D0D0A
CAPTURES = tuple(magic.to_bytes(4, order) for magic in (CAPTURE_US, CAPTURE_NS) for order in ("little", "big")) + (
    CAPTURE_NG.to_bytes(4, "big"),
)
MAGIC = {b"LOGG": BLF, b"SQLite format 3\0": SQLITE} | dict.fromkeys(CAPTURES, PCAP)
FIRST_LINES = {
    PYTHON_CAN: re.compile(r"timestamp,arbitration_id,extended,remote,error,dlc,data\s*$"),
    SAVVYCAN: re.compile(r"time stamp,id,extended,", re.IGNORECASE),
    BUSMASTER: re.compile(r"\*\*\*BUSMASTER"),
    ASC: re.compile(r"\s*date\s+\w{3}\s+\w{3}\s|\s*base\s+(?:hex|dec)\s+timestamps", re.IGNORECASE),
    TRC: re.compile(r";\$FILEVERSION=|;\s*PCAN|;\s+Message\s+Number", re.IGNORECASE),
    CANDUMP: re.compile(r"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}#"),
    SCREEN: re.compile(r"\s*(?:\([^)]*\)\s+)?\S+\s+(?:(?:RX|TX)\s+\S+\s+\S+\s+)?[0-9A-Fa-f]{3,8}\s+\[\d+\](?:\s|$)"),
}
ENDINGS = {".blf": BLF, ".db": SQLITE, ".asc": ASC, ".trc": TRC, ".log": CANDUMP}


def kind(path: pathlib.Path) -> str:
    """One of the kinds, "" for a file that is none of them by its beginning or ending. OSError for none at all."""
    with path.open("rb") as file:
        first = file.read(SNIFFED_BYTES)
    return kind_of(first) or ENDINGS.get(path.suffix.lower(), "")


def kind_of(first: bytes) -> str:
    """The kind of a file that begins with these bytes, "" for none."""
    for magic, name in MAGIC.items():
        if first.startswith(magic):
            return name
    text = first.decode("utf-8", errors="replace").lstrip("\ufeff")
    lines = [line for line in text.splitlines() if line.strip()][:SNIFFED_LINES]
    return next((name for line in lines for name, pattern in FIRST_LINES.items() if pattern.match(line)), "")
