"""Files of every format as datasets: known values, units turned into SI, and mistakes reported in a line."""

import math
import os
import pathlib
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import channels, repairs, sanity, units
from ranger_sim.sysid.dataset import Loss
from ranger_sim.sysid.readers import columns, csv_file
from ranger_sim.sysid.reading import open_recording
from ranger_sim.sysid.reading import open_recording as read
from tests.boards.original_images import DATA
from tests.examples import examples

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
needs_data = pytest.mark.skipif(not (DATA / "emps_run1.csv").exists(), reason=f"no measured data in {DATA.name}/")


@pytest.fixture
def table(tmp_path):
    """Reads a text as a table."""

    def write(text, name="table.csv", **options):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read(path, **options)

    return write


# --- units --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "name", "factor"),
    [
        ("current_mA", "current_A", 1e-3),
        ("rate_deg_per_s", "rate_rad_per_s", math.pi / 180),
        ("rate_rad_s", "rate_rad_per_s", 1.0),
        ("rate_deg_s", "rate_rad_per_s", math.pi / 180),
        ("speed_rpm", "speed_rad_per_s", math.pi / 30),
        ("torque_N_mm", "torque_Nm", 1e-3),
        ("torque_Ncm", "torque_Nm", 1e-2),
        ("Motor current [mA]", "Motor_current_A", 1e-3),
        ("speed (deg/s)", "speed_rad_per_s", math.pi / 180),
        ("cmd_dampness_A_s_per_rad", "cmd_dampness_A_s_per_rad", 1.0),
        ("accel_mm_per_s2", "accel_m_per_s2", 1e-3),
        ("housing_degC", "housing_C", 1.0),
        ("duty_percent", "duty", 1e-2),
        ("load_kg_cm2", "load_kg_m2", 1e-4),
        ("gain_V_s_per_mm", "gain_V_s_per_m", 1e3),
        ("speed_mm_s", "speed_m_per_s", 1e-3),
        ("accel_mm_s2", "accel_m_per_s2", 1e-3),
        ("rate_per_ms", "rate_per_s", 1e3),
    ],
)
def test_a_unit_in_a_name_becomes_si(column, name, factor):
    stem, unit = units.split(column)
    assert units.si_name(stem, unit) == name
    assert unit.factor == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    "column", ["current_min", "current_1", "position", "A", "state_x", "speed_furlongs", "gain_V_per"]
)
def test_what_is_not_a_unit_is_not_taken_for_one(column):
    assert units.split(column) == (column, None)


def test_kelvin_become_degrees_celsius():
    _, unit = units.split("winding_K")
    assert (unit.text, unit.factor * 300.0 + unit.offset) == ("C", pytest.approx(26.85))


# --- text tables --------------------------------------------------------------------------------------------


def test_a_table_is_read_in_si_and_every_conversion_is_recorded(table):
    data = table("time_ms,angle_deg,current_mA\n0,0,100\n4,90,200\n8,180,300\n")
    assert data["angle_rad"].value.tolist() == pytest.approx([0.0, math.pi / 2, math.pi])
    assert data["current_A"].value.tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert data["current_A"].time_s.tolist() == pytest.approx([0.0, 0.004, 0.008])
    assert [(each.channel, each.kind) for each in data.repairs] == [
        ("", "si_unit"), ("angle_rad", "si_unit"), ("current_A", "si_unit"),
    ]  # fmt: skip
    assert data["current_A"].resolution == pytest.approx(1e-3)  # whole mA were written
    assert not data.findings


@pytest.mark.parametrize(
    "text",
    [
        "t_s,a_V\n0,1.5\n1,2.5\n",
        "\ufefft_s,a_V\n0,1.5\n1,2.5\n",
        "# made by hand\nt_s,a_V\n% and a comment\n0,1.5\n\n1,2.5\n",
        "t_s;a_V\n0;1,5\n1;2,5\n",
        "t_s\ta_V\n0\t1,5\n1\t2,5\n",
        "t_s a_V\n 0  1.5\n 1  2.5\n",
        "# t_s,a_V\n0,1.5\n1,2.5\n",
        "t,a\n[s],[V]\n0,1.5\n1,2.5\n",
        "t,a\nus,mV\n0,1500\n1000000,2500\n",
        't_s,"a_V"\n"0","1.5"\n"1","2.5"\n',
        "t_s,a_V,\n0,1.5,\n1,2.5,\n",
        "t_s,a_V\r\n0,1.5\r\n1,2.5\r\n",
        "time_min,a_V\n0,1.5\n0.016666666666666666,2.5\n",
        "time,a_V\n2026-01-01 12:00:00.5,1.5\n2026-01-01 12:00:01.5,2.5\n",
        "t_s,a_V\n0,1.5\n1,2.5\n".encode("utf-16"),
    ],
    ids=["plain", "mark", "comments", "decimal commas", "tabs", "spaces", "header behind a mark", "line of units",
         "line of other units", "quotes", "comma at the end", "other line ends", "minutes", "dates", "utf-16"],
)  # fmt: skip
def test_one_table_in_many_dresses(table, text):
    data = table(text)
    name = "a_V" if "a_V" in data else "a"  # a line of units leaves the name as it is
    assert data[name].unit == "V"
    assert data[name].value.tolist() == pytest.approx([1.5, 2.5])
    assert data[name].time_s.tolist() == pytest.approx([0.0, 1.0])


UNITS = "t,a,speed,mode,w\ns,mA,{},enum,{}\n0,1,2,3,4\n0.1,1,2,3,4\n"


def test_one_unknown_word_leaves_the_other_units_of_its_row(table):
    data = table(UNITS.format("U/min", "furlong"))
    assert {name: channel.unit for name, channel in data.channels.items()} == {
        "a": "A", "speed": "rad/s", "mode": "", "w": ""
    }  # fmt: skip
    assert data["speed"].value == pytest.approx([math.pi / 15] * 2) and data["a"].value == pytest.approx([1e-3] * 2)
    (said,) = [each for each in data.findings if each.kind == "unknown_unit"]
    assert said.channel == "w" and "'furlong' is not known (--map w=NAME_UNIT says it)" in said.text
    assert sanity.doubts(data.findings) == [said]
    named = table(UNITS.format("rpm", "furlong"), mapping={"w": "speed_mm_s"})
    assert named["speed_m_per_s"].value == pytest.approx([4e-3] * 2) and not sanity.doubts(named.findings)


def test_a_row_of_words_in_which_no_unit_is_known_is_read_as_data(table):
    data = table("t_s,a_V\nstart,low\n0,1\n1,2\n")
    assert data["a_V"].value.tolist() == [1.0, 2.0] and data["a_V"].losses == (Loss("no_stamp", 1, "in line 2"),)


def test_an_index_in_brackets_stays_in_the_name(table):
    data = table("t_s,xyz[0],xyz[1]\n0,1,2\n1,3,4\n")
    assert set(data.channels) == {"xyz[0]", "xyz[1]"} and data["xyz[1]"].unit == ""


STAMPS = [
    ("time", "2026-11-05 09:30:{:06.3f}"),
    ("time", "2026-11-05T09:30:{:06.3f}Z"),
    ("time", "2026-11-05T09:30:{:06.3f}+01:00"),
    ("time", "2026/11/05 09:30:{:06.3f}"),
    ("Zeit", "05.11.2026 09:30:{:06.3f}"),
    ("Datum", "5.11.2026 9:30:{:06.3f}"),
    ("timestamp", "11/05/2026 09:30:{:06.3f} PM"),
    ("timestamp", "11/05/2026 09:30:{:06.3f} a.m."),
    ("Time", "09:30:{:06.3f}"),
    ("Uhrzeit", "09:30:{:06.3f}"),
    ("time", "2026-11-05 09:30:{:06.3f} UTC"),
    ("Elapsed", "30:00:{:06.3f}"),
    ("Time", "30:{:06.3f}"),
]


@pytest.mark.parametrize(("name", "form"), STAMPS, ids=[form for _, form in STAMPS])
@pytest.mark.parametrize("comma", [False, True])
def test_stamps_of_many_forms_are_the_same_seconds(table, name, form, comma):
    rows = [f"{form.format(0.25 * k)};{1.5 * k}\n" for k in range(8)]
    text = f"{name};a_V\n{''.join(rows)}"
    data = table(text.replace(".", ",") if comma and "." not in form.split(" ")[0] and "m." not in form else text)
    assert data["a_V"].value == pytest.approx(1.5 * np.arange(8.0))
    assert data["a_V"].time_s - data["a_V"].time_s[0] == pytest.approx(0.25 * np.arange(8), abs=1e-9)
    assert not data.findings and data["a_V"].losses == ()


def test_a_date_and_a_time_in_two_columns_are_one_stamp(table):
    rows = "".join(f"{day:02d}.11.2026;{clock};{k}\n" for k, (day, clock) in enumerate(
        [(30, "23:59:59,50"), (30, "23:59:59,75"), (30, "23:59:59,99")]))  # fmt: skip
    data = table(f"Datum;Uhrzeit;a_V\n{rows}01.12.2026;00:00:00,25;3\n")
    assert set(data.channels) == {"a_V"}
    assert data["a_V"].time_s == pytest.approx([0.0, 0.25, 0.49, 0.75])


def test_a_date_next_to_seconds_is_left_out(table):
    data = table("Date,t_s,a_V\n2026-11-05,0,1\n2026-11-05,0.5,2\n")
    assert data["a_V"].time_s.tolist() == [0.0, 0.5] and set(data.channels) == {"a_V"}


def test_day_and_month_are_taken_as_the_rows_allow(table):
    def times(*stamps):
        return table("time,a_V\n" + "".join(f"{each} 00:00:00,1\n" for each in stamps))["a_V"].time_s.tolist()

    assert times("11/29/2026", "11/30/2026") == times("29/11/2026", "30/11/2026") == [0.0, 86400.0]
    assert times("30/11/2026", "01/12/2026") == [0.0, 86400.0]  # a thirtieth month does not exist
    assert times("11/05/2026", "12/05/2026") == [0.0, 86400.0]  # a day, and not a month, which it could be too


def test_a_recording_across_midnight_goes_on(table):
    clock = [f"23:59:{58 + 0.1 * k:06.3f}" if k < 20 else f"00:00:{0.1 * (k - 20):06.3f}" for k in range(40)]
    data = table("time,a_V\n" + "".join(f"{each},{k}\n" for k, each in enumerate(clock)))
    assert repairs.mend(data)["a_V"].time_s == pytest.approx(86398.0 + 0.1 * np.arange(40))


def test_a_spreadsheets_days_are_known_by_what_seconds_cannot_be(table):
    def read_of(step_days):
        rows = "".join(f"{45231.5 + step_days * k:.12f},{k}\n" for k in range(40))
        return table("Time,a_V\n" + rows)

    data = read_of(0.01 / 86400.0)
    assert np.diff(data["a_V"].time_s) == pytest.approx([0.01] * 39, rel=1e-3)  # a float has 0.6 us of such days
    assert [each.size for each in data.findings if each.kind == "unit_assumed"] == [86400.0]
    assert np.diff(read_of(0.01)["a_V"].time_s) == pytest.approx([0.01] * 39)  # may be seconds, and so they are
    given = table("Time,a_V\n45231.5,1\n45231.6,2\n", time_unit="d")["a_V"]
    assert given.time_s - given.time_s[0] == pytest.approx([0.0, 8640.0])


def test_whole_nanoseconds_of_the_epoch_keep_every_one(table):
    begin = 1_519_844_087_028_000_001
    data = table("timestamp_ns,a_V\n" + "".join(f"{begin + 7 * k},{k}\n" for k in range(5)))
    assert data["a_V"].time_s == pytest.approx(7e-9 * np.arange(5), rel=1e-9, abs=0.0)


def test_stamps_that_are_not_read_are_named(table):
    with pytest.raises(
        UserError, match=r"table.csv: time: stamps such as 'half past nine' are not read \(numbers, 2026"
    ):
        table("time,a_V\nhalf past nine,1\nten,2\n")
    with pytest.raises(
        UserError, match=r"samples would be 10000 s apart, in ms 10 s, in us 0.01 s:\n.*unit us\n.*unit ms\n.*unit s"
    ):
        table("timestamp,a\n8123456,1\n8133456,2\n")
    assert "--time-unit ms would make them 0.002 s" in table("timestamp,a\n0,1\n2,2\n").findings[0].text


def test_decimal_commas_in_quotes_are_read(table):
    data = table('t_s,a_V\n"0,00","1,500"\n"0,01","1234,500"\n')
    assert data["a_V"].value.tolist() == [1.5, 1234.5] and data["a_V"].time_s.tolist() == [0.0, 0.01]


CASES = DATA.parent / "cases"


@pytest.mark.skipif(not CASES.exists(), reason=f"no cases in {CASES.name}/")
@pytest.mark.parametrize(
    "file",
    [*sorted(CASES.glob("07-stamp-forms/*.csv")), *sorted(CASES.glob("20-time-of-day/*.csv"))],
    ids=lambda path: path.stem,
)
def test_the_cases_of_stamps_are_ten_milliseconds_apart(file):
    (channel,) = read(file).channels.values()
    assert channel.unit == "V" and channel.value[:4].tolist() == [1.5, 2.25, -3.125, 1234.5]
    rounding_s = 1e-5 if "excel" in file.stem else 1e-9  # ten decimals of a day
    assert np.diff(channel.time_s) == pytest.approx([0.01] * (len(channel.value) - 1), abs=rounding_s)


@pytest.mark.skipif(not CASES.exists(), reason=f"no cases in {CASES.name}/")
def test_the_cases_of_a_row_of_units_have_them():
    for name in ("a_units_umin", "a_units_state"):
        data = read(CASES / "06-units-row" / f"{name}.csv")
        units_of = {key: each.unit for key, each in data.channels.items() if key != "mode"}
        assert units_of == {"voltage": "V", "current": "A", "speed": "rad/s", "torque": "N m", "angle": "rad"}
    turning = read(CASES / "06-units-row" / "30_units2.csv")["Drehzahl"]
    assert turning.value == pytest.approx([2.0 * math.pi] * 3)
    assert set(read(CASES / "09-index-as-unit" / "14_ulog.csv", time_unit="us").channels) == {
        "xyz[0]",
        "xyz[1]",
        "noutputs",
    }


def test_the_separator_is_that_of_the_first_fifty_lines(table):
    rows = "".join(f"{k}\t{k}\n" for k in range(49))
    data = table(f"t_s\ta_V\n{rows}a torn line\n")  # the 51st
    assert data["a_V"].value.tolist() == [float(k) for k in range(49)]


def test_an_empty_cell_is_a_time_without_a_sample(table):
    data = table("t_s,fast_V,slow_A\n0,1,5\n1,2,\n2,3,7\n")
    assert data["slow_A"].time_s.tolist() == [0.0, 2.0]
    assert data["fast_V"].time_s.tolist() == [0.0, 1.0, 2.0]
    assert not data.findings


def test_a_column_is_called_as_the_mapping_says_and_takes_its_unit_where_it_has_none(table):
    text = "t_s,q,i_mA\n0,90,5\n1,180,6\n"
    data = table(text, mapping={"q": "hip_angle_deg", "i_mA": "current_A"})
    assert data["hip_angle_rad"].value.tolist() == pytest.approx([math.pi / 2, math.pi])
    assert data["current_A"].value.tolist() == pytest.approx([0.005, 0.006])
    with pytest.raises(UserError, match=r"i_mA is in A, it cannot become voltage_V \(V\)"):
        table(text, mapping={"i_mA": "voltage_V"})
    with pytest.raises(UserError, match=r"unknown column \(available: t_s, q, i_mA"):
        table(text, mapping={"x": "voltage_V"})


def test_a_table_without_names_is_named_by_the_mapping(table):
    data = table("0,1.5\n1,2.5\n", mapping={"column_1": "t_s", "column_2": "current_A"})
    assert data["current_A"].value.tolist() == [1.5, 2.5]
    assert [each.kind for each in data.findings] == ["no_header"]


def test_a_pair_that_is_none_is_reported():
    assert columns.mapping_of(["a=b", "c = d"]) == {"a": "b", "c": "d"}
    for text in ("a", "=b", "a="):
        with pytest.raises(UserError, match="old=new is expected"):
            columns.mapping_of([text])
    with pytest.raises(UserError, match="is named already"):
        columns.mapping_of(["a=b", "a=c"])


@pytest.mark.parametrize(
    ("text", "kind", "size"),
    [
        ("t_s,a_V\n0,1\n1,oops\n2,x\n", "unreadable", 2),
        ("t_s,a_V\n0,1\n1\n2,3\n", "ragged", 1),
        ("t_s,a_V\n0,1\n,2\n2,3\n", "no_stamp", 1),
        ("t_s,a_V,b_V\n0,1,\n1,2,\n", "empty", 0),
        ("t_s,a_V,b_V\n0,1,x\n1,2,y\n", "empty", 0),
        ("time,a_V\n0,1\n1,2\n", "unit_assumed", 1),
        ("t_s,a\n0,1\n1,2\n", "no_unit", 0),
    ],
)
def test_what_is_odd_in_a_table_is_a_finding(table, text, kind, size):
    found = [each for each in table(text).findings if each.kind == kind]
    assert [each.size for each in found] == [size]


def test_a_walks_states_and_contacts_are_numbers_and_need_no_unit(table):
    text = "t_s,hip_angle_rad,walk_state,outer_contact,spare\n0,1,0,1,5\n1,2,1,0,6\n"
    named = channels.named_for(table(text), "walk")
    assert [each.channel for each in named.findings if each.kind == "no_unit"] == ["spare"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "the table is empty"),
        ("\n\n", "the table is empty"),
        ("# nothing\n", "comment lines only"),
        ("t_s,a_V\n", "no row below its header"),
        ("a_V,b_V\n0,1\n1,2\n", "there is no time column"),
        ("t_s\n0\n1\n", "no channel except the time column"),
        ("t_s,a_V,a_V\n0,1,2\n", "two columns are called a_V"),
        ("t_s,a_V,a_mV\n0,1,2\n", "two columns would be called a_V"),
        ("t_A,a_V\n0,1\n", "the time column t_A is in A, not in a time"),
        ("t_s,a_V\n0,x\n1,y\n", "no channel except"),
        (b"t_s,a_V\n0,\x00\n", "bytes of value 0"),
        (b"\x89PNG\r\n\x1a\n\xff\xfe\x9c", "no row below|no time column|empty|a picture"),
        (b"\xff\xfe\x00", "not a text table|no row|no time column|empty|its text is not utf-16"),
    ],
)
def test_what_is_not_a_table_is_reported_in_a_line(table, text, line):
    with pytest.raises(UserError, match=line) as error:
        table(text)
    assert "\n" not in str(error.value)


GOOD = "t_s,angle_deg,current_mA\n" + "".join(f"{k * 0.004:.3f},{k % 90},{-k}\n" for k in range(40))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # digits run together make numbers whose squares overflow
@settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    places=st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 5), st.binary(max_size=4)), max_size=12),
)
def test_a_mangled_table_is_read_or_refused_in_a_line(tmp_path, places):
    """Bytes are cut out and put in anywhere; whatever comes of it is a dataset with whole channels, or a UserError."""
    content = GOOD.encode()
    for place, cut, more in places:
        content = content[:place] + more + content[place + cut :]
    path = tmp_path / "mangled.csv"
    path.write_bytes(content)
    try:
        data = repairs.mend(read(path))
    except UserError as error:
        assert "\n" not in str(error)
        return
    for channel in data.channels.values():
        assert len(channel.time_s) == len(channel.value) > 0
        assert np.isfinite(channel.value).all() and (np.diff(channel.time_s) > 0.0).all()


# --- other formats ------------------------------------------------------------------------------------------


def test_a_robot_log_of_our_own_is_read_with_the_units_of_the_table(tmp_path):
    from ranger_sim.datatable.generated import all_variables
    from ranger_sim.foundation.numbers import word_of_float
    from ranger_sim.tools.robodaq.codec import Point
    from ranger_sim.tools.robodaq.logs import open_log

    log = open_log(str(tmp_path / "session.txt"))
    angle, current = all_variables.ID_OF["MCH_ANGLE"], all_variables.ID_OF["MCH_MOTOR_CURRENT"]
    for number, value, stamp in ((angle, 0.25, 0), (angle, 0.5, 2000), (angle, 0.75, 2004), (current, -1.5, 2003),
                                 (current, -1.5, 2003)):  # fmt: skip
        log.on_point(Point(number, word_of_float(value), stamp))
    log.close()
    data = open_recording(tmp_path / "session.txt", {"MCH_ANGLE": "hip_angle_rad"})
    assert (data["hip_angle_rad"].time_s.tolist(), data["hip_angle_rad"].value.tolist()) == ([2.0, 2.004], [0.5, 0.75])
    assert (data["MCH_MOTOR_CURRENT"].unit, data["MCH_MOTOR_CURRENT"].value.tolist()) == ("A", [-1.5])
    assert set(data.channels) == {"hip_angle_rad", "MCH_MOTOR_CURRENT"}


def test_a_log_without_names_keeps_its_numbers_and_says_so(tmp_path):
    path = tmp_path / "Data.txt"
    path.write_text("14\t0.5\t1000\n14\t0.6\t1002\n14\t0.\n62\t-1\t1001\n14\t0.7\t1004\n")
    data = read(path, {"id_14": "hip_angle_rad"})
    assert data["hip_angle_rad"].value.tolist() == [0.5, 0.6, 0.7]
    assert "id_62" in data
    assert {each.kind: each.size for each in data.findings} == {"ragged": 1.0, "no_header": 2.0, "no_unit": 0.0}


def test_the_robots_own_log_of_2015_is_read_as_its_program_wrote_it(tmp_path):
    """Numbers padded with spaces, idle variables with stamp 0, samples that come again (docs/robot.md, C6.1)."""
    lines = [
        "  14\t1.533984E-3\t   151042",
        " 194\t4.446710E-2\t   151045",
        " 229\t0.000000E+0\t        0",
        "  14\t1.533984E-3\t   151042",
        "  14\t-2.301000E-3\t   151048",
        " 138\t4.591775E-41\t   151048",
    ]
    path = tmp_path / "Test.txt"
    path.write_text("\r\n".join([*lines, ""]))
    data = read(path, {"id_14": "hip_angle_rad"})
    assert data["hip_angle_rad"].value.tolist() == [1.533984e-3, -2.301e-3]
    assert data["hip_angle_rad"].time_s == pytest.approx([151.042, 151.048])
    assert data["id_194"].value.tolist() == [4.44671e-2] and set(data.channels) == {"hip_angle_rad", "id_194", "id_138"}
    assert (data.rows, data.losses, data["hip_angle_rad"].losses) == (6, [], (Loss("repeated", 1),))


def test_the_names_of_a_log_of_2016_may_be_padded_too(tmp_path):
    path = tmp_path / "Test.txt"
    path.write_text("ID_TIMESTAMP\t   0\t\nID_MCH_ANGLE\t  14\t\n  14\t5.0E-1\t   1000\n  14\t6.0E-1\t   1002\n")
    assert read(path)["ID_MCH_ANGLE"].value.tolist() == [0.5, 0.6]


def test_every_row_of_a_table_is_kept_or_left_out_with_its_reason(table):
    text = "t_s,a_V,b_V\n0,1,2\n0.1,1\n,1,2\n0.2,x,2\n0.3,1,\n0.4,1,2\n0.5,1,2,7,8\n0.6,1,2\n"
    data = table(text)
    assert data.rows == 8
    read_of = (Loss("ragged", 2, "in line 3"), Loss("no_stamp", 1, "in line 4"))
    assert data["a_V"].losses == data["b_V"].losses == read_of
    assert (data["a_V"].read, data["b_V"].read) == (8, 7)  # an empty cell is an instant without a sample
    mended = repairs.mend(data)["a_V"]
    assert (mended.read, mended.losses[2]) == (8, Loss("not_finite", 1, "at 0.2 s")) and len(mended.value) == 4


def test_a_measurement_file_keeps_units_and_leaves_out_what_no_instrument_sees(tmp_path):
    from ranger_sim.tools.recordings import variables_file

    time_s = np.arange(5) * 0.1
    variables_file.write_groups(
        [
            ("plant", time_s, [("plant.hip_rad", "rad", "", np.ones(5))]),
            ("MCH_ANGLE", time_s, [("MCH_ANGLE", "rad", "", np.arange(5.0))]),
            ("speed", time_s, [("speed", "rpm", "", np.arange(5.0))]),
        ],
        tmp_path / "variables.mf4",
    )
    data = read(tmp_path)  # as the folder of a walk
    assert set(data.channels) == {"MCH_ANGLE", "speed"}
    assert data["speed"].unit == "rad/s"
    assert data["speed"].value.tolist() == pytest.approx((np.arange(5.0) * math.pi / 30).tolist())
    assert [each.kind for each in data.findings] == ["no_summary"]
    (tmp_path / "summary.json").write_text('{"fell": true, "fall_cause": "hip too low"}')
    assert [each.kind for each in read(tmp_path).findings] == ["fell"]
    named = channels.named_for(read(tmp_path), "walk")
    assert named["hip_angle_rad"].value.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_measurement_begins_at_zero_and_its_groups_keep_their_distance(tmp_path):
    from ranger_sim.tools.recordings import variables_file

    start_s = 1.75e9  # of a calendar
    early, late = start_s + np.arange(5) * 0.5, start_s + 0.25 + np.arange(5) * 0.5
    variables_file.write_groups(
        [("a", early, [("a", "A", "", np.arange(5.0))]), ("b", late, [("b", "V", "", np.arange(5.0))])],
        tmp_path / "late.mf4",
    )
    data = read(tmp_path / "late.mf4")
    assert data["a_A" if "a_A" in data else "a"].time_s.tolist() == pytest.approx((early - start_s).tolist())
    assert data["b_V" if "b_V" in data else "b"].time_s.tolist() == pytest.approx((late - start_s).tolist())


def measured(path, raw, conversion):
    """A measurement file with one channel of raw numbers and a conversion of them, 10 ms apart."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from asammdf import MDF, Signal

        with MDF(version="4.10") as file:
            time_s = 0.01 * np.arange(len(raw))
            signal = Signal(np.array(raw, dtype=np.uint16), time_s, name="speed", unit="rpm", conversion=conversion)
            file.append([signal])
            file.save(path, overwrite=True)
    return read(path)


@pytest.mark.parametrize(
    ("conversion", "values"),
    [
        ({"val_0": 65535, "text_0": "SNA"}, [10.0, 20.0, 40.0]),
        ({"val_0": 65535, "text_0": "SNA", "default_addr": {"a": 0.5, "b": 1.0}}, [6.0, 11.0, 21.0]),
        ({"lower_0": 65000, "upper_0": 65535, "text_0": "error"}, [10.0, 20.0, 40.0]),
        ({"lower_0": 0, "upper_0": 1000, "text_0": {"a": 2.0, "b": 0.0}, "default_addr": "SNA"}, [20.0, 40.0, 80.0]),
    ],
    ids=["a value", "a value, the others scaled", "a range", "all but a range"],
)
def test_a_text_for_some_values_leaves_the_others(tmp_path, conversion, values):
    data = measured(tmp_path / "a.mf4", [10, 20, 65535, 40], conversion)
    channel = data["speed"]
    assert channel.value == pytest.approx(np.array(values) * math.pi / 30)
    assert channel.time_s == pytest.approx([0.0, 0.01, 0.03]) and channel.losses == (Loss("text", 1, "at 0.02 s"),)
    (said,) = data.findings
    assert (said.kind, said.size, said.text) == (
        "text",
        1.0,
        "1 of 4 values have a text instead of a number and are left out",
    )
    assert said.kind in sanity.KINDS and channel.read == 4


def test_states_that_all_have_a_name_are_their_numbers(tmp_path):
    names = {f"val_{k}": k for k in range(3)} | {f"text_{k}": f"state {k}" for k in range(3)}
    data = measured(tmp_path / "a.mf4", [0, 2, 1, 1], names)
    assert data["speed"].losses == () and data["speed"].value == pytest.approx(np.array([0, 2, 1, 1]) * math.pi / 30)


@pytest.mark.skipif(not CASES.exists(), reason=f"no cases in {CASES.name}/")
def test_the_case_of_a_value_that_is_not_available():
    data = read(CASES / "15-mf4-partial-text" / "d_sna.mf4")
    assert (len(data["speed"].value), data["speed"].read, data["speed"].unit) == (9, 10, "rad/s")
    assert data["speed"].value[0] == pytest.approx(1000.0 * math.pi / 30)


def test_a_broken_measurement_file_is_reported_in_a_line(tmp_path):
    path = tmp_path / "broken.mf4"
    for content in (b"", b"MDF     4.10    nothing of it is true" * 5, os.urandom(500)):
        path.write_bytes(content)
        with pytest.raises(UserError, match="not a measurement file that asammdf can read|no channel with numbers"):
            read(path)
    with pytest.raises(UserError, match="this is not a folder of a walk"):
        read(tmp_path)
    with pytest.raises(UserError, match="there is no such file"):
        read(tmp_path / "none.csv")


@pytest.mark.parametrize("ending", [".log", ".blf", ".asc"])
def test_recorded_frames_become_channels_by_their_dbc_file(tmp_path, ending):
    import can

    from ranger_sim.foundation.numbers import word_of_float

    path = tmp_path / f"frames{ending}"
    with can.Logger(str(path)) as logger:
        for k in range(20):
            data = word_of_float(0.125 * k).to_bytes(4, "little") + (1000 + 2 * k).to_bytes(4, "little")
            for identifier in (14, 1999):  # MCH_ANGLE, and one that the robot does not have
                logger.on_message_received(
                    can.Message(timestamp=1.7e9 + 0.002 * k, arbitration_id=identifier, data=data,
                                is_extended_id=False, channel="can1" if ending == ".log" else 0)
                )  # fmt: skip
    dbc = ROOT / "datatable" / "generated" / "can1.dbc"
    data = open_recording(path, {"MCH_ANGLE": "hip_angle_rad"}, [dbc])
    assert data["hip_angle_rad"].value.tolist() == [0.125 * k for k in range(20)]
    assert np.diff(data["hip_angle_rad"].time_s) == pytest.approx(np.full(19, 0.002), abs=2e-6)
    assert data["hip_angle_rad"].time_s[0] == pytest.approx(0.0, abs=1e-5)
    assert data["MCH_ANGLE.time_s"].value.tolist() == pytest.approx([1.0 + 0.002 * k for k in range(20)])
    assert [(each.kind, each.size) for each in data.findings] == [("unknown_frames", 20.0)]
    with pytest.raises(UserError, match="needs a DBC file"):
        open_recording(path)
    with pytest.raises(UserError, match="none of its frames"):
        open_recording(path, databases=[ROOT / "datatable" / "generated" / "can2.dbc"])


# --- what was measured --------------------------------------------------------------------------------------


@needs_data
@pytest.mark.parametrize(
    ("file", "experiment", "sizes"),
    [
        ("emps_run1.csv", "positioning", {"position_m": 24841, "voltage_V": 24841, "reference_m": 24841}),
        ("emps_run2_pulses.csv", "positioning", {"position_m": 24841, "pulse_N": 24841}),
        ("ranger_ankle_sine_slow.csv", "ankle", {"joint_angle_rad": 5099, "command_current_A": 5099}),
        ("ranger_ankle_sine_fast.csv", "ankle", {"joint_angle_rad": 2982, "command_stiffness_A_per_rad": 2982}),
        ("ranger_foot_inertia_1.csv", "ankle", {"motor_angle_rad": 5144, "current_A": 343}),
        ("ranger_foot_inertia_4.csv", "ankle", {"motor_angle_rad": 5424, "current_A": 361}),
        ("ranger_walk_20150820.csv", "walk", {"hip_angle_rad": 2496, "outer_leg_angle_rad": 2496, "walk_state": 2496}),
    ],
)
def test_the_measured_files_read_under_the_names_of_their_experiments(file, experiment, sizes):
    data = channels.named_for(read(DATA / file), experiment)
    assert {name: len(data[name].value) for name in sizes} == sizes
    assert not [each for each in data.findings if each.severity != "note"]
    assert all(np.isfinite(each.value).all() for each in data.channels.values())


def test_a_needed_channel_that_is_missing_is_reported_with_what_names_it(table):
    data = table("t_s,voltage_V,strom\n0,1,2\n1,2,3\n")
    with pytest.raises(UserError, match="motor-bench needs current_A .*--map NAME=current_A names it"):
        channels.named_for(data, "motor-bench")
    with pytest.raises(UserError, match="hip_angle_rad"):
        channels.named_for(data, "leg-swing")
    with pytest.raises(UserError, match="unknown experiment 'bench' .available: motor-bench, leg-swing"):
        channels.named_for(data, "bench")


def test_a_table_of_more_cells_than_fit_into_memory_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "long.csv"
    path.write_text("t_s,x_m\n" + "".join(f"{k},{k}\n" for k in range(50)))
    assert len(csv_file.read(path)["x_m"].value) == 50
    monkeypatch.setattr(csv_file, "MOST_CELLS", 99)
    with pytest.raises(UserError, match="a text table may have 99 cells: split it"):
        csv_file.read(path)
