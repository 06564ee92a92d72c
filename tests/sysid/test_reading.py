"""The import stage: ledger, findings, proposals, recipes, formats by content, and questions instead of guesses."""

import gzip
import json
import math
import re
import shlex
import struct
import zlib

import numpy as np
import pytest
import scipy.io

import ranger_sim
from ranger_sim.can_bus.edge import logs
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import sanity
from ranger_sim.sysid.api import diagnose
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.machines import machine_of
from ranger_sim.sysid.preparation import prepared
from ranger_sim.sysid.readers import layout, text_file
from ranger_sim.sysid.reading import open_recording, read
from ranger_sim.sysid.recipe import Recipe
from ranger_sim.tools.cli import main
from tests.boards.original_images import DATA
from tests.sysid.robot_joint import Joint

CASES = DATA.parent / "cases"
needs_cases = pytest.mark.skipif(not CASES.exists(), reason=f"no cases in {CASES.name}/")
needs_data = pytest.mark.skipif(not (DATA / "emps_run1.csv").exists(), reason=f"no measured data in {DATA.name}/")
T = 0.01 * np.arange(200)


@pytest.fixture
def written(tmp_path):
    def write(text, name="table.csv"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def rows(form, count=200):
    return "".join(form.format(k=k, t=0.01 * k, v=math.sin(0.1 * k), i=0.5 * math.cos(0.1 * k)) for k in range(count))


# --- ledger -----------------------------------------------------------------------------------------------------


def test_every_line_of_a_table_is_in_the_ledger(written):
    text = "Bench 3\n\n# a comment\nt,a\ns,V\n" + rows("{t:.2f},{v:.4f}\n") + "torn\n9.0,1.0\nEnd of data\n"
    measurement = read(written(text))
    assert measurement.ledger()["lines"] == {
        "preamble": 1, "empty": 1, "comments": 1, "names": 1, "units": 1, "footer": 1, "rows": 201,
        "left out: ragged": 1,
    }  # fmt: skip
    assert sum(measurement.ledger()["lines"].values()) == text.count("\n")
    account = measurement.ledger()["channels"]["a"]
    assert (account["read"], account["kept"]) == (202, 201)
    assert account["left_out"] == [{"reason": "ragged", "count": 1, "where": "in line 206"}]


def test_a_recording_is_read_from_the_package_itself(written):
    measurement = ranger_sim.read(written("t_s,a_mA\n" + rows("{t:.2f},{i:.4f}\n")))
    assert isinstance(measurement, ranger_sim.Measurement)
    assert measurement["a_A"].value == pytest.approx(0.5e-3 * np.cos(0.1 * np.arange(200)), abs=1e-7)
    both = ranger_sim.read([written("t_s,a_V\n0,1\n1,2\n", name) for name in ("a.csv", "b.csv")])
    assert [each.dataset.name for each in both] == ["a.csv", "b.csv"]


def test_the_command_exits_with_what_was_found(written, capsys):
    sound = written("t_s,a_V\n" + rows("{t:.2f},{v:.4f}\n"))
    assert main(["read", str(sound)]) == 0
    shuffled = written("t_s,a_V\n0.1,1\n0,2\n0.2,3\n0.3,4\n", "shuffled.csv")
    assert main(["read", str(shuffled)]) == 1
    assert "proposal: a_V: 1 samples were out of order and are sorted" in capsys.readouterr().out
    assert main(["read", str(written("nothing\n", "none.csv"))]) == 2


def test_the_answer_for_programs_has_channels_ledger_findings_and_proposals(written, capsys):
    path = written("t_s,a_V\n0.1,1\n0,2\n0.2,3\n0.3,4\n")
    assert main(["read", str(path), "--json", "-"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["channels"]["a_V"]["samples"] == 4 and answer["ledger"]["lines"] == {"names": 1, "rows": 4}
    assert [each["kind"] for each in answer["findings"]] == ["reversed_stamps"]
    assert [(each["kind"], each["share"]) for each in answer["proposals"]] == [("sorted", 0.25)]


def test_the_page_shows_every_channel_with_its_findings(written, tmp_path):
    path = written("t_s,a_V,b_V\n" + rows("{t:.2f},{v:.4f},{i:.4f}\n") + "9.5,1,2\n")
    assert main(["read", str(path), "--plot", str(tmp_path / "page.html")]) == 1
    page = (tmp_path / "page.html").read_text()
    assert page.count('class="figure"') == 2 and "no sample for 7.51 s" in page
    assert main(["read", str(path), "--plot", str(tmp_path / "page.pdf")]) == 2


# --- questions instead of guesses -------------------------------------------------------------------------------


def test_numbers_that_can_be_read_either_way_are_a_question_with_both_commands(written):
    text = "t_s;a_V\n0;1,234\n1;2\n2;1,5\n".replace("1,5", "7")
    with pytest.raises(
        UserError, match="'1,234' are 1234 with a decimal point and 1.234 with a decimal comma"
    ) as error:
        read(written(text))
    assert len(error.value.args) == 3 and "--assume decimal=comma" in error.value.args[2]
    assert read(written(text), assume={"decimal": "comma"})["a_V"].value.tolist() == [1.234, 2.0, 7.0]
    assert read(written(text), assume={"decimal": "point"})["a_V"].value.tolist() == [1234.0, 2.0, 7.0]


def test_all_rows_decide_and_not_the_first_ones(written):
    text = "t_s;a_V\n" + "".join(f"{k};{1 + k % 5},{100 + k % 800}\n" for k in range(6000)) + "6000;1,5\n"
    assert read(written(text))["a_V"].value[:2].tolist() == [1.1, 2.101]
    late = "t_s;a_V\n" + "".join(f"{k};{k % 100}\n" for k in range(6000)) + '6000;"1,5"\n'
    assert read(written(late))["a_V"].value[-1] == 1.5  # a comma behind the first chunk of lines


LONG = 25_000  # rows: beyond the first chunk, and far beyond the lines that decide the layout


def long_table(later, first="{t:.2f};{v:.4f}\n", count=LONG, names="t_s;a_V\n"):
    return names + rows(first, count) + "".join(later.format(k=k, t=0.01 * k, v=1.5) for k in range(count, count + 500))


@pytest.mark.parametrize(
    ("later", "reason"),
    [
        ("{t:.2f};{v:.4f};7\n", "from line 25002 on 500 rows have another form than those above: 3 cells, not 2"),
        ("{t:.2f},{v:.4f}\n", r"from line 25002 on .*: 1 cells, or 2 between other separators \(comma\)"),
        ("{t:.2f};--- {v}\n", "a_V: 500 cells are not numbers, the first in line 25002"),
    ],
)
def test_rows_that_change_their_form_late_are_named_with_their_line(later, reason, written):
    measurement = read(written(long_table(later)))
    said = [f"{each.channel}: {each.text}" for each in measurement.matters]
    assert any(re.search(reason, each) for each in said), said
    assert sum(measurement.ledger()["lines"].values()) == LONG + 501


def test_marks_and_stamps_that_change_late_are_refused_with_their_line(written):
    with pytest.raises(
        UserError, match=r"decimal point \('0.0000', first in line 2\), others a decimal comma .*first in line 25002"
    ):
        read(written(long_table("{k};1,{k:03d}5\n")))
    dates = "".join(f"2026-11-05T09:{k // 60:02d}:{k % 60:02d};{k}\n" for k in range(3000))
    with pytest.raises(UserError, match=r"from line 20001 on the stamps have another form than '2026-11-05T09:00:00'"):
        read(written("Zeit;a_V\n" + dates * 7 + rows("{k};1\n", 20_000)))
    late = read(written(long_table("2026-11-05T09:30:00;1\n")))
    assert "500 rows have no stamp and are left out (line 25002" in late.matters[0].text


def test_a_second_table_far_below_is_a_question_with_both_lines(written):
    text = long_table("", count=LONG) + "\ntime_s;b_A;c_A\n" + rows("{t:.2f};{v:.4f};1\n", 50)
    with pytest.raises(UserError, match="names in line 1 and in line 25003"):
        read(written(text))


def test_thousands_that_come_late_are_not_taken_for_decimals(written):
    text = "t_s;a_V\n" + "".join(f"{k};{k // 25}\n" for k in range(LONG))
    late = "".join(f"{LONG + k};{1000 + k:,}\n".replace(",", ".") for k in range(600))
    measurement = read(written(text + late))
    assert measurement["a_V"].value[-1] == 1599.0 and measurement["a_V"].value[LONG - 1] == 999.0


def test_several_tables_are_a_question_and_one_of_them_is_read(written):
    text = "t_s,a_V\n" + rows("{t:.2f},{v:.4f}\n") + "\ntime_s,b_A\n" + rows("{t:.2f},{i:.4f}\n", 50)
    path = written(text)
    with pytest.raises(UserError, match="names in line 1 and in line 203") as error:
        read(path)
    assert "--assume names=203" in error.value.args[2]
    assert len(read(path, assume={"names": "203"})["b_A"].value) == 50


def test_microseconds_since_a_controllers_start_are_not_a_date(written):
    stamps = "".join(f"{749_676_761 + 2000 * k},{k % 7}\n" for k in range(100))
    with pytest.raises(UserError, match="in us 0.002 s:"):
        read(written("time,a\n" + stamps))
    dates = "".join(f"{1_749_676_761 + k // 10}.{k % 10},{k % 7}\n" for k in range(100))
    assert read(written("time,a\n" + dates))["a"].time_s[-1] == pytest.approx(9.9, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (rows("{t:.3f},{v:.3f}\n").replace(".", ","), "may be decimals behind a comma, and then nothing says where"),
        (rows("step {k} {v:.3f}\n"), "has no names, and its column_1 holds words such as 'step'"),
        ('{"t": 0, "u": 1}\n', "this is a JSON file"),
    ],
)
def test_what_is_not_a_table_is_refused_with_its_reason(text, reason, written):
    with pytest.raises(UserError, match=reason):
        read(written(text))


def test_signs_behind_a_number_and_letters_that_are_not_its_unit_are_not_read_past(written):
    measurement = read(written("t_s,a_V\n0,1.5\n1,1.5-\n2,2.5\n3,0.5-\n"))
    assert measurement["a_V"].unit == "V" and np.isnan(measurement["a_V"].value[[1, 3]]).all()
    milli = read(written("t_s,a_V,b_V\n" + rows("{t:.2f},{v:.3f}m,{v:.3f}\n")))
    assert list(milli.channels) == ["b_V"]
    assert any("cells such as '0.000m' are in m, and the column is in V" in each.text for each in milli.matters)
    with pytest.raises(
        UserError, match=r"except the time column t_s \(a_V: 2 cells are not numbers, .* line 2: '1_000'"
    ):
        read(written("t_s,a_V\n0,1_000\n1,1_001\n"))


def test_a_row_of_units_may_be_above_the_names(written):
    measurement = read(written("ms,mV,A\nt,u,i\n" + rows("{k}0,{v:.3f},{i:.3f}\n")))
    assert measurement["u"].unit == "V" and measurement["u"].time_s == pytest.approx(T)


def test_a_last_number_without_its_last_digits_is_not_read_as_another_number(written):
    text = "t_s,a_V\n" + rows("{t:.2f},{v:.4f}\n")
    for cut in (1, 2, 3):
        measurement = read(written(text[: -1 - cut]))
        assert len(measurement["a_V"].value) == 199 and measurement.ledger()["lines"]["left out: cut off"] == 1
    assert len(read(written(text[:-1]))["a_V"].value) == 200  # many writers end without a line end
    assert len(read(written("t_s,a_V\n" + rows("{t:g},{v:g}\n")[:-1]))["a_V"].value) == 200  # numbers of any length


def test_the_finer_of_two_times_is_taken(written):
    text = "Date,Time,t_s,a_V\n" + "".join(f"2026-11-05,09:30:{k // 100:02d},{0.01 * k:.2f},{k}\n" for k in range(200))
    measurement = read(written(text))
    assert measurement["a_V"].time_s == pytest.approx(T) and list(measurement.channels) == ["a_V"]


def test_stamps_without_anything_between_are_dates_and_parts_of_a_day_are_not_seconds(written):
    packed = "".join(f"20261105T0930{k // 100:02d}.{k % 100:02d},{k}\n" for k in range(200))
    assert read(written("time,a_V\n" + packed))["a_V"].time_s == pytest.approx(T)
    days = "".join(f"{0.395833333 + 0.01 * k / 86400.0:.12f},{k}\n" for k in range(200))
    measurement = read(written("Time,a_V\n" + days))
    assert np.diff(measurement["a_V"].time_s) == pytest.approx(np.full(199, 0.01), rel=1e-4)
    assert "taken for days" in measurement.matters[0].text


def test_marks_of_no_value_and_hexadecimal_columns_are_not_numbers(written):
    cells = "".join(f"{0.01 * k:.2f},{'9.91E+37' if k % 30 == 5 else k},{10 + k % 3}E{k % 3}\n" for k in range(200))
    measurement = read(written("t_s,a_V,id_hex\n" + cells))
    assert list(measurement.channels) == ["a_V"] and np.isnan(measurement["a_V"].value[5::30]).all()
    assert any("hexadecimal numbers such as '10E0'" in each.text for each in measurement.matters)


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("time,a\n" + "".join(f"{k},{k * k}\n" for k in range(200)), 2),
        ("t_s,a\n" + "".join(f"{0.01 * k:.2f},1.{k % 7}23\n" for k in range(200)) + "t_s,b\n" + "0.01,1\n" * 200, 2),
    ],
)
def test_a_command_in_a_message_can_be_copied_whatever_the_file_is_called(text, commands, tmp_path):
    path = tmp_path / "run 1; of Monday.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError) as caught:
        open_recording(path)
    found = [shlex.split(line) for line in caught.value.args if line.startswith("  ranger-sim read")]
    assert [words[2] for words in found] == [str(path)] * commands


def test_an_assumption_is_checked():
    for text, line in (
        ("decimal=x", "decimal is point or comma"), ("colour=red", "key=value is expected"), ("names=x", "number of"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=line):
            layout.assumptions([text])
    assert layout.assumptions(["dates=day-first", "time=t"]) == {"dates": "day-first", "time": "t"}


# --- limits -----------------------------------------------------------------------------------------------------


def test_a_line_longer_than_any_tables_is_refused_before_it_is_kept(written, monkeypatch):
    monkeypatch.setattr(text_file, "LONGEST_LINE", 10_000)
    with pytest.raises(UserError, match="a line of more than 10000 characters"):
        read(written("t_s,a_V\n0,1\n" + "1," * 6000))


def test_a_compressed_table_is_refused_before_it_is_unpacked(written):
    with pytest.raises(UserError, match=r"the file is compressed \(gzip\)"):
        read(written(gzip.compress(bytes(10_000_000))))


# --- recipes ----------------------------------------------------------------------------------------------------


def test_a_recipe_reads_the_next_file_and_refuses_one_that_differs(written, tmp_path):
    german = "Zeit;Strom [mA]\n" + rows("{t:.2f};{i:.4f}\n").replace(".", ",")
    recipe = tmp_path / "lab.toml"
    command = ["read", str(written(german)), "--time-unit", "s", "--map", "Strom [mA]=current_A"]
    assert main([*command, "--write-recipe", str(recipe)]) == 0
    assert Recipe.load(recipe).assume == {"encoding": "utf-8-sig", "separator": "semicolon", "decimal": "comma"}
    again = read(written(german, "next.csv"), recipe=recipe)
    assert again["current_A"].value == pytest.approx(0.5e-3 * np.cos(0.1 * np.arange(200)), abs=1e-6)
    other = german.replace("Strom [mA]", "Strom [A]")
    with pytest.raises(UserError, match=r"unknown column|without the columns Strom \[mA\]"):
        read(written(other), recipe=recipe)
    more = "Zeit;Strom [mA];Last\n" + rows("{t:.2f};{i:.4f};1\n").replace(".", ",")
    with pytest.raises(UserError, match="does not fit .*lab.toml: with the new columns Last"):
        read(written(more), recipe=recipe)


def test_a_recipe_with_a_mistake_is_one_line(tmp_path):
    path = tmp_path / "lab.toml"
    for text, line in (
        ('colour = "red"', "unknown key 'colour'"),
        ("columns = 3", "columns is int"),
        ("[assume]\ndecimal = 1", "point"),
    ):  # fmt: skip
        path.write_text(text)
        with pytest.raises(UserError, match=line):
            Recipe.load(path)


# --- formats ----------------------------------------------------------------------------------------------------

SCOPES = {
    "tektronix": "Model,MSO54\nHorizontal Units,s\nSample Interval,0.01\nVertical Units,V,A\nLabel,,\nTIME,CH1,CH2\n"
    + rows("{t:.6e},{v:.6f},{i:.6f}\n"),
    "rigol": "X,CH1,CH2,Start,Increment,\nSequence,VOLT,AMP,0.0,1.0e-02\n" + rows("{k},{v:.6f},{i:.6f},,\n"),
    "keysight": "x-axis,1,2\nsecond,Volt,Ampere\n" + rows("{t:+.6E},{v:+.6E},{i:+.6E}\n"),
    "siglent": "Record Length,Analog:200\nSample Interval,Analog:0.01\nHorizontal Units,s\n\nSource,CH1,CH2\n"
    "Second,Volt,Ampere\n" + rows("{t:.8f},{v:.6f},{i:.6f}\n"),
    "picoscope": "Zeit;Kanal A;Kanal B\n(s);(V);(A)\n\n" + rows("{t:.8f};{v:.8f};{i:.8f}\n").replace(".", ","),
    "labview": "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
    "Y_Unit_Label\tVolts\tAmps\t\nX_Dimension\tTime\tTime\t\nDelta_X\t0.01\t0.01\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tVoltage\tCurrent\tComment\n" + rows("{t:.6f}\t{v:.6f}\t{i:.6f}\t\n"),
    "labview without stamps": "LabVIEW Measurement\t\nX_Columns\tNo\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
    "Y_Unit_Label\tVolts\tAmps\t\nDelta_X\t0.01\t0.01\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tVoltage\tCurrent\tComment\n" + rows("\t{v:.6f}\t{i:.6f}\t\n"),
    "yokogawa": '"Model","DL850"\n"TraceName","CH1","CH2"\n"BlockSize",200,200\n"VUnit","V","A"\n'
    '"HResolution",0.01,0.01\n"HUnit","s","s"\n"Date","2026/11/05"\n\n' + rows("{v:.6f},{i:.6f}\n"),
    "rate above": "Device;Logger 7\nSampling rate;100 Hz\n\nu [V];i [A]\n" + rows("{v:.6f};{i:.6f}\n"),
}


@pytest.mark.parametrize("kind", SCOPES)
def test_an_export_of_an_instrument_has_its_stamps_and_units(kind, written):
    volts, amperes = read(written(SCOPES[kind])).channels.values()
    assert (volts.unit, amperes.unit) == ("V", "A")
    assert volts.time_s == pytest.approx(T, abs=1e-8)
    assert volts.value == pytest.approx(np.sin(0.1 * np.arange(200)), abs=1e-6)
    assert amperes.value == pytest.approx(0.5 * np.cos(0.1 * np.arange(200)), abs=1e-6)


def test_settings_next_to_the_data_of_an_older_tektronix_are_not_channels(written):
    settings = ["Record Length,2.0e+02", "Sample Interval,1.0e-02", "Vertical Units,V", "Horizontal Units,s"]
    lines = [f"{settings[k] if k < 4 else ','},,{0.01 * k:018.12f},{math.sin(0.1 * k):9.5f}," for k in range(200)]
    measurement = read(written("\n".join(lines) + "\n"))
    assert list(measurement.channels) == ["CH1"] and measurement["CH1"].unit == "V" and not measurement.matters
    assert measurement["CH1"].time_s == pytest.approx(T)


def test_variables_of_matlab_and_fields_of_a_structure_are_channels(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t_s": T, "u_V": np.sin(T), "motor": {"i_mA": np.cos(T)}, "note": "bench"})
    measurement = read(tmp_path / "a.mat")
    assert measurement["u_V"].value == pytest.approx(np.sin(T)) and measurement["u_V"].time_s == pytest.approx(T)
    assert measurement["motor.i_A"].value == pytest.approx(1e-3 * np.cos(T))
    (tmp_path / "a.mat").write_bytes((tmp_path / "a.mat").read_bytes()[:900])
    with pytest.raises(UserError, match="not a MATLAB file that scipy can read"):
        read(tmp_path / "a.mat")


def test_messages_of_mcap_are_channels_by_topic(tmp_path):
    writer_module = pytest.importorskip("mcap.writer")
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = writer_module.Writer(file)
        writer.start()
        schema = writer.register_schema("motor", "jsonschema", b"{}")
        channel = writer.register_channel("/motor", "json", schema)
        for k in range(50):
            data = json.dumps({"current_mA": 10.0 * k, "gains": [1, k]}).encode()
            writer.add_message(channel, log_time=10_000_000 * k, publish_time=0, data=data)
        writer.finish()
    measurement = read(tmp_path / "a.mcap")
    assert measurement["motor.current_A"].value == pytest.approx(0.01 * np.arange(50))
    assert measurement["motor.gains[1]"].time_s == pytest.approx(0.01 * np.arange(50))


def test_what_is_of_another_kind_is_named(written):
    for content, line in (
        (b"\xd0\xcf\x11\xe0\0\0", "workbook of an old Excel"), (b"%PDF-1.7\n", "a PDF"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=line):
            read(written(content))


def test_frames_of_can_fd_are_left_out_and_counted(written):
    path = written(
        "(1.000000) can0 123#11\n(1.100000) can0 123##1112233445566778899\n(1.2) can0 123#22\n", "frames.txt"
    )
    log = logs.read_log(path)
    assert [frame[4] for frame in log] == [0x11, 0x22]
    assert log.read == 3 and log.losses == [("can_fd", 1, "")]


# --- findings ---------------------------------------------------------------------------------------------------


@needs_cases
def test_every_case_of_a_stranger_is_right_or_refused_with_its_reason():
    bus = CASES / "01-two-buses-one-id"
    assert "can0.DRIVE.angle" in read(bus / "m_two_buses.log", databases=[bus / "m.dbc"]).channels
    assert len(read(bus / "m_two_buses.log", databases=[bus / "m.dbc"], buses=["can1"]).channels) == 2
    with pytest.raises(UserError, match="in us 0.01 s:.*\n.*--time-unit us"):
        read(CASES / "09-index-as-unit" / "14_ulog.csv")
    for path in sorted((CASES / "12-candump-screen").glob("*.*")) + sorted((CASES / "13-asc-variants").glob("*.asc")):
        with pytest.raises(UserError, match=r"needs a DBC file \(--dbc FILE\)"):
            read(path)
    shuffled = read(CASES / "03-shuffled-stamps" / "g_shuffled_1.csv")
    base = read(CASES / "03-shuffled-stamps" / "base_1.csv")
    for name, channel in shuffled.mended().channels.items():
        assert channel.value == pytest.approx(base[name].value)


@pytest.fixture(scope="module")
def positioning():
    lines = (DATA / "emps_run1.csv").read_text().splitlines()
    return lines[0], np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])


def variant(kind, data):
    """Run 1 of the positioning bench, spoilt."""
    spoilt = data.copy()
    if kind == "clipped":
        spoilt[:, 1] = np.minimum(data[:, 1], 0.8 * np.abs(data[:, 1]).max())
    elif kind == "joined":
        spoilt = np.vstack([data[:12000], data[3000:15000]])
        spoilt[:, 0] = 0.001 * np.arange(len(spoilt))
    elif kind == "resampled":
        for column in (1, 2, 3):
            spoilt[:, column] = np.interp(data[:, 0], data[::10, 0], data[::10, column])
    return spoilt


@needs_data
@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("clipped", "6712 for values cut off at a limit"),
        ("joined", "jump at one row .* two recordings were joined there; nothing is concluded"),
        ("resampled", "in straight lines over 10 rows each: resampled .* nothing is concluded"),
    ],
)
def test_nothing_is_concluded_from_spoilt_runs_of_the_positioning_bench(kind, reason, positioning, written, capsys):
    names, data = positioning
    text = "".join(f"{t:.3f},{a:.6f},{b:.6f},{c:.6f}\n" for t, a, b, c in variant(kind, data).tolist())
    arguments = ["diagnose", str(written(f"{names}\n{text}")), "--experiment", "positioning", "--holdout-part", "0.4"]
    assert main(arguments) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert reason.split(" .* ")[0] in error and "nothing is concluded" in error


@needs_data
@pytest.mark.parametrize(("first", "second"), [(8000, 1000), (10000, 20000), (6000, 0), (15000, 7777)])
def test_runs_of_the_positioning_bench_are_joined_wherever_they_are_cut(first, second, positioning, written):
    names, data = positioning
    both = np.vstack([data[:first], data[second : second + 4000]])
    text = "".join(f"{k / 1000:.3f},{a:.6f},{b:.6f},{c:.6f}\n" for k, (_, a, b, c) in enumerate(both.tolist()))
    (joined,) = [each for each in read(written(f"{names}\n{text}")).findings if each.kind in ("jump", "step")]
    assert joined.kind == "jump" and joined.start_s == pytest.approx((first - 1) / 1000)


def broken_loose(gain, spike, constant):
    """An arm that breaks loose in one row: stamps, its angle, and a controller that answers in the same row."""
    t = 0.01 * np.arange(2000)
    angle = 0.3 * np.sin(0.9 * t) + 2e-4 * np.sin(1e4 * t * t)
    angle += 0.04 * (np.arange(2000) >= 700) * np.exp(-np.maximum(t - 7.0, 0.0))
    voltage = 0.05 * np.sin(2.7 * t) - gain * angle + np.where(np.arange(2000) == 700, spike, 0.0)
    voltage += np.where(np.arange(2000) >= 700, constant, 0.0)
    rows = zip(t.tolist(), angle.tolist(), voltage.tolist(), strict=True)
    return "t_s,arm_angle_rad,drive_V\n" + "".join(f"{a:.2f},{b:.6f},{c:.6f}\n" for a, b, c in rows)


@pytest.mark.parametrize(
    ("gain", "spike", "constant", "kind"),
    [
        (0.0, -3.0, 0.0, "step"),  # the derivative's part of the controller, for one row
        (60.0, 0.0, 0.0, "step"),  # the proportional part, which stays
        (0.0, 0.0, -3.0, "jump"),  # the drive goes over to another course, and its steps are not the angle's
    ],
)
def test_what_breaks_loose_in_one_row_is_a_finding_with_its_size_and_not_a_join(gain, spike, constant, kind, written):
    measurement = read(written(broken_loose(gain, spike, constant)))
    (found,) = [each for each in measurement.findings if each.kind in ("jump", "step")]
    assert found.kind == kind and (found.start_s, found.end_s) == pytest.approx((6.99, 7.0))
    assert len(sanity.doubts(measurement.findings)) == (kind == "jump")
    if kind == "step":
        assert found.channel == "arm_angle_rad" and found.size == pytest.approx(0.04, rel=0.1)


def test_a_clock_that_steps_where_the_angle_jumps_is_a_join(written):
    lines = broken_loose(0.0, -3.0, 0.0).splitlines()
    late = [f"{float(line.partition(',')[0]) + 0.013:.3f},{line.partition(',')[2]}" for line in lines[701:]]
    findings = read(written("\n".join([*lines[:701], *late, ""]))).findings
    assert [each.kind for each in findings if each.kind in ("jump", "step")] == ["jump"]


RATED = "a_V,b_A\n" + "".join(f"{k % 7},{k * k % 11}\n" for k in range(50))


@pytest.mark.parametrize(("rate", "step_s"), [("100", 0.01), ("100Hz", 0.01), ("10ms", 0.01), ("2 kHz", 0.0005)])
def test_a_table_without_a_time_gets_its_stamps_from_a_rate_and_the_ledger_says_so(rate, step_s, written, capsys):
    path = written(RATED)
    assert main(["read", str(path), "--rate", rate, "--json", "-"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["channels"]["a_V"]["end_s"] == pytest.approx(49 * step_s)
    assert answer["ledger"]["stamps"].startswith("the stamps are made from the number of the row")


def test_the_refusal_of_a_file_without_a_time_has_a_ready_command(written, tmp_path, capsys):
    scipy.io.savemat(tmp_path / "no time.mat", {"u": np.arange(40.0) ** 2 % 11, "gain": 3.0})
    for path in (written(RATED), tmp_path / "no time.mat"):
        with pytest.raises(UserError, match="there is no time column") as refused:
            read(path)
        assert "\n" not in str(refused.value)
        command = shlex.split(str(refused.value).rpartition("a second: ")[2])
        assert command[:2] == ["ranger-sim", "read"] and command[-2:] == ["--rate", "100Hz"]
        assert main(command[1:]) == 0
    capsys.readouterr()


def test_rows_that_are_left_out_keep_their_place_at_a_rate(written):
    lines = RATED.splitlines()
    lines[11] = "torn"
    assert read(written("\n".join([*lines, ""])), rate_hz=10.0)["a_V"].time_s[9:11] == pytest.approx([0.9, 1.1])


def test_a_time_column_is_a_channel_where_a_rate_is_given(written):
    measurement = read(written("t_s,a_V\n" + "".join(f"{0.5 * k},{k % 7}\n" for k in range(50))), rate_hz=10.0)
    assert set(measurement.channels) == {"t_s", "a_V"} and measurement["a_V"].time_s[-1] == pytest.approx(4.9)
    assert "t_s is a channel and not the time" in measurement.ledger()["stamps"]


def test_a_rate_is_refused_where_stamps_are_given(written, tmp_path):
    (tmp_path / "a.log").write_text("(1.000000) can0 123#01\n(2.000000) can0 123#02\n")
    with pytest.raises(UserError, match="has stamps, as every file of its format does"):
        read(tmp_path / "a.log", rate_hz=10.0)
    with pytest.raises(UserError, match="the stamps are those of a column already"):
        read(written(RATED), rate_hz=10.0, time_unit="s")


def test_a_recipe_keeps_the_rate(written, tmp_path):
    path, recipe = written(RATED), tmp_path / "lab.toml"
    assert main(["read", str(path), "--rate", "20ms", "--write-recipe", str(recipe)]) == 0
    assert 'rate = "50.0 Hz"' in recipe.read_text()
    assert read(path, recipe=recipe)["b_A"].time_s[-1] == pytest.approx(0.98)
    recipe.write_text('rate = "0 Hz"\n')
    with pytest.raises(UserError, match="rate is '0 Hz'; a number above 0"):
        read(path, recipe=recipe)


def test_a_text_with_the_ending_of_a_measurement_file_is_judged_as_a_text(tmp_path):
    (tmp_path / "a.dat").write_text("# by region\nRegion Austria Hungary\n1891-1900 a b\nsum of all\n")
    with pytest.raises(UserError) as refused:
        read(tmp_path / "a.dat")
    assert "asammdf" not in str(refused.value)


SLOW = "time,a_V\n" + "".join(f"{k},{(k * k % 11) / 7:.3f}\n" for k in range(100))


def test_a_time_unit_that_is_given_is_not_argued_with(written, capsys):
    path = written(SLOW)
    with pytest.raises(UserError, match="nothing says the unit of the stamps"):
        read(path)
    assert main(["read", str(path), "--time-unit", "s"]) == 0
    assert main(["read", str(path), "--rate", "1Hz"]) == 0
    shown = capsys.readouterr().out
    assert "probably" not in shown and "finding" not in shown and "note: a_V: 0 to 99 s: samples are 1 s" in shown


@pytest.mark.parametrize("line", [0, 1, 150, 199])
def test_a_quoted_cell_of_several_lines_is_one_cell_wherever_it_is(line, written):
    remarks = ["ok"] * 200
    remarks[line] = '"two, and\n""three"" \nlines"'
    text = "t_s,remark,a_V\n" + "".join(f"{0.01 * k:.2f},{each},{k}\n" for k, each in enumerate(remarks))
    measurement = read(written(text))
    assert measurement["a_V"].value.tolist() == list(range(200))
    assert measurement.ledger()["lines"] == {"names": 1, "rows": 200, "continued": 2}


def test_a_name_of_two_lines_has_its_unit(written):
    measurement = read(written('"Time\n(s)","Speed\n(km/h)"\n' + "".join(f"{0.01 * k:.2f},36\n" for k in range(50))))
    assert measurement["Speed_m_per_s"].value.tolist() == pytest.approx([10.0] * 50)


def test_a_quotation_mark_that_is_not_closed_is_a_character(written):
    rows = [f"{0.01 * k:.2f},ok,{k}\n" for k in range(200)]
    rows[100] = '1.00,5" pipe,100\n'  # not at the cell's begin
    rows[120] = '1.20,"lost,120\n'
    measurement = read(written("t_s,remark,a_V\n" + "".join(rows)))
    assert measurement["a_V"].value.tolist() == [k for k in range(200) if k != 120]
    assert measurement.ledger()["lines"]["left out: ragged"] == 1


def test_dates_as_numbers_are_days_of_the_calendar_and_a_counter_is_not(written):
    week = np.datetime64("2024-02-24") + 7 * np.arange(60)
    rows = "".join(f"{str(day).replace('-', '')},{0.1 * k:.1f}\n" for k, day in enumerate(week))
    channel = open_recording(written("date,level_m\n" + rows))["level_m"]
    assert channel.time_s.tolist() == [604_800.0 * k for k in range(60)]  # through a 29th of February
    number = [int(str(day).replace("-", "")) for day in week]
    path = written(b"", "t.mat")
    scipy.io.savemat(path, {"date": np.array(number, dtype=float), "level_m": 0.1 * np.arange(60)})
    assert open_recording(path, {"date": "time"})["level_m"].time_s.tolist() == [604_800.0 * k for k in range(60)]
    counter = "".join(f"{20_260_190 + k},{0.1 * k:.1f}\n" for k in range(60))  # has a 32nd of a month
    with pytest.raises(UserError, match="nothing says the unit of the stamps"):
        open_recording(written("t,level_m\n" + counter))


def test_the_unit_in_a_columns_name_is_questioned_and_dates_are_not(written):
    (found,) = [each for each in read(written(SLOW.replace("time,", "t_s,"))).findings if each.channel == "a_V"]
    assert found.kind == "slow_samples" and "probably in ms" in found.text and found in sanity.doubts([found])
    rows = "".join(f"2026-11-05 09:{k // 60:02d}:{k % 60:02d},{k % 7 / 7}\n" for k in range(100))
    (found,) = [each for each in read(written("time,a_V\n" + rows)).findings if each.kind == "slow_samples"]
    assert found.severity == sanity.NOTE and not sanity.doubts([found])


def test_minutes_in_a_columns_name_are_meant(written):
    rows = "".join(f"{k / 12:.6f},{k % 7 / 7}\n" for k in range(100))
    (found,) = [each for each in read(written("t [min],a_V\n" + rows)).findings if each.kind == "slow_samples"]
    assert found.severity == sanity.NOTE and "probably" not in found.text


def test_a_rate_that_is_not_the_slope_of_its_angle_is_found(written):
    """deg/s under the heading rpm is 6 times the slope; nothing of a joint can be concluded from both."""
    t = 0.01 * np.arange(2000)
    rows = np.column_stack([t, np.sin(t), np.degrees(np.cos(t)), np.cos(t) + 0.1 * np.sin(3.0 * t)])
    text = "\n".join(",".join(f"{each:.6f}" for each in row) for row in rows)
    path = written("t_s,angle_rad,rate_rpm,current_A\n" + text)
    with pytest.raises(UserError, match="rate_rad_per_s: it is 6.001 times the derivative of angle_rad"):
        prepared(open_recording(path), Joint())


def prepared_run(written, names, data, **how):
    text = "".join(f"{t:.3f},{a:.7f},{b:.7f},{c:.5f}\n" for t, a, b, c in data.tolist())
    return prepared(open_recording(written(f"{names}\n{text}"), **how), machine_of("positioning"))


@needs_data
def test_a_cut_off_command_of_the_positioning_bench_is_refused_unless_its_limit_is_a_true_one(positioning, written):
    names, data = positioning
    spoilt = data[:8000].copy()
    spoilt[:, 3] = np.minimum(spoilt[:, 3], 0.9 * spoilt[:, 3].max())
    with pytest.raises(UserError, match=r"voltage_V: \d+ values are cut off .*--assume limits=voltage_V"):
        prepared_run(written, names, spoilt)
    sound = prepared_run(written, names, spoilt, assume={"limits": "motor_voltage_command_V"})
    assert len(sound.table) == 8000


@needs_data
def test_shuffled_rows_of_the_positioning_bench_are_sorted_into_the_same_table(positioning, written):
    names, data = positioning
    base = prepared_run(written, names, data[:5000]).table
    order = generator(3, "shuffled rows").permutation(5000)
    shuffled = prepared_run(written, names, data[order])
    assert {each.kind for each in shuffled.findings} >= {"reversed_stamps"}
    for name, column in base.columns.items():
        assert np.array_equal(shuffled.table[name], column)


@needs_data
@pytest.mark.parametrize("rows", [6_000, 10_000])
def test_a_late_position_of_the_positioning_bench_is_a_lag_of_that_size_first(positioning, rows):
    late = positioning[1][:rows].copy()
    late[:, 1] = np.concatenate((np.full(30, late[0, 1]), late[:-30, 1]))
    channels = {
        name: Channel(name, unit, late[:, 0], late[:, column], resolution)
        for name, unit, column, resolution in (("position_m", "m", 1, 1e-7), ("voltage_V", "V", 3, 1e-5))
    }
    result = diagnose([Dataset("late", channels)], "positioning")
    assert result.causes[0].name == "sensor_lag"
    assert result.causes[0].parameters["time_constant_s"].value == pytest.approx(-0.030, abs=0.0005)
    # what is wrong with this machine anyway: friction by direction, and its screw's ripple
    assert {each.name for each in result.causes[1:]} <= {"direction_friction", "presliding", "once_per_turn"}


def test_a_command_that_reads_takes_the_same_options(written, capsys):
    path = written("Zeit;u;i\n" + rows("{k};{v:.3f};{i:.3f}\n"))
    assert main(["diagnose", str(path), "--experiment", "motor-bench", "--assume", "decimal=x"]) == 2
    assert "decimal is point or comma" in capsys.readouterr().err


def test_a_mapping_names_what_the_file_calls_otherwise(written):
    dataset = open_recording(written("t_s,q\n" + rows("{t:.2f},{v:.3f}\n")), {"q": "hip_angle_deg"})
    assert dataset["hip_angle_rad"].unit == "rad" and dataset.layout["map"] == {"q": "hip_angle_deg"}


def test_a_rate_that_only_its_unit_pairs_with_an_angle_is_checked_against_it(written):
    t = 0.01 * np.arange(1000)
    angle, rate = np.sin(1.3 * t) + 0.3 * np.sin(5.0 * t), lambda t: 1.3 * np.cos(1.3 * t) + 1.5 * np.cos(5.0 * t)

    def findings(shown):
        table = "".join(f"{a:.2f},{b:.6f},{c:.6f}\n" for a, b, c in zip(t, angle, shown, strict=True))
        return [each.text for each in read(written(f"t_s,arm_angle_rad,arm_speed_rad_per_s\n{table}")).matters]

    assert findings(rate(t)) == findings(14.0 * rate(t)) == []  # the second may be behind a gear
    (late,) = findings(rate(t - 0.03))
    assert "comes 30 ms after arm_angle_rad" in late
    (turned,) = findings(-rate(t))
    assert "counts the other way round" in turned
    (degrees,) = findings(180.0 / math.pi * rate(t))
    assert "deg/s" in degrees


def test_a_container_that_unpacks_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "LARGEST_CONTAINER", 1 << 20)
    monkeypatch.setattr(logs, "SMALL_CONTAINER", 1 << 10)
    packed = zlib.compress(bytes(1 << 21))
    head = b"LOBJ" + struct.pack("<HHIIHHIII", 16, 1, 32 + len(packed), 10, 2, 0, 0, 1 << 16, 0)
    path = tmp_path / "bomb.blf"
    path.write_bytes(b"LOGG" + struct.pack("<I", 144) + bytes(136) + head + packed)
    with pytest.raises(UserError, match="the container at byte 144 unpacks to more than 1048576"):
        list(logs.read_log(path))


def test_topics_of_a_flight_log_are_channels_by_their_own_stamps(tmp_path):
    pytest.importorskip("pyulog")

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    parts.append(message("F", b"motor:uint64_t timestamp;float current;float[2] angle;"))
    parts.append(message("A", struct.pack("<BH", 0, 0) + b"motor"))
    for k in range(50):
        parts.append(message("D", struct.pack("<HQfff", 0, 10_000 * k, 0.5 * k, 1.0, 2.0 * k)))
    path = tmp_path / "flight.ulg"
    path.write_bytes(b"".join(parts))
    measurement = read(path)
    assert set(measurement.channels) == {"motor.current", "motor.angle[0]", "motor.angle[1]"}
    assert measurement["motor.current"].value == pytest.approx(0.5 * np.arange(50))
    assert measurement["motor.angle[1]"].time_s == pytest.approx(0.01 * np.arange(50))
    path.write_bytes(b"".join(parts)[:-5])
    (finding,) = read(path).matters
    assert finding.kind == "cut_off" and f"begins at byte {len(b''.join(parts[:-1]))}" in finding.text


@pytest.mark.parametrize(
    ("name", "cells", "rate"),
    [("Ts", ["4", "", ""], "4s"), ("dt", ["0.01"] * 3, "0.01s"), ("fs", ["200", "", ""], "200Hz")],
)
def test_a_file_without_a_time_that_has_its_sample_time_in_a_column_is_read_by_it(tmp_path, name, cells, rate):
    path = tmp_path / "tanks.csv"
    rows = [f"{3 - row}.5,{row * row - 2}.25,{cell}" for row, cell in enumerate(cells)]
    path.write_text("\n".join([f"u,y,{name}", *rows]) + "\n", encoding="utf-8")
    with pytest.raises(UserError, match=rf"or {name}, .* is the sample \w+: ranger-sim read .*tanks.csv --rate {rate}"):
        read(path)
