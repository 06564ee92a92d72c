"""Frames of a recording that is read with a DBC file."""

import pytest

from ranger_sim.foundation.events import FLAG_BRS, FLAG_FD
from ranger_sim.tools.panel.inside.recorded import NO_RATE, RATE_OF_FILE, TOO_LONG, Decoded

DBC = """VERSION ""
NS_ :
BS_:
BU_: A

BO_ 256 PLAIN: 1 A
 SG_ X : 0|8@1+ (1,0) [0|255] "" A

BO_ 257 LONG: 64 A
 SG_ LAST : 504|8@1+ (1,0) [0|255] "" A

"""
RATES = """BA_DEF_ "Baudrate" INT 0 10000000;
BA_DEF_ "BaudrateCANFD" INT 0 10000000;
BA_DEF_DEF_ "Baudrate" 0;
BA_DEF_DEF_ "BaudrateCANFD" 0;
BA_ "Baudrate" 500000;
BA_ "BaudrateCANFD" 2000000;
"""


def decoded(tmp_path, text):
    path = tmp_path / "net.dbc"
    path.write_text(text, encoding="ascii")
    return Decoded(tmp_path / "r.log", [str(path)])


def test_can_fd_frames_are_listed_and_decoded_by_the_dbc_file(tmp_path):
    found = decoded(tmp_path, DBC)
    found.take(("can0", 1_000_000, 256, 1, 7, 0))
    found.take(("can0", 2_000_000, 257, FLAG_FD | FLAG_BRS | 15, 7, 9 << 8 * 59))
    found.done("", 0.0)
    [bus] = found.buses
    long, short = bus.listed(None)
    assert (bus.name, bus.load, found.note()) == ("can0", None, NO_RATE)
    assert (long["name"], long["value"], long["bytes"], long["fd"]) == ("LONG", 9.0, 64, "FD BRS")
    assert (short["name"], short["value"], short["data"]) == ("PLAIN", 7.0, "07")


def test_loads_are_known_where_the_dbc_file_has_the_bit_rates(tmp_path):
    found = decoded(tmp_path, DBC + RATES)
    for number in range(100):  # 2 ms apart: five frames of 64 bytes in 10 ms
        found.take(("can0", 2_000_000 * number, 257, FLAG_FD | FLAG_BRS | 15, 0x55555555, int("55" * 60, 16)))
    found.done("", 0.0)
    [bus] = found.buses
    content = bus.content(0.15, 0.2)
    assert found.note() == RATE_OF_FILE and content["rates"] == [500_000, 2_000_000]
    # without stuff bits 26 nominal bits (17 up to BRS, 9 at the end), an intermission of 3, and 550 bits of data
    # (5, 512, CRC field 32, CRC delimiter); the identifier 0x101 has one stuff bit
    assert content["load"] == pytest.approx(5 * ((26 + 3 + 1) * 2e-6 + 550 * 0.5e-6) / 10e-3 * 100, rel=0.01)
    assert content["frames_per_s"] is None and len(bus.channels()) == 1


def test_a_recording_of_classic_frames_has_the_usual_note(tmp_path):
    found = decoded(tmp_path, DBC)
    found.take(("can0", 1_000_000, 256, 1, 7, 0))
    found.done("", 0.0)
    assert found.note() == NO_RATE and "fd" not in found.buses[0].listed(None)[0]


def test_frames_years_apart_have_no_load_and_take_no_memory_for_it(tmp_path):
    found = decoded(tmp_path, DBC + RATES)
    for time_ns in (1_000_000, 2_459_565_876_000_000_000):
        found.take(("can0", time_ns, 256, 1, 7, 0))
    found.done("", 0.0)
    [bus] = found.buses
    assert found.note() == TOO_LONG and bus.load is None and len(bus.listed(None)) == 2
