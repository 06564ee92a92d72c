"""TDMS, HDF5, MATLAB, Parquet and packet captures as channels: units, several times in one file, what is left out."""

import struct

import numpy as np
import pytest
import scipy.io

from ranger_sim.can_bus.edge.logs import read_log
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.reading import read

T = 0.01 * np.arange(200)
U, I = np.sin(3.0 * T), 0.5 * np.cos(5.0 * T)  # noqa: E741, the letter of a current
BEGIN = np.datetime64("2026-11-05T09:30:00")


def kinds(measurement):
    return [(each.kind, each.severity) for each in measurement.findings if each.kind != "no_unit"]


# --- TDMS -------------------------------------------------------------------------------------------------------


@pytest.fixture
def tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")

    def write(*channels):
        with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
            writer.write_segment([nptdms.ChannelObject(*each) for each in channels])
        return tmp_path / "a.tdms"

    return write


def test_waveforms_of_tdms_have_their_own_rates_and_one_beginning(tdms):
    later = {"wf_increment": 0.02, "wf_start_time": BEGIN + np.timedelta64(500, "ms"), "unit_string": "mA"}
    path = tdms(
        ("g", "u", U, {"wf_increment": 0.01, "wf_start_time": BEGIN, "unit_string": "V"}), ("g", "i", I[:100], later)
    )
    measurement = read(path)
    assert measurement["u"].unit == "V" and measurement["u"].time_s == pytest.approx(T)
    assert measurement["i"].value == pytest.approx(1e-3 * I[:100])
    assert measurement["i"].time_s == pytest.approx(0.5 + 0.02 * np.arange(100))


def test_a_time_channel_of_tdms_gives_the_stamps(tdms):
    dates = BEGIN + (1e6 * T).astype("timedelta64[us]")
    measurement = read(tdms(("g", "Time", dates), ("g", "u_V", U), ("g", "remark", ["a", "b"])))
    assert list(measurement.channels) == ["u_V"] and measurement["u_V"].time_s == pytest.approx(T)
    assert kinds(measurement) == [("no_numbers", "note")]
    with pytest.raises(UserError, match="there is no time column among u_V, i_A"):
        read(tdms(("g", "u_V", U), ("g", "i_A", I)))


def test_a_tdms_file_that_is_cut_off_counts_what_is_missing(tdms):
    path = tdms(("g", "u", U, {"wf_increment": 0.01}), ("g", "i", I, {"wf_increment": 0.01}))
    path.write_bytes(path.read_bytes()[:-800])  # a hundred numbers
    measurement = read(path)
    account = measurement.ledger()["channels"][""]
    assert account["left_out"][0]["reason"] == "cut_off" and account["read"] == 400 == account["kept"] + 100
    assert "its last segment lacks 100 samples" in measurement.matters[0].text


# --- HDF5 -------------------------------------------------------------------------------------------------------


def test_data_sets_of_hdf5_are_channels_by_path_each_at_the_time_of_its_group(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, step_ms, count in (("fast", 10, 200), ("slow", 40, 50)):
            file[f"{name}/time"] = 1_793_871_000_000 + step_ms * np.arange(count)
            file[f"{name}/time"].attrs["units"] = "ms"
            file[f"{name}/u"] = U[:count]
            file[f"{name}/u"].attrs["unit"] = "mV"
        file["slow/time"][:] += 5
        file["rate"], file["remark"], file["slow/odd"] = 100.0, "bench", np.arange(7)
    measurement = read(tmp_path / "a.h5")
    assert measurement["fast.u"].value == pytest.approx(1e-3 * U) and measurement["fast.u"].unit == "V"
    assert measurement["fast.u"].time_s == pytest.approx(T, abs=1e-9)
    assert measurement["slow.u"].time_s == pytest.approx(0.005 + 0.04 * np.arange(50), abs=1e-6)
    (lost,) = [each.text for each in measurement.matters]
    assert "1 arrays have no time of their length and are left out: slow.odd (7)" in lost


def test_packed_numbers_of_netcdf_have_their_scale_and_their_missing_values(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["time"] = T
        file["time"].attrs["units"] = "seconds since 2026-11-05"
        packed = np.round((U + 2.0) / 0.001).astype(np.int16)
        packed[10] = -9999
        file["u_V"] = packed
        file["u_V"].attrs.update({"scale_factor": 0.001, "add_offset": -2.0, "_FillValue": np.int16(-9999)})
    value = read(tmp_path / "a.nc")["u_V"].value
    assert np.isnan(value[10]) and np.delete(value, 10) == pytest.approx(np.delete(U, 10), abs=1e-3)


def test_a_file_of_matlab_7_3_is_read_as_the_hdf5_that_it_is(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in (("t_s", T), ("motor/u_V", U)):
            file[name] = value.reshape(1, -1)
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
        file["title"] = np.frombuffer("bench".encode("utf-16-le"), dtype=np.uint16)
        file["title"].attrs["MATLAB_class"] = np.bytes_("char")
    content = path.read_bytes()
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512, b"\0") + content[512:])
    measurement = read(path)
    assert measurement["motor.u_V"].value == pytest.approx(U) and measurement["motor.u_V"].time_s == pytest.approx(T)


# --- MATLAB and Parquet -----------------------------------------------------------------------------------------


def test_every_element_of_a_structure_has_its_own_time(tmp_path):
    logged = np.zeros(2, dtype=[("time", object), ("values", object)])
    logged[0] = (T, U)
    logged[1] = (2.0 * T[:50] + 0.1, I[:50])
    scipy.io.savemat(tmp_path / "a.mat", {"log": logged, "matrix": np.stack([U, I]), "tout_s": T})
    measurement = read(tmp_path / "a.mat")
    assert measurement["log(1).values"].time_s == pytest.approx(T)
    assert measurement["log(2).values"].time_s == pytest.approx(2.0 * T[:50] + 0.1)
    assert measurement["log(2).values"].value == pytest.approx(I[:50])
    assert measurement["matrix[1]"].value == pytest.approx(I)  # samples lie along the longer side


def test_a_time_without_a_usual_name_is_named_by_mapping(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"ans": np.stack([T, U, I])})
    with pytest.raises(UserError, match=r"--map ans\[0\]=time says which it is \(it rises all the time\)"):
        read(tmp_path / "a.mat")
    measurement = read(tmp_path / "a.mat", mapping={"ans[0]": "t_s", "ans[1]": "u_mV"})
    assert measurement["u_V"].value == pytest.approx(1e-3 * U) and measurement["u_V"].time_s == pytest.approx(T)
    with pytest.raises(UserError, match=r"--map b=...: unknown column \(available: ans\[0\], ans\[1\]"):
        read(tmp_path / "a.mat", mapping={"b": "t_s"})


def test_a_channel_without_any_number_is_a_finding_and_no_traceback(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t_s": T, "u_V": U, "broken_A": np.full(200, np.nan)})
    measurement = read(tmp_path / "a.mat")
    assert ("not_finite", "fatal") in kinds(measurement) and len(measurement["u_V"].value) == 200


def test_stamps_in_days_of_matlab_are_days(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"time": 739_926.4 + T / 86_400.0, "u_V": U})
    measurement = read(tmp_path / "a.mat")
    assert measurement["u_V"].time_s == pytest.approx(T, abs=2e-5)
    assert "739926.4 is taken for days" in measurement.matters[0].text


def test_columns_of_parquet_with_dates_and_with_what_is_not_a_number(tmp_path):
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    dates = BEGIN + (1e6 * T).astype("timedelta64[us]")
    holes = [None if k == 5 else float(u) for k, u in enumerate(U)]
    table = pyarrow.table({"when": dates, "u_mV": holes, "remark": ["a"] * 200})
    parquet.write_table(table, tmp_path / "a.parquet")
    measurement = read(tmp_path / "a.parquet")
    assert list(measurement.channels) == ["u_V"] and np.isnan(measurement["u_V"].value[5])
    assert measurement["u_V"].time_s == pytest.approx(T) and measurement["u_V"].value[6] == pytest.approx(1e-3 * U[6])
    whole = pyarrow.table({"timestamp": 1_793_871_000_000_000_000 + 10_000_000 * np.arange(200), "u_V": U})
    parquet.write_table(whole, tmp_path / "b.parquet")
    assert read(tmp_path / "b.parquet")["u_V"].time_s == pytest.approx(T, abs=1e-12)


def test_a_file_that_the_library_cannot_read_is_one_line(tmp_path):
    pytest.importorskip("h5py")
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(range(64)))
    with pytest.raises(UserError, match="not a HDF5 file that h5py can read"):
        read(tmp_path / "a.h5")


# --- packet captures --------------------------------------------------------------------------------------------

PACKETS = [  # time in ns, SocketCAN's word, data
    (1_000_000_000, 0x123, b"\x01\x02"), (1_500_000_000, 0x80000123, bytes(range(8))), (2_000_001_000, 0x40000123, b""),
    (2_500_000_000, 0x20000004, bytes(8)), (3_000_000_000, 0x123, bytes(12)),
]  # fmt: skip
FRAMES = [
    (1_000_000_000, 0x123, 2, 0x0201), (1_500_000_000, 0x123, 64 | 8, 0x03020100), (2_000_001_000, 0x123, 16, 0),
]  # fmt: skip


def frame(word, data, order=">"):
    return struct.pack(f"{order}IBBxx", word, len(data), 0) + data


def classic(order="<", magic=0xA1B2C3D4, link=227, wrap=lambda packet: packet):
    made = [struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, 65535, link)]
    for time_ns, word, data in PACKETS:
        part = time_ns % 10**9 // (1 if magic == 0xA1B23C4D else 1000)
        content = wrap(frame(word, data, ">" if link == 227 else order))
        made.append(struct.pack(f"{order}IIII", time_ns // 10**9, part, len(content), len(content)) + content)
    return b"".join(made)


def block(kind, body):
    body += bytes(-len(body) % 4)
    return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)


def next_generation():
    name = struct.pack("<HH", 2, 5) + b"vcan0\0\0\0"
    resolution = struct.pack("<HHBxxx", 9, 1, 9)
    made = [
        block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)),
        block(1, struct.pack("<HHI", 227, 0, 0) + name + resolution + struct.pack("<HH", 0, 0)),
    ]
    for time_ns, word, data in PACKETS:
        content = frame(word, data)
        stamp = struct.pack("<II", time_ns >> 32, time_ns & 0xFFFFFFFF)
        head = struct.pack("<I", 0) + stamp + struct.pack("<II", len(content), len(content))
        made.append(block(6, head + content))
    return b"".join(made)


@pytest.mark.parametrize(
    ("content", "bus"),
    [
        (classic(), ""), (classic(">"), ""), (classic("<", 0xA1B23C4D), ""), (next_generation(), "vcan0"),
        (classic(link=113, wrap=lambda packet: struct.pack(">HHH8sH", 1, 280, 0, b"", 0xC) + packet), ""),
        (classic(link=276, wrap=lambda packet: struct.pack(">HHIHBB8s", 0xC, 0, 7, 280, 1, 0, b"") + packet),
         "interface7"),
    ],
    ids=["little", "big", "nanoseconds", "pcapng", "any interface", "any interface, version 2"],
)  # fmt: skip
def test_frames_of_a_packet_capture_are_those_that_were_captured(content, bus, tmp_path):
    path = tmp_path / "a.bin"  # known by its beginning
    path.write_bytes(content)
    log = read_log(path)
    assert [(each[1], *each[2:5]) for each in log] == FRAMES
    assert {each[0] for each in log} == {bus}
    assert log.ledger() == {"frames": 4, "left out: can_fd": 1}  # one of them is an error frame
    path.write_bytes(content[: -30 if bus != "vcan0" else -40])
    assert list(log) and log.losses == [("cut_off", 1, "packet 5")]


def test_a_capture_of_something_else_is_refused_with_its_link_type(tmp_path):
    path = tmp_path / "a.pcap"
    path.write_bytes(classic(link=1))
    with pytest.raises(UserError, match="a capture of link type 1, not of CAN"):
        list(read_log(path))
    dbc = tmp_path / "a.dbc"
    dbc.write_text(
        'VERSION ""\nBU_: A\nBO_ 291 M: 2 A\n SG_ u : 0|16@1+ (0.001,0) [0|0] "V" A\n', encoding="utf-8"
    )  # fmt: skip
    path.write_bytes(classic())
    measurement = read(path, databases=[dbc])
    assert measurement["M.u"].value == pytest.approx([0.513, 0.0])  # the last one of a frame of CAN FD
    lines = {"frames": 2, "remote requests": 1, "unknown identifiers": 1, "error frames": 1}
    assert measurement.ledger()["lines"] == lines
