"""`can-bounds` and `check-bus` as people type them: tables, JSON, exit codes, mistakes."""

import json

import pytest

from ranger_sim.can_bus.bounds import response_times
from ranger_sim.can_bus.edge.dbc import read_messages
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools import cli
from ranger_sim.tools.cli import main

DBC = """VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 1 First: 7 A
 SG_ x : 0|8@1+ (1,0) [0|0] "" B
BO_ 2 Second: 7 A
 SG_ x : 0|8@1+ (1,0) [0|0] "" B
BO_ 2147483651 Third: 7 B
 SG_ x : 0|8@1+ (1,0) [0|0] "" A
BO_ 4 Silent: 8 B
 SG_ x : 0|8@1+ (1,0) [0|0] "" A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 100000;
BA_DEF_ "Baudrate" INT 0 1000000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "Baudrate" 0;
BA_ "Baudrate" 125;
BA_ "GenMsgCycleTime" BO_ 1 4;
BA_ "GenMsgCycleTime" BO_ 2 6;
BA_ "GenMsgCycleTime" BO_ 2147483651 20;
"""


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "net.dbc"
    path.write_text(DBC, encoding="utf-8")
    return path


def printed(capsys, *arguments):
    code = main(list(map(str, arguments)))
    return code, capsys.readouterr().out


@pytest.mark.parametrize(("reported", "rate"), [(10, 10_000), (125, 125_000), (9_999, 9_999_000), (10_000, 10_000)])
def test_a_bit_rate_below_any_bus_s_is_in_kbit_s(dbc, reported, rate):
    dbc.write_text(DBC.replace('BA_ "Baudrate" 125;', f'BA_ "Baudrate" {reported};'), encoding="utf-8")
    assert read_messages(dbc, None).bit_rate == rate
    assert read_messages(dbc, 500_000).bit_rate == 500_000  # what is asked for comes first


@pytest.mark.parametrize("reported", [0, -1])
def test_a_bit_rate_of_nothing_is_none(dbc, reported):
    dbc.write_text(DBC.replace('BA_ "Baudrate" 125;', f'BA_ "Baudrate" {reported};'), encoding="utf-8")
    with pytest.raises(UserError, match="--bit-rate"):
        read_messages(dbc, None)


def test_messages_without_a_cycle_time_are_distinguished(dbc):
    found = read_messages(dbc, None)
    assert [(one.name, one.period_ns, one.deadline_ns) for one in found.messages] == [
        ("First", 4_000_000, 4_000_000),
        ("Second", 6_000_000, 6_000_000),
        ("Third", 20_000_000, 20_000_000),
    ]
    assert found.silent == ["Silent"]


def test_the_robots_own_buses_meet_their_bounds_and_are_printed_as_tables(capsys):
    code, text = printed(capsys, "can-bounds")
    assert code == 0
    for bus in ("can1", "can2", "can3", "can4"):
        assert f"{bus}: 3 Mbit/s, schedule full" in text
    assert text.count("every deadline met") == 4 and "MCH_ANGLE" in text


def test_a_profile_is_analysed_with_its_rates_and_schedules(capsys):
    code, text = printed(capsys, "can-bounds", "--profile", "hil-1mbit", "--json", "-")
    found = json.loads(text)
    assert code == 0 and found["met"]
    assert {(bus["bit_rate"], bus["schedule"]) for bus in found["buses"]} == {(1_000_000, "1mbit")}
    angle = next(frame for frame in found["buses"][0]["frames"] if frame["name"] == "MCH_ANGLE")
    assert (angle["identifier"], angle["period_ms"], angle["board"]) == (14, 4.0, "MCH")
    assert angle["response_ms"] < angle["deadline_ms"] == 4.0


def test_a_profile_that_is_too_slow_leaves_with_1_and_says_what_is_late(capsys, tmp_path):
    path = tmp_path / "slow.toml"
    path.write_text("[buses.can4]\nbit_rate = 1000000\n", encoding="utf-8")
    code, text = printed(capsys, "can-bounds", "--profile", path)
    assert code == 1 and "can miss their deadlines" in text and "late" in text


def test_a_dbc_file_gives_its_messages_rate_and_what_it_lacks(dbc):
    found = read_messages(dbc, None)
    messages, rate, silent = found.messages, found.bit_rate, found.silent
    assert (rate, silent) == (125_000, ["Silent"])
    assert [(m.name, m.period_ns, m.bits) for m in messages] == [
        ("First", 4_000_000, 125),
        ("Second", 6_000_000, 125),
        ("Third", 20_000_000, 150),
    ]
    first, second, third = response_times(messages, rate)
    # the extended identifier 3 begins with eleven zeros, so it wins against 1 and 2
    assert (third.response_ns, first.response_ns, second.response_ns) == (2_200_000, 3_200_000, 3_200_000)


def test_a_dbc_file_on_the_command_line(capsys, dbc, tmp_path):
    code, text = printed(capsys, "can-bounds", "--dbc", dbc, "--json", tmp_path / "b.json")
    assert code == 0 and "left out: Silent" in text
    found = json.loads((tmp_path / "b.json").read_text(encoding="utf-8"))
    assert [frame["identifier"] for frame in found["buses"][0]["frames"]] == [1, 2, 3]
    assert main(["can-bounds", "--dbc", str(dbc), "--bit-rate", "50000"]) == 1


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("nonsense", "not a DBC file"),
        (DBC.replace('BA_ "Baudrate" 125;', ""), "--bit-rate"),
        (DBC.replace("Second: 7", "Second: 64"), "message Second is of CAN FD"),
        ('VERSION ""\nBU_: A\nBO_ 4 Silent: 8 A\n', "--bit-rate"),
        ("\0\0\0", "not a DBC file"),
    ],
)
def test_a_dbc_file_that_is_none_gets_one_line(capsys, tmp_path, content, words):
    path = tmp_path / "bad.dbc"
    path.write_text(content, encoding="utf-8")
    assert main(["can-bounds", "--dbc", str(path)]) == 2
    error = capsys.readouterr().err
    assert words in error and "bad.dbc" in error and len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["can-bounds", "--profile", "nobody"], ["nobody", "hil-1mbit"]),
        (["can-bounds", "--dbc", "no-such.dbc"], ["no-such.dbc"]),
        (["can-bounds", "--bit-rate", "125000"], ["--bit-rate", "--dbc"]),
        (["check-bus", "nobody"], ["nobody", "hil-1mbit"]),
        (["walk", "--profile", "nobody"], ["nobody", "hil-1mbit"]),
    ],
)
def test_a_mistake_gets_one_line(capsys, arguments, words):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert all(word in error for word in words) and len(error.splitlines()) == 1


def test_every_fault_of_a_profile_gets_a_line(capsys, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text('[boards]\nMB = "external"\nMCH = "real"\n', encoding="utf-8")
    assert main(["check-bus", str(path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and "boards.MCH = 'real'" in lines[0] and "has no CAN" in lines[1]


def test_a_walk_needs_every_board(capsys, tmp_path):
    path = tmp_path / "part.toml"
    path.write_text('[boards]\nUI = "absent"\n', encoding="utf-8")
    assert main(["walk", "--steps", "1", "--profile", str(path)]) == 2
    assert "UI absent" in capsys.readouterr().err


def test_check_bus_prints_what_mends_a_missing_interface(capsys, tmp_path, monkeypatch):
    from ranger_sim.can_bus.edge import check_bus

    def nothing(_):
        raise check_bus.NotReadError(check_bus.NO_DEVICE)

    monkeypatch.setattr(check_bus.check_link, "__defaults__", (nothing,))
    path = tmp_path / "mine.toml"
    path.write_text('[buses.can1]\ninterface = "socketcan"\nchannel = "vcan0"\n', encoding="utf-8")
    code, text = printed(capsys, "check-bus", path)
    assert code == 1
    assert "FAIL there" in text and "mend: ip link add dev vcan0 type vcan" in text
    assert text.count("emulated inside") == 3


def test_check_bus_opens_what_is_not_socketcan_and_listens(capsys, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[buses.can2]\ninterface = "virtual"\nchannel = "check"\n', encoding="utf-8")
    code, text = printed(capsys, "check-bus", path, "--listen", "10ms", "--json", "-")
    found = json.loads(text)
    assert code == 0 and found["ready"]
    (traffic,) = found["buses"][1]["findings"]
    assert traffic["what"] == "traffic" and traffic["ok"] is None


def test_the_commands_are_in_the_help(capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    text = capsys.readouterr().out
    assert "can-bounds" in text and "check-bus" in text


FD_DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 1 Fast: 64 A
BO_ 2 Slow: 12 A
BO_ 3 Plain: 8 A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 100000;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_ BO_ "CANFD_BRS" ENUM "0","1";
BA_DEF_ "Baudrate" INT 0 10000000;
BA_DEF_ "BaudrateCANFD" INT 0 10000000;
BA_DEF_DEF_ "GenMsgCycleTime" 10;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "CANFD_BRS" "1";
BA_DEF_DEF_ "Baudrate" 500;
BA_DEF_DEF_ "BaudrateCANFD" 2000;
BA_ "VFrameFormat" BO_ 1 2;
BA_ "VFrameFormat" BO_ 2 2;
BA_ "CANFD_BRS" BO_ 2 0;
BA_ "Baudrate" 500;
BA_ "BaudrateCANFD" 2000;
"""


def test_a_dbc_file_with_can_fd_messages_is_analysed_with_both_rates(capsys, tmp_path):
    """Lengths as in tests/can_bus/test_bounds.py: 32 nominal and 680 data bits of the frame of 64 bytes."""
    path = tmp_path / "fd.dbc"
    path.write_text(FD_DBC, encoding="utf-8")
    found = read_messages(path, None)
    assert (found.bit_rate, found.data_bit_rate) == (500_000, 2_000_000)
    fast, slow, plain = found.messages
    assert (fast.bits, fast.data_bits, slow.data_bits, plain.bits, plain.data_bits) == (32, 680, 0, 135, 0)
    code, text = printed(capsys, "can-bounds", "--dbc", path)
    assert code == 0 and "fd.dbc: 0.5 and 2 Mbit/s" in text
    assert read_messages(path, None, 4_000_000).data_bit_rate == 4_000_000


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('BA_ "BaudrateCANFD" 2000;', "", "message Fast is of CAN FD, and the file has no data bit rate"),
        ('BA_ "BaudrateCANFD" 2000;', 'BA_ "BaudrateCANFD" 250;', "data bit rate 250000 bit/s is below the bit rate"),
        ("Fast: 64", "Fast: 65", "message Fast has 65 bytes; a CAN FD frame has at most 64"),
    ],
)
def test_can_fd_messages_that_cannot_be_are_refused_by_name(tmp_path, old, new, words):
    path = tmp_path / "fd.dbc"
    path.write_text(FD_DBC.replace(old, new), encoding="utf-8")
    with pytest.raises(UserError, match=rf"fd.dbc: {words}"):
        read_messages(path, None)


def test_a_data_bit_rate_goes_with_a_dbc_file(capsys):
    assert main(["can-bounds", "--data-bit-rate", "2000000"]) == 2
    assert "--data-bit-rate goes with --dbc" in capsys.readouterr().err
