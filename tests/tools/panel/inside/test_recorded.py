"""Frames of a recording that is read with a DBC file."""

from ranger_sim.foundation.events import FLAG_BRS, FLAG_FD
from ranger_sim.tools.panel.inside.recorded import NO_RATE, Decoded

DBC = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n\nBO_ 256 PLAIN: 1 A\n SG_ X : 0|8@1+ (1,0) [0|255] "" A\n\n'


def test_can_fd_frames_are_counted_and_not_listed(tmp_path):
    path = tmp_path / "net.dbc"
    path.write_text(DBC, encoding="ascii")
    decoded = Decoded(tmp_path / "r.log", [str(path)])
    decoded.take(("can0", 1_000_000, 256, 1, 7, 0))
    decoded.take(("can0", 2_000_000, 256, FLAG_FD | FLAG_BRS | 15, 7, 1 << 400))
    decoded.done("", 0.0)
    [bus] = decoded.buses
    assert bus.name == "can0"
    assert decoded.note() == f"{NO_RATE} CAN FD frames (1) are shown as channels only."


def test_a_recording_of_classic_frames_has_the_usual_note(tmp_path):
    path = tmp_path / "net.dbc"
    path.write_text(DBC, encoding="ascii")
    decoded = Decoded(tmp_path / "r.log", [str(path)])
    decoded.take(("can0", 1_000_000, 256, 1, 7, 0))
    assert decoded.note() == NO_RATE
