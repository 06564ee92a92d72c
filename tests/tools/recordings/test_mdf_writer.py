"""Measurement files that grow: other people's reader finds every row, also when the writer never came to its end."""

import warnings

import numpy as np
import pytest

from ranger_sim.foundation import systems
from ranger_sim.tools.recordings import mdf_writer
from ranger_sim.tools.recordings.mdf_writer import Channel, Group, MdfWriter

BODY = Group("body", (Channel("x", "m", "where it is", "<f8"), Channel("n", "", "", "<i4")))
FLAG = Group("FLAG", (Channel("FLAG", "1", "a <word> & more", "<u4"),))


def rows_of(group, count, begin=0):
    rows = np.zeros(count, dtype=group.dtype)
    rows["time_s"] = 0.002 * np.arange(begin, begin + count)
    rows["value_0"] = np.arange(begin, begin + count) * (0.5 if group is BODY else 1)
    if group is BODY:
        rows["value_1"] = -np.arange(begin, begin + count)
    return rows


def read(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # deprecations of asammdf's own dependencies
        from asammdf import MDF

        with MDF(path) as file:
            signals = {name: file.get(name) for name in ("x", "n", "FLAG")}
            names = [group.channel_group.acq_name for group in file.groups]
            return signals, names, file.header.comment


def test_what_was_written_is_read_with_names_units_and_comments(tmp_path, monkeypatch):
    monkeypatch.setattr(mdf_writer, "COLLECTED_ROWS", 7)  # so that many blocks hang together
    writer = MdfWriter(tmp_path / "a.mf4", [BODY, FLAG], {"controller": "r<2>&", "seed": "3"})
    for begin in range(0, 100, 5):
        writer.append(0, rows_of(BODY, 5, begin))
    writer.append(1, rows_of(FLAG, 3))
    writer.close()
    signals, names, comment = read(tmp_path / "a.mf4")
    assert names == ["body", "FLAG"]
    assert "r<2>&" in comment or "r&lt;2&gt;&amp;" in comment
    expected = rows_of(BODY, 100)
    for name, field in (("x", "value_0"), ("n", "value_1")):
        assert np.array_equal(signals[name].samples, expected[field])
        assert np.array_equal(signals[name].timestamps, expected["time_s"])
    assert (signals["x"].unit, signals["x"].comment) == ("m", "where it is")
    assert signals["n"].samples.dtype == np.int32 and signals["FLAG"].samples.dtype == np.uint32
    assert signals["FLAG"].samples.tolist() == [0, 1, 2] and signals["FLAG"].comment == "a <word> & more"


def test_a_writer_that_was_killed_leaves_every_row_that_it_flushed(tmp_path):
    writer = MdfWriter(tmp_path / "a.mf4", [BODY, FLAG], {})
    writer.append(0, rows_of(BODY, 9))
    writer.flush()
    writer.append(0, rows_of(BODY, 9, 9))  # these were only collected
    writer.abandon()
    signals, _, _ = read(tmp_path / "a.mf4")
    assert signals["x"].samples.tolist() == rows_of(BODY, 9)["value_0"].tolist()
    assert len(signals["FLAG"].samples) == 0


@pytest.mark.parametrize("room", [100, 140, 700])
def test_a_full_disk_leaves_the_rows_that_fitted(tmp_path, monkeypatch, room):
    """Wherever the disk ends: within compressed rows, within the block that lists them, or in a later one."""
    path = tmp_path / "a.mf4"
    writer = MdfWriter(path, [BODY, FLAG], {})
    end, real = writer.end + room, systems.write_at

    def pwrite(file, data, at):
        if at >= end:
            raise OSError(28, "No space left on device")
        return real(file, data[: end - at], at)

    monkeypatch.setattr(systems, "write_at", pwrite)
    written = 0
    with pytest.raises(OSError, match="No space left"):
        for begin in range(0, 100, 10):
            writer.append(0, rows_of(BODY, 10, begin))
            writer.flush()
            written += 10
    writer.abandon()
    monkeypatch.undo()
    signals, _, _ = read(path)
    assert written < 100 and signals["n"].samples.tolist() == [-number for number in range(written)]
