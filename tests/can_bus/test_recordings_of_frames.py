"""Every frame that a recording has comes out or is accounted for, whatever program wrote the file."""

import itertools

import can
import pytest

from ranger_sim.can_bus.edge import log_kinds, logs
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError
from tests.boards.original_images import DATA

CASES = DATA.parent / "cases"
needs_cases = pytest.mark.skipif(not (CASES / "13-asc-variants").exists(), reason=f"no cases in {CASES.name}/")
MS = 1_000_000
# what all files of the cases hold: six frames, 10 ms apart
WORDS = [(0x123, 8, 10 * n, 3 * n) for n in range(6)]


def recorded(path):
    """(frames, how many the file has, what was lost)."""
    log = logs.read_log(path)
    return list(log), log.read, log.losses


def check_six(path):
    found, read, losses = recorded(path)
    assert [frame[2:] for frame in found] == WORDS and (read, losses) == (6, [])
    assert [b[1] - a[1] for a, b in itertools.pairwise(found)] == [10 * MS] * 5


def messages(count=400):
    return [
        can.Message(timestamp=1000.0 + 0.01 * n, arbitration_id=0x123, data=bytes([n % 256] * 8), is_extended_id=False,
                    channel=0)
        for n in range(count)
    ]  # fmt: skip


def written(path, count=400):
    with can.Logger(path) as writer:
        for message in messages(count):
            writer.on_message_received(message)
    return path


# ---- files that are cut off


@pytest.mark.parametrize("suffix", [".blf", ".asc", ".trc", ".csv", ".log"])
def test_a_whole_file_has_as_many_frames_as_were_written(tmp_path, suffix):
    found, read, losses = recorded(written(tmp_path / f"a{suffix}"))
    assert (len(found), read, losses) == (400, 400, [])


@pytest.mark.parametrize("share", [0.3, 0.5, 0.9])
def test_a_blf_that_is_cut_off_says_how_many_frames_it_lacks(tmp_path, share):
    content = written(tmp_path / "a.blf", 4000).read_bytes()
    cut = tmp_path / "cut.blf"
    cut.write_bytes(content[: int(share * len(content))])
    found, read, losses = recorded(cut)
    ((reason, count, where),) = losses
    assert (reason, read, len(found) + count) == ("cut_off", 4000, 4000) and 0 < len(found) < 4000
    assert where == f"behind byte {int(share * len(content))} of {len(content)}"


@pytest.mark.parametrize("suffix", [".asc", ".csv", ".log"])
def test_a_text_that_ends_within_a_line_lacks_one_frame(tmp_path, suffix):
    path = written(tmp_path / f"a{suffix}")
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    last = max(number for number, line in enumerate(lines) if "8" in line and ("123" in line))
    torn = lines[last][: lines[last].index("123") + 5 if suffix != ".csv" else 20]
    path.write_text("".join(lines[:last]) + torn)
    found, read, losses = recorded(path)
    assert len(found) == 399
    assert read == 400 and [each[:2] for each in losses] in ([("cut_off", 1)], [("not_frames", 1)])


def test_a_torn_line_in_the_middle_is_named(tmp_path):
    for suffix in (".asc", ".csv", ".log"):
        path = written(tmp_path / f"a{suffix}")
        lines = path.read_text().splitlines(keepends=True)
        lines[100] = lines[100][:20] + "?\n"
        path.write_text("".join(lines))
        try:
            found, read, losses = recorded(path)
        except UserError as error:
            assert f"{path}:101: " in str(error)
        else:
            assert len(found) + sum(count for _, count, _ in losses) == read == 400 and "line 101" in losses[0][2]


@pytest.mark.parametrize(
    ("stamps", "times_ms"),
    [
        (("0.000000", "0.010000", "0.010000", "0.020000"), [0, 10, 10, 20]),  # since the first, two at one time
        (("0.000000", "0.010000", "0.005000", "0.020000"), [0, 10, 15, 35]),  # since the one before
    ],
)
def test_stamps_on_candumps_screen_are_since_the_one_before_only_where_one_decreases(tmp_path, stamps, times_ms):
    path = tmp_path / "screen.log"
    path.write_text("".join(f" ({stamp})  can1  123   [1]  0A\n" for stamp in stamps))
    found, read, losses = recorded(path)
    assert [frame[1] for frame in found] == [time * MS for time in times_ms] and (read, losses) == (4, [])


# ---- ASC

HEAD = "date Thu Nov 5 09:30:00.000 am 2026\nbase hex  timestamps absolute\ninternal events logged\n"


def test_an_asc_without_the_line_that_ends_the_header_keeps_its_first_frame(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text("date Thu Nov 5 09:30:00.000 am 2026\nbase hex  timestamps absolute\n 0.5 1  123 Rx   d 1 01\n")
    assert recorded(path) == ([("0", 500 * MS, 0x123, 1, 1, 0)], 1, [])


def test_relative_stamps_of_an_asc_are_since_the_line_before(tmp_path):
    path = tmp_path / "a.asc"
    lines = " 0.5 1  123 Rx   d 1 01\n 0.25 1  Statistic: D 0 R 1\n 0.125 1  123 Rx   d 1 02\n"
    path.write_text(HEAD.replace("absolute", "relative") + lines)
    assert [frame[1] for frame in recorded(path)[0]] == [500 * MS, 875 * MS]
    path.write_text(HEAD + lines)
    assert [frame[1] for frame in recorded(path)[0]] == [500 * MS, 125 * MS]


def test_a_line_of_a_frame_that_the_library_passes_over_is_counted(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(HEAD + " 0.5 1  123 Rx   d 1 01\n 0.6 1  12-3 Rx   d 1 01\n 0.7 1  123 Rx   d 1 02\n")
    with pytest.raises(UserError, match=r"a.asc:5: 12-3 is a name where an identifier is expected"):
        recorded(path)
    trc = written(tmp_path / "a.trc", 50)
    lines = trc.read_text().splitlines(keepends=True)
    lines[-10] = lines[-10][:45] + "\n"  # without data
    trc.write_text("".join(lines))
    found, read, losses = recorded(trc)
    assert (len(found), read) == (49, 50) and losses[0][:2] == ("not_frames", 1)


@needs_cases
def test_the_cases_of_asc_are_read_whole_or_refused_with_the_true_reason():
    folder = CASES / "13-asc-variants"
    check_six(folder / "r_relative.asc")
    check_six(folder / "v_busmaster.asc")
    with pytest.raises(UserError, match="t_symbolic.asc:7: DRIVE is a name where an identifier is expected"):
        recorded(folder / "t_symbolic.asc")
    check_six(folder / "w_startmeas.asc")  # frames of CAN FD with eight bytes


# ---- what other programs write


@needs_cases
@pytest.mark.parametrize("name", ["b_candump_human.log", "c_candump_humanA.log", "u_busmaster.log", "x_savvy.csv"])
def test_the_cases_of_other_programs_are_read(name):
    check_six(CASES / "12-candump-screen" / name)


def test_what_candump_shows_is_read_with_each_of_its_stamps(tmp_path):
    path = tmp_path / "a.log"
    stamps = {
        "ta": ["(1600000000.500000)", "(1600000000.750000)", "(1600000001.000001)"],
        "tA": ["(2020-09-13 12:26:40.500000)", "(2020-09-13 12:26:40.750000)", "(2020-09-13 12:26:41.000001)"],
        "tz": ["(000.000000)", "(000.250000)", "(000.500001)"],
        "td": ["(000.300000)", "(000.250000)", "(000.250001)"],
    }
    for each in stamps.values():
        first, second, third = each
        path.write_text(
            f" {first}  can0  123   [2]  0A 00\n {second}  can1  1ABCDEF0   [3]  01 02 03   '...'\n"
            f" {third}  can0  123   [0]  remote request\n"
        )
        found, read, losses = recorded(path)
        assert [(bus, *words) for bus, _, *words in found] == [
            ("can0", 0x123, 2, 10, 0), ("can1", 0x1ABCDEF0, 3 | FLAG_EXTENDED, 0x30201, 0),
            ("can0", 0x123, FLAG_REMOTE, 0, 0),
        ]  # fmt: skip
        assert [b[1] - a[1] for a, b in itertools.pairwise(found)] == [250 * MS, 250_001_000] and (read, losses) == (
            3,
            [],
        )
    path.write_text("  can0  123   [2]  0A 00\n")
    with pytest.raises(UserError, match="a.log:1: frames without stamps: candump shows them with -ta"):
        recorded(path)
    path.write_text(" (1.0)  can0  123   [2]  0A\n (1.1)  can0  123   [2]  0A 00\n")
    with pytest.raises(UserError, match=r"a.log:1: frame 123 has 2 bytes and the data '0A'"):
        recorded(path)


def test_extended_and_remote_frames_of_busmaster_and_savvycan(tmp_path):
    path = tmp_path / "a.log"
    path.write_text(
        "***BUSMASTER Ver 3.2.2***\n***HEX***\n00:00:01:0005 Rx 2 0x1ABCDEF0 x 1 FF\n00:00:02:0000 Tx 1 0x7 sr 2\n"
    )
    assert recorded(path)[0] == [
        ("2", 1_000_500_000, 0x1ABCDEF0, 1 | FLAG_EXTENDED, 0xFF, 0), ("1", 2000 * MS, 7, 2 | FLAG_REMOTE, 0, 0)
    ]  # fmt: skip
    path.write_text(
        "***BUSMASTER Ver 2.4.0***\n***HEX***\n22:20:14:8 Rx 0 0000021A s 1 FE \n22:20:14:992 Rx 0 00000210 s 0 \n"
    )
    assert [frame[1] % 1_000_000_000 for frame in recorded(path)[0]] == [8 * MS, 992 * MS]  # version 2 writes ms
    path.write_text("***BUSMASTER Ver 3.2.2***\n***DEC***\n00:00:01:0005 Rx 2 7 s 1 255\n")
    with pytest.raises(UserError, match="a.log: BUSMASTER's log in decimal numbers"):
        recorded(path)
    table = tmp_path / "a.csv"
    table.write_text(
        "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n5,1ABCDEF0,true,Rx,1,2,FF,01,,,,,,,\n"
    )
    assert recorded(table)[0] == [("1", 5000, 0x1ABCDEF0, 2 | FLAG_EXTENDED, 0x1FF, 0)]
    table.write_text("Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n5,xyz,true,Rx,1,2,FF,01\n")
    with pytest.raises(UserError, match=r"a.csv:2: not a frame as SavvyCAN writes it"):
        recorded(table)


def test_a_table_of_frames_is_known_by_its_header(tmp_path):
    assert log_kinds.kind(written(tmp_path / "a.csv", 3)) == log_kinds.PYTHON_CAN
    other = tmp_path / "b.csv"
    other.write_text("t_s,voltage_V\n0,1\n")
    assert log_kinds.kind(other) == ""
    with pytest.raises(UserError, match="b.csv: a .csv of frames begins with 'timestamp,arbitration_id"):
        recorded(other)


def test_a_data_base_that_is_not_there_is_not_made(tmp_path):
    with pytest.raises(UserError, match=r"none.db: the recording cannot be read \(no such file\)"):
        recorded(tmp_path / "none.db")
    assert not (tmp_path / "none.db").exists()
