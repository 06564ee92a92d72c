"""The computer's side of the data link: known bytes, resynchronisation, what is refused, what is kept."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.boards.main_brain import controllers
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables, errors
from ranger_sim.datatable.packing import error_word
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.robodaq import catalogue, logs, parameter_files
from ranger_sim.tools.robodaq.codec import Point, SegmentDecoder, segment, write_packet
from ranger_sim.tools.robodaq.session import Session
from tests.examples import examples

LAST = all_variables.ID_OF_LAST
ID = all_variables.ID_OF
FAST, MEDIUM = 131072, 65536


def nine(*points):
    """A segment with these points, filled up with values of a parameter that no test looks at."""
    filler = [Point(ID["CTRL_HIP_KP"], word_of_float(25.0), 0)] * (9 - len(points))
    return segment([*points, *filler])


def decoder():
    return SegmentDecoder(LAST)


# --- codec ----------------------------------------------------------------------------------------------


def test_a_known_packet_to_the_robot():
    # id 344 = 0x0158, 4.5 = 0x40900000; 1 + 0x01 + 0x58 + 0x40 + 0x90 = 0x012A
    assert write_packet(344, word_of_float(4.5)) == bytes.fromhex("0158 40900000 012a")


def test_a_known_segment_from_the_robot():
    # nine times id 14 = 0x000E, value 1.0 = 0x3F800000, stamp 0x100: 1 + 9 (0x0E + 0x3F + 0x80 + 0x01) = 0x073F
    data = bytes.fromhex("000e 3f800000 00000100") * 9 + bytes.fromhex("073f")
    assert decoder().feed(data) == [Point(14, 0x3F800000, 0x100)] * 9
    assert segment([Point(14, 0x3F800000, 0x100)] * 9) == data


def test_a_segment_may_come_in_pieces():
    of = decoder()
    data = nine(Point(14, 1, 2))
    got = [point for byte in data for point in of.feed(bytes((byte,)))]
    assert got[0] == (14, 1, 2) and len(got) == 9
    assert (of.segments, of.skipped_bytes, of.bad_checksums) == (1, 0, 0)


def test_a_stream_that_begins_in_the_middle_is_found_and_counts_no_bad_checksum():
    of = decoder()
    data = nine(Point(14, 1, 2))
    got = of.feed(data[50:] + data + data)
    assert len(got) == 18
    assert (of.segments, of.skipped_bytes, of.bad_checksums) == (2, 42, 0)


def test_bytes_lost_in_the_middle_cost_their_segment_and_one_bad_checksum():
    of = decoder()
    stream = [nine(Point(14, n, n)) for n in range(5)]
    got = of.feed(stream[0] + stream[1][:30] + stream[1][33:] + stream[2] + stream[3] + stream[4])
    assert [point.word for point in got if point.number == 14] == [0, 2, 3, 4]
    assert (of.segments, of.skipped_bytes, of.bad_checksums) == (4, 89, 1)


def test_a_right_sum_by_chance_is_not_taken_while_out_of_step():
    of = decoder()
    of.feed(b"\x00")
    false = segment([Point(0x7000, 1, 1)] * 9)
    assert of.feed(false) == [] and of.segments == 0


def test_in_step_an_identifier_beyond_the_table_is_left_out_and_counted():
    of = decoder()
    got = of.feed(nine(Point(14, 1, 2)) + nine(Point(LAST + 1, 1, 2)))
    assert len(got) == 9 + 8 and of.unknown_points == 1 and of.segments == 2


@settings(max_examples=examples(200))
@given(st.lists(st.one_of(st.binary(max_size=200), st.just(nine(Point(14, 7, 8)))), max_size=10))
def test_no_bytes_stop_the_decoder_and_every_byte_is_accounted_for(pieces):
    of = decoder()
    for piece in pieces:
        of.feed(piece)
    total = sum(map(len, pieces))
    assert 92 * of.segments + of.skipped_bytes + len(of.buffer) == total
    assert len(of.buffer) < 92
    # whatever came before: of a clean stream at most one segment is lost
    before = of.segments
    for _ in range(4):
        of.feed(nine(Point(14, 7, 8)))
    assert of.segments >= before + 3


# --- session --------------------------------------------------------------------------------------------


def packets(data):
    assert len(data) % 8 == 0
    return [struct.unpack_from(">HI", data, i) for i in range(0, len(data), 8)]


def echo(session, sent, now=0.0):
    """The robot sends back what was written to it."""
    for number, word in packets(sent):
        session.receive(nine(Point(number, word, 5)), now)


def settle(session, now=0.0):
    for _ in range(10):
        echo(session, session.outgoing(now), now)
    assert session.pending() == []


def test_channels_are_written_as_numbers_time_and_errors_first():
    session = Session()
    session.select([parameters.find("MCH_ANGLE")], [parameters.find("UI_ROLL"), parameters.find("MCH_ANGLE")])
    sent = session.outgoing(0.0)
    first = packets(sent)
    assert len(first) == 40  # never more under way: the robot has room for 499 bytes
    assert first[:5] == [
        (264, word_of_float(0.0 + MEDIUM)),
        (265, word_of_float(172.0 + FAST)),
        (266, word_of_float(14.0 + FAST)),
        (267, word_of_float(ID["UI_ROLL"] + float(MEDIUM))),
        (268, 0),
    ]
    assert session.outgoing(0.1) == b""
    echo(session, sent)
    settle(session)


def test_more_than_46_channels_are_refused():
    names = list(parameters.rows().values())[10:]
    Session().select(names[:46], [])
    with pytest.raises(UserError, match="47 channels chosen; the link has 48, 2 of them"):
        Session().select(names[:46], names[46:47])


def test_a_write_is_repeated_until_its_value_comes_back():
    session = Session()
    session.write("C_F_ST_F_ANG", 4.5)
    wanted = write_packet(344, word_of_float(4.5))
    assert session.outgoing(0.0) == wanted
    assert session.outgoing(1.9) == b""
    session.receive(nine(Point(344, word_of_float(4.0), 5)), 1.9)  # the old value does not count
    assert session.outgoing(2.0) == wanted
    session.receive(nine(Point(344, word_of_float(4.5), 5)), 2.1)
    assert session.pending() == [] and session.outgoing(9.0) == b""


def test_a_value_that_comes_before_the_packet_was_sent_confirms_nothing():
    session = Session()
    session.write("C_F_ST_F_ANG", 4.5)
    session.receive(nine(Point(344, word_of_float(4.5), 5)), 0.0)
    assert session.pending() == ["C_F_ST_F_ANG"]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("MCH_ANGLE", 1.0, "not a parameter, it is published by MCH"),
        ("TIMESTAMP", 1.0, "published by CSR"),
        ("LV_CH_3", 1.0, "--fast and --medium"),
        ("C_F_ST_FANG", 1.0, "unknown variable 'C_F_ST_FANG'; did you mean 'C_F_ST_F_ANG'"),
        ("C_F_ST_F_ANG", 101.0, "C_F_ST_F_ANG = 101 is outside 0 to 100 A/rad"),
        ("C_F_ST_F_ANG", float("nan"), "a number is expected"),
        ("CTRL_HIP_KP", 1e39, "does not fit into its type, f32"),
    ],
)
def test_what_is_no_parameter_or_outside_its_limits_is_refused_before_anything_is_sent(name, value, words):
    session = Session()
    with pytest.raises(UserError, match=words):
        session.write(name, value)
    assert session.outgoing(0.0) == b""


def test_an_error_counts_once_however_often_the_slow_list_repeats_it():
    session = Session()
    word = error_word(errors.MC_TCURR_OOB, 5, 3)
    for _ in range(4):
        session.receive(nine(Point(ID["ERROR_LABVIEW"], word, 1000)), 0.0)
    session.receive(nine(Point(ID["ERROR_LABVIEW"], word, 1022)), 0.0)
    session.receive(nine(Point(ID["ERROR_LABVIEW"], error_word(999, 44, 1), 1044)), 0.0)
    lines = list(session.errors.values())
    assert [(e.board, e.name, e.count, e.stamp) for e in lines] == [
        ("MCFI", "MC_TCURR_OOB", 6, 1022),
        ("board 44", "error 999", 1, 1044),
    ]
    assert lines[0].text == "motor: target current cut to its limits"
    assert [count for _, count in session.new_errors] == [3, 3, 1]


def test_jumps_of_the_robots_time_are_gaps_once_its_time_is_a_channel():
    session = Session()

    def time(*stamps):
        for stamp in stamps:
            session.receive(nine(Point(0, stamp, stamp)), 0.0)

    time(100, 300)
    assert session.gaps == 0, "time comes with the slow list only: nothing can be said"
    session.select([], [])
    settle(session)
    time(300, 349, 398, 448, 600, 620)
    assert (session.gaps, session.longest_gap_ms) == (2, 152)
    session.receive(nine(Point(14, 1, 550)), 0.0)  # an old stamp of the slow list
    assert session.gaps == 2 and session.clock_ms == 620


def test_the_robots_time_may_wrap_and_a_new_start_of_the_robot_writes_the_channels_again():
    session = Session()
    session.select([], [])
    settle(session)
    session.receive(nine(Point(0, 2**32 - 5, 2**32 - 5), Point(0, 3, 3)), 0.0)
    assert (session.clock_ms, session.restarts) == (3, 0)
    session.receive(nine(Point(0, 60_000, 60_000), Point(0, 12, 12)), 0.0)
    assert (session.clock_ms, session.restarts) == (12, 1)
    assert len(packets(session.outgoing(0.0))) == 40


# --- files ----------------------------------------------------------------------------------------------


def test_the_text_log_has_names_and_numbers_first_and_then_a_row_per_point(tmp_path):
    log = logs.open_log(str(tmp_path / "log.txt"))
    log.hear(Point(14, word_of_float(0.1), 1234))
    log.hear(Point(ID["FSM_HIP"], 0xFFFFFFFF, 1236))
    log.close()
    lines = (tmp_path / "log.txt").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "TIMESTAMP\t0\t" and lines[14] == "MCH_ANGLE\t14\t"
    assert len(lines) == all_variables.TABLE_SIZE + 2
    assert lines[-2:] == ["14\t0.1\t1234", f"{ID['FSM_HIP']}\t-1\t1236"]


def test_the_measurement_log_is_read_back_by_asammdf(tmp_path):
    mdf = pytest.importorskip("asammdf")
    log = logs.open_log(str(tmp_path / "log.mf4"))
    for stamp, value in ((0, 9.0), (10, 0.5), (10, 0.5), (12, 0.75), (11, 7.0)):  # never written; again; backwards
        log.hear(Point(14, word_of_float(value), stamp))
    log.close()
    with mdf.MDF(tmp_path / "log.mf4") as file:
        signal = file.get("MCH_ANGLE")
        assert signal.unit == "rad"
        np.testing.assert_allclose(signal.timestamps, [0.010, 0.012])
        assert signal.samples.tolist() == [0.5, 0.75]


@pytest.mark.parametrize("name", ["log.csv", "log"])
def test_a_log_with_another_ending_is_refused(name):
    with pytest.raises(UserError, match=r"must end in \.txt"):
        logs.open_log(name)


def words_of(values):
    return {name: word_of_float(value) for name, value in values.items()}


def test_parameters_saved_as_a_table_come_back_the_same(tmp_path):
    values = controllers.load("robust").values
    parameter_files.save(tmp_path / "set.txt", words_of(values), "robust")
    assert words_of(parameter_files.load(str(tmp_path / "set.txt"))) == words_of(values)


def test_parameters_saved_as_a_controller_hold_the_differences_and_can_walk(tmp_path):
    values = {**controllers.load("robust").values, "C_F_ST_F_ANG": 5.0, "P_H_PM_H_TRATE": 2.1}
    parameter_files.save(tmp_path / "set.toml", words_of(values), "robust")
    loaded = controllers.load(tmp_path / "set.toml")
    assert loaded.changes == {"C_F_ST_F_ANG": 5.0, "P_H_PM_H_TRATE": 2.1}
    assert words_of(loaded.values) == words_of(values)
    assert words_of(parameter_files.load(str(tmp_path / "set.toml"))) == words_of(values)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("C_F_ST_F_ANG\t344\n", "set.txt:1: .*name, id and value"),
        ("C_F_ST_F_ANG\t345\t4\n", "has id 344 in this table, the file says '345'"),
        ("\nMCH_ANGLE\t14\t4\n", "set.txt:2: MCH_ANGLE: not a parameter"),
        ("C_F_ST_F_ANG\t344\tstiff\n", "'stiff': a number is expected"),
        ("C_F_ST_F_ANG\t344\t-1\n", "set.txt:1: C_F_ST_F_ANG = -1 is outside 0 to 100"),
        ("C_F_ST_F_ANG\t344\t1\nC_F_ST_F_ANG\t344\t1\n", "a second time"),
        ("", "no parameters in it"),
    ],
)
def test_a_broken_parameter_file_is_named_with_its_line(tmp_path, text, words):
    (tmp_path / "set.txt").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=words):
        parameter_files.load(str(tmp_path / "set.txt"))


@pytest.mark.parametrize(("value", "text"), [(20.0, "20"), (0.1, "0.1"), (1e-5, "1e-05"), (16777216.0, "16777216")])
def test_a_single_is_written_with_the_fewest_digits_that_give_it_back(value, text):
    assert catalogue.text_of(14, word_of_float(value)) == text


@given(st.integers(0, 2**32 - 1))
def test_every_finite_word_comes_back_from_its_text(word):
    value = catalogue.value_of(14, word)
    if np.isfinite(value):
        assert word_of_float(float(catalogue.text_of(14, word))) == word
