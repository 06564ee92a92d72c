"""`ranger-sim new DIR --from FILE.dbc`: boards for the nodes of a DBC file of another author."""

import pathlib
import re
import subprocess
import sys

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.new import from_dbc
from tests.firmware_sim.native.support import COMPILER
from tests.ranger.testing.project import environment, how_to_find_the_plugin

TWO_NODES = """VERSION ""
NS_ :
BS_:
BU_: ENGINE GEARBOX
BO_ 256 EngineData: 4 ENGINE
 SG_ Speed : 0|16@1+ (0.25,0) [0|16000] "rpm" GEARBOX
 SG_ Torque : 16|16@1- (0.1,0) [-3000|3000] "Nm" GEARBOX
BO_ 2566840064 GearState: 8 GEARBOX
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" ENGINE
 SG_ Gear m2 : 8|8@1+ (1,0) [0|255] "" ENGINE
 SG_ Oil m5 : 8|8@1+ (1,-40) [-40|215] "C" ENGINE
BO_ 800 Request: 1 GEARBOX
 SG_ Wanted : 0|8@1+ (1,0) [0|255] "" ENGINE
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_ "Baudrate" INT 0 1000000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "Baudrate" 250000;
BA_ "Baudrate" 250000;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 2566840064 100;
"""


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "Drive Train.dbc"
    path.write_text(TWO_NODES)
    return path


def altered(dbc, old, new):
    assert old in dbc.read_text()
    dbc.write_text(dbc.read_text().replace(old, new))
    return dbc


def test_nodes_messages_and_cycle_times_are_those_of_the_file(dbc):
    network = from_dbc.read(dbc, None)
    assert (network.stem, network.bit_rate, network.nodes) == ("drive_train", 250_000, ("ENGINE", "GEARBOX"))
    assert [(each.name, each.identifier, each.extended, each.period_ms) for each in network.messages] == [
        ("EngineData", 0x100, False, 10),
        ("GearState", 0x18FEDF00, True, 100),
        ("Request", 0x320, False, 0),
    ]
    assert network.messages[1].multiplexers == (("page", 2),)  # the start value 0 selects no signal
    assert network.left_out == ()


@pytest.mark.parametrize(
    ("bit_rate", "register"),
    # NXP UM10114, CAN chapter: TSEG2 bits 22-20, TSEG1 19-16, SJW 15-14, BRP 9-0, each one less than its value
    [(500_000, 0x002B8007), (250_000, 0x002B800F), (1_000_000, 0x002B8003), (3_000_000, 0x003E8000 | 3 << 14)],
)
def test_the_timing_register_divides_the_clock_to_the_bit_rate(bit_rate, register):
    found = from_dbc.timing_register(bit_rate)
    prescaler, first, second = (found & 0x3FF) + 1, (found >> 16 & 15) + 1, (found >> 20 & 7) + 1
    assert bit_rate * prescaler * (1 + first + second) == 60_000_000
    assert 0.75 <= (1 + first) / (1 + first + second) <= 0.85
    assert (found >> 14 & 3) + 1 <= second


def test_a_bit_rate_that_the_clock_cannot_be_divided_to_is_refused(dbc, tmp_path, capsys):
    assert cli.main(["new", str(tmp_path / "x"), "--from", str(dbc), "--bit-rate", "499999"]) == 2
    assert "bit rate 499999 bit/s: a clock of 60000000 Hz" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('GenMsgCycleTime" BO_ 256 10', 'GenMsgCycleTime" BO_ 256 0', ""),
        ("BO_ 256 10;", 'BO_ 256 1;\nBA_ "Baudrate" 50000;', "its cyclic messages are 1[0-9]{2} % of 50000 bit/s"),
        ("BO_ 256 EngineData: 4", "BO_ 256 EngineData: 12", "left out: EngineData: 12 bytes, CAN FD"),
        ("BO_ 800 Request", "BO_ 800 Engine_Data", "left out: Engine_Data: another message has the name engine_data"),
        ("BU_: ENGINE", "BU_ ENGINE", "not a DBC file that cantools can read"),
        ("BU_: ENGINE GEARBOX", "BU_: ENGINE Engine", "not a DBC file|2 boards"),
    ],
)
def test_what_does_not_fit_is_left_out_by_name_or_refused_in_one_line(dbc, tmp_path, capsys, old, new, line):
    code = cli.main(["new", str(tmp_path / "x"), "--from", str(altered(dbc, old, new))])
    printed = capsys.readouterr()
    assert code in (0, 2) and (code == 0) == (tmp_path / "x").exists()
    assert re.search(line, printed.out + printed.err)
    assert len(printed.err.splitlines()) == (code == 2)


def test_a_message_without_a_sender_is_sent_by_a_board_that_the_file_does_not_name(dbc):
    altered(dbc, "BO_ 800 Request: 1 GEARBOX", "BO_ 800 Request: 1 Vector__XXX")
    assert from_dbc.read(dbc, None).messages[2].sender == "TESTER"
    altered(dbc, "GEARBOX", "Tester")
    assert from_dbc.read(dbc, None).messages[2].sender == "TESTER_2"


def test_a_single_node_gets_another_one_that_acknowledges(dbc):
    altered(dbc, " GEARBOX", " ENGINE")
    assert from_dbc.read(dbc, None).nodes == ("ENGINE", "TESTER")


def test_what_the_file_does_not_state_is_a_comment_at_its_place(dbc):
    program = from_dbc.program(from_dbc.read(dbc, None), "GEARBOX")
    assert re.search(r"send_request_message, 0, 0, 0\}, /\* TODO: the DBC file has no cycle time", program)
    assert "TODO: fill gear_state_message with the values that this board measures" in program


def test_the_dbc_file_is_copied_byte_for_byte(dbc, tmp_path):
    """Tools write these files as Windows-1252, and cantools reads them as that."""
    dbc.write_bytes(dbc.read_text().replace('"C" ENGINE', '"\N{DEGREE SIGN}C" ENGINE').encode("cp1252"))
    assert cli.main(["new", str(tmp_path / "net"), "--from", str(dbc)]) == 0
    assert (tmp_path / "net" / "drive_train.dbc").read_bytes() == dbc.read_bytes()


@pytest.mark.skipif(not COMPILER, reason="no C compiler here")
def test_the_tests_of_the_project_pass_and_fail_when_a_board_sends_late(dbc, tmp_path):
    project = tmp_path / "drive"
    assert cli.main(["new", str(project), "--from", str(dbc)]) == 0
    assert not [path for path in project.rglob("*") if path.is_file() and "[%" in path.read_text()]

    def tested():
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *how_to_find_the_plugin()]
        return subprocess.run(command, cwd=project, env=environment(), capture_output=True, text=True, check=False)

    done = tested()
    assert done.returncode == 0 and "3 passed" in done.stdout, done.stdout
    source = project / "engine" / "engine.c"
    source.write_text(source.read_text().replace("{send_engine_data_message, 10,", "{send_engine_data_message, 15,"))
    done = tested()
    assert done.returncode == 1 and "EngineData on can1: allowed is 10 ms" in done.stdout, done.stdout


def test_the_robots_own_messages_make_a_project(tmp_path):
    robots = pathlib.Path(__file__).parents[2] / "datatable" / "generated" / "can1.dbc"
    network = from_dbc.read(robots, 3_000_000)
    files = from_dbc.files(network, "hip", robots)
    assert {"MCH", "CSR"} <= set(network.nodes) and {"mch/mch.c", "csr/csr.c"} <= set(files)
