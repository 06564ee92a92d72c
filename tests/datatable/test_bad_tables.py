"""A bad table is refused with every fault at once: file, line, row, field and rule; never a traceback."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ranger_sim.datatable.loader import hash_of_master_files, load_table
from ranger_sim.foundation.user_error import TableError, UserError
from tests.examples import examples

from .small_table import BOARDS, ERRORS, VARIABLES, write


def faults_of(folder):
    with pytest.raises(TableError) as caught:
        load_table(folder)
    return caught.value.faults


def test_the_small_table_is_good(tmp_path):
    table = load_table(write(tmp_path))
    assert [variable.name for variable in table.variables][:3] == ["TIME", "LEG_ANGLE", "LEG_CURRENT"]
    assert table.variable("leg_angle").initial == 0.5
    assert table.variable(4).subscribers == ("MB", "LEG")


def test_what_a_fault_quotes_is_cut_to_its_column(tmp_path):
    [fault] = faults_of(write(tmp_path, variables=VARIABLES.replace("5,GAIN", "5," + "G" * 300)))
    assert len(fault.row) == 40 and len(fault.rule) <= 240


@pytest.mark.parametrize("period", ["1", "1.0001", "0.9999"])
def test_a_period_may_differ_by_a_ten_thousandth_from_what_is_served(tmp_path, period):
    table = load_table(write(tmp_path, variables=VARIABLES.replace("SSP,1,-3,3", f"SSP,{period},-3,3")))
    assert table.variable("LEG_ANGLE").period_ms == pytest.approx(float(period))


# What is replaced in variables.csv, and the fault that must be reported: line, row, field, part of the rule.
VARIABLE_FAULTS = {
    "duplicate id": ("5,GAIN", "4,GAIN", 7, "GAIN", "id", "4 is also the id in line 6"),
    "duplicate name": ("5,GAIN", "5,LEG_COMMAND", 7, "LEG_COMMAND", "name", "also the name in line 5"),
    "two publishers in two rows": ("5,GAIN", "5,LEG_COMMAND", 7, "LEG_COMMAND", "publisher", "MB and PC"),
    "two publishers in one row": ("0.5,LEG,", "0.5,LEG;KEYS,", 3, "LEG_ANGLE", "publisher", "LEG and KEYS"),
    "no publisher": ("0.5,LEG,", "0.5,,", 3, "LEG_ANGLE", "publisher", "is empty"),
    "unknown publisher": ("0.5,LEG,", "0.5,ARM,", 3, "LEG_ANGLE", "publisher", "unknown board 'ARM'"),
    "unknown subscriber": ("MB;PC", "MB;ARM", 3, "LEG_ANGLE", "subscribers", "unknown board 'ARM'"),
    "no subscriber": ("MB;PC", "", 3, "LEG_ANGLE", "subscribers", "is empty"),
    "subscriber twice": ("MB;PC", "MB;MB", 3, "LEG_ANGLE", "subscribers", "'MB' is named twice"),
    "a board hears itself": ("MB;PC", "LEG;MB", 3, "LEG_ANGLE", "subscribers", "LEG publishes it"),
    "id of XCP on a bus": ("3,LEG_COMMAND", "2001,LEG_COMMAND", 5, "LEG_COMMAND", "id", "an identifier of XCP on CAN"),
    "id above 2031 on a bus": ("3,LEG_COMMAND", "2032,LEG_COMMAND", 5, "LEG_COMMAND", "id", "above 2031"),
    "id beyond 16 bits": ("5,GAIN", "65536,GAIN", 7, "GAIN", "id", "0 ... 65535"),
    "id not a number": ("5,GAIN", "five,GAIN", 7, "GAIN", "id", "not a whole number"),
    "digits of another alphabet": ("5,GAIN", "٥,GAIN", 7, "GAIN", "id", "not a whole number"),
    "unknown type": ("LEG_ANGLE,f32", "LEG_ANGLE,f64", 3, "LEG_ANGLE", "type", "not one of f32, i32, u32"),
    "initial not a number": (",0.5,LEG", ",half,LEG", 3, "LEG_ANGLE", "initial", "not a number"),
    "initial not finite": (",0.5,LEG", ",nan,LEG", 3, "LEG_ANGLE", "initial", "not a number"),
    "initial too large": (",0.5,LEG", ",1e39,LEG", 3, "LEG_ANGLE", "initial", "range of type f32"),
    "initial below the minimum": (",0.5,LEG", ",-4,LEG", 3, "LEG_ANGLE", "initial", "below the minimum"),
    "initial above the maximum": (",0.5,LEG", ",4,LEG", 3, "LEG_ANGLE", "initial", "above the maximum"),
    "fraction in an integer": ("1,0,63", "1,0.5,63", 6, "KEYS_DOWN", "minimum", "not a whole number"),
    "range against an integer type": ("1,0,63", "1,0,2147483648", 6, "KEYS_DOWN", "maximum", "range of type i32"),
    "range against an unsigned type": ("SSP,1,,,", "SSP,1,-1,,", 2, "TIME", "minimum", "range of type u32"),
    "range upside down": ("-3,3", "3,-3", 3, "LEG_ANGLE", "minimum", "above the maximum"),
    "period of another rate": ("SSP,1,-3,3", "SSP,2,-3,3", 3, "LEG_ANGLE", "period_ms", "LEG's rows give 1 ms"),
    "period too long by more": ("SSP,1,-3,3", "SSP,1.00011,-3,3", 3, "LEG_ANGLE", "period_ms", "LEG's rows give 1 ms"),
    "period too short by more": ("SSP,1,-3,3", "SSP,0.99989,-3,3", 3, "LEG_ANGLE", "period_ms", "LEG's rows give 1 ms"),
    "period that nobody serves": ("SSP,,,,a com", "SSP,2,,,a com", 5, "LEG_COMMAND", "period_ms", "never sends it"),
    "period missing": ("SSP,1,-3,3", "SSP,,-3,3", 3, "LEG_ANGLE", "period_ms", "sends it every 1 ms"),
    "period of zero": ("SSP,1,-3,3", "SSP,0,-3,3", 3, "LEG_ANGLE", "period_ms", "between 0 and"),
    "unknown bus": ("CAN1;CAN2;SSP,1,0", "CAN1;CAN2;CAN3;SSP,1,0", 6, "KEYS_DOWN", "bus", "unknown bus 'CAN3'"),
    "bus twice": ("CAN1;CAN2;SSP,1,0", "CAN1;CAN2;CAN1;SSP,1,0", 6, "KEYS_DOWN", "bus", "named twice"),
    "other bus not routed": ("CAN1;CAN2;SSP,1,0", "CAN2;SSP,1,0", 6, "KEYS_DOWN", "bus", "cannot reach LEG"),
    "main brain not routed": ("CAN1;CAN2;SSP,1,0", "CAN1;CAN2,1,0", 6, "KEYS_DOWN", "bus", "cannot reach MB"),
    "own bus not named": ("CAN1;CAN2;SSP,1,0", "CAN1;SSP,1,0", 6, "KEYS_DOWN", "bus", "leaves KEYS by CAN2"),
    "command without the link": ("LEG,CAN1;SSP,,", "LEG,CAN1,,", 5, "LEG_COMMAND", "bus", "leaves MB by SSP"),
    "command that stays inside": ("MB,LEG,CAN1;SSP", "MB,LEG,", 5, "LEG_COMMAND", "bus", "leaves MB by SSP"),
    "lower-case name": ("5,GAIN", "5,gain", 7, "", "name", "not capital letters"),
    "name too long": ("5,GAIN", "5," + "G" * 33, 7, "G" * 33, "name", "33 characters, 32 are allowed"),
    "name of a C keyword": ("5,GAIN", "5,WHILE", 7, "WHILE", "name", "reserved"),
    "name of a generated list": ("5,GAIN", "5,SEND", 7, "SEND", "name", "reserved"),
    "no description": ("a parameter", "", 7, "GAIN", "description", "is empty"),
    "description beyond ASCII": ("a parameter", "größe", 7, "GAIN", "description", "printable ASCII"),
    "description that ends a comment": ("a parameter", "a */ b", 7, "GAIN", "description", "printable ASCII"),
    "unit with a quote": ("LEG_ANGLE,f32,rad", 'LEG_ANGLE,f32,"""rad"""', 3, "LEG_ANGLE", "unit", "printable"),
    "a cell too many": ("a parameter", "a parameter,more", 7, "'GAIN'", "", "has 13 cells, the header has 12"),
    "a row of one cell": ("5,GAIN,f32,,1.5,PC,MB,,,,,a parameter", "GAIN", 7, "'GAIN'", "", "has 1 cells, the header"),
    "a column missing": ("id,name,type,unit,", "id,name,type,", 1, "", "header", "missing unit"),
    "an unknown column": ("period_ms", "rate", 1, "", "header", "missing period_ms; unknown 'rate'"),
    "columns in another order": ("id,name", "name,id", 1, "", "header", "another order"),
    "quotes left open": ('"an estimate, inside"', '"an estimate', 8, "", "", "is not CSV"),
    "a name the schedules use is gone": ("4,KEYS_DOWN", "4,KEYS_UP", 6, "KEYS_UP", "period_ms", "never sends it"),
}


@pytest.mark.parametrize("case", VARIABLE_FAULTS)
def test_a_fault_in_the_variables_is_reported_with_line_row_field_and_rule(tmp_path, case):
    old, new, line, row, field, rule = VARIABLE_FAULTS[case]
    assert VARIABLES.count(old) == 1
    found = faults_of(write(tmp_path, variables=VARIABLES.replace(old, new)))
    matching = [f for f in found if (f.file, f.line, f.row, f.field) == ("variables.csv", line, row, field)]
    assert any(rule in fault.rule for fault in matching), "\n".join(map(str, found))


BOARD_FAULTS = {
    "not TOML": ("[boards.PC]", "[boards.PC", 6, "", "", "not valid TOML"),
    "unknown section": ("[buses]", "[lines]\n[buses]", 1, "", "'lines'", "not a section"),
    "unknown key": ("number = 3", "number = 3\ncolour = 1", 32, "LEG", "'colour'", "not a key"),
    "key missing": ("number = 3\n", "", 32, "LEG", "number", "is missing"),
    "key of a wrong kind": ("number = 3", 'number = "3"', 32, "LEG", "number", "not int"),
    "number twice": ("number = 3", "number = 4", 44, "KEYS", "number", "4 is also the number of LEG"),
    "number beyond 6 bits": ("number = 3", "number = 64", 32, "LEG", "number", "outside 0 ... 63"),
    "unknown role": ('role = "router"', 'role = "king"', 21, "CSR", "role", "not one of"),
    "no router": ('role = "router"\n', "", 1, "", "boards", "exactly one board must have the role 'router'"),
    "bus against ribbon": ('buses = ["CAN1"]', 'buses = ["CAN2"]', 32, "LEG", "buses", "2 x ribbon = CAN1"),
    "unknown bus": ('buses = ["CAN1"]', 'buses = ["CAN7"]', 32, "LEG", "buses", "unknown bus 'CAN7'"),
    "no slot length": ("slot_us = 500\n", "", 32, "LEG", "slot_us", "is missing"),
    "slot of no length": ("slot_us = 500", "slot_us = 0", 32, "LEG", "slot_us", "outside 1"),
    "no rows": ('rows = [["KEYS_DOWN"]]', "rows = []", 44, "KEYS", "rows", "at least one row"),
    "rows not lists": ('rows = [["KEYS_DOWN"]]', 'rows = ["KEYS_DOWN"]', 44, "KEYS", "rows[0]", "not a list"),
    "occasional row that is none": ("occasional_row = 1", "occasional_row = 2", 32, "LEG", "occasional_row", "0 ... 1"),
    "unknown variable in a row": ('["LEG_ANGLE"]', '["LEG_WEIGHT"]', 32, "LEG", "rows[0]", "unknown variable"),
    "a row sends another's variable": ('["LEG_ANGLE"]', '["KEYS_DOWN"]', 32, "LEG", "rows[0]", "KEYS publishes"),
    "a bus without a rate": (
        "CAN1 = { channel = 1, bit_rate = 3_000_000 }",
        "CAN1 = 1",
        1,
        "",
        "buses 'CAN1'",
        "exactly",
    ),
    "a channel twice": ("CAN2 = { channel = 2", "CAN2 = { channel = 1", 1, "", "buses 'CAN2'", "used twice"),
    "a bus by another name": ("CAN2 = { channel = 2", "CAN3 = { channel = 2", 1, "", "buses 'CAN3'", "channels 1-4"),
    "board of a reserved name": ("[boards.LEG]", "[boards.ERRORS]", 32, "ERRORS", "", "reserved"),
    "lower-case board": ("[boards.LEG]", "[boards.leg]", 32, "leg", "", "capital letters"),
    "sections are lists": (BOARDS, "buses = []\nboards = []\n", 1, "", "boards", "missing or empty"),
}


@pytest.mark.parametrize("case", BOARD_FAULTS)
def test_a_fault_in_the_boards_is_reported_with_line_row_field_and_rule(tmp_path, case):
    old, new, line, row, field, rule = BOARD_FAULTS[case]
    assert BOARDS.count(old) == 1
    found = faults_of(write(tmp_path, boards=BOARDS.replace(old, new)))
    matching = [f for f in found if (f.file, f.line, f.row, f.field) == ("boards.toml", line, row, field)]
    assert any(rule in fault.rule for fault in matching), "\n".join(map(str, found))


ERROR_FAULTS = {
    "duplicate code": ("1,TOO_HOT", "0,TOO_HOT", 3, "TOO_HOT", "id", "also the code in line 2"),
    "duplicate name": ("1,TOO_HOT", "1,NOTHING", 3, "NOTHING", "name", "also the name in line 2"),
    "unknown board": ("TOO_HOT,LEG", "TOO_HOT,ARM", 3, "TOO_HOT", "boards", "unknown board 'ARM'"),
    "no board": ("TOO_HOT,LEG", "TOO_HOT,", 3, "TOO_HOT", "boards", "is empty"),
    "board twice": ("TOO_HOT,LEG", "TOO_HOT,LEG;LEG", 3, "TOO_HOT", "boards", "named twice"),
    "reserved name": ("1,TOO_HOT", "1,NAMES", 3, "NAMES", "name", "reserved"),
    "no description": ("the leg is hot", "", 3, "TOO_HOT", "description", "is empty"),
    "normal without a board": ("LEG:0.5", "0.5", 2, "NOTHING", "normal_per_s", "'0.5' is not BOARD:NUMBER"),
    "normal on a board without it": ("LEG:0.5", "KEYS:1", 2, "NOTHING", "normal_per_s", "'KEYS' is none of its boards"),
    "normal twice": ("LEG:0.5", "LEG:1;LEG:2", 2, "NOTHING", "normal_per_s", "'LEG' is named twice"),
    "normal never": ("LEG:0.5", "LEG:0", 2, "NOTHING", "normal_per_s", "'0' is not above 0"),
    "normal below zero": ("LEG:0.5", "LEG:-1", 2, "NOTHING", "normal_per_s", "'-1' is not above 0"),
    "normal in words": ("LEG:0.5", "LEG:often", 2, "NOTHING", "normal_per_s", "'often' is not above 0"),
    "normal without end": ("LEG:0.5", "LEG:1e99", 2, "NOTHING", "normal_per_s", "up to 1e+06"),
    "normal at the start in words": ("LEG:0.5,", "LEG:0.5,once", 2, "NOTHING", "normal_at_start", "not BOARD:NUMBER"),
}


@pytest.mark.parametrize("case", ERROR_FAULTS)
def test_a_fault_in_the_errors_is_reported_with_line_row_field_and_rule(tmp_path, case):
    old, new, line, row, field, rule = ERROR_FAULTS[case]
    found = faults_of(write(tmp_path, errors=ERRORS.replace(old, new)))
    matching = [f for f in found if (f.file, f.line, f.row, f.field) == ("errors.csv", line, row, field)]
    assert any(rule in fault.rule for fault in matching), "\n".join(map(str, found))


WHOLE_FILES = {
    "missing": (None, "cannot be read"),
    "empty": ("", "is empty"),
    "white space only": (" \n\n", "is empty"),
    "not UTF-8": (b"id,name\n1,\xff\n", "is not UTF-8"),
    "NUL bytes": (b"\0\0\0", None),
    "a directory's worth of nesting": ("a = " + "[" * 5000, None),
}


@pytest.mark.parametrize("name", ["boards", "variables", "errors"])
@pytest.mark.parametrize("case", WHOLE_FILES)
def test_a_file_that_is_not_a_table_is_one_fault_of_that_file(tmp_path, name, case):
    content, rule = WHOLE_FILES[case]
    found = faults_of(write(tmp_path, **{name: content}))
    assert {fault.file.partition(".")[0] for fault in found} == {name}, "\n".join(map(str, found))
    assert rule is None or rule in found[0].rule


def test_a_folder_that_does_not_exist_is_reported(tmp_path):
    found = faults_of(tmp_path / "nowhere")
    assert {fault.file for fault in found} >= {"boards.toml", "variables.csv"}
    with pytest.raises(UserError, match="cannot be read"):
        hash_of_master_files(tmp_path / "nowhere")


def test_a_header_without_rows_is_reported(tmp_path):
    boards = BOARDS.replace('every = ["TIME"]\n', "").replace('"TIME"', "").replace('["LEG_ANGLE"]', "[]")
    boards = boards.replace('"LEG_CURRENT", ', "").replace('[["KEYS_DOWN"]]', "[[]]")
    found = faults_of(write(tmp_path, boards=boards, variables=VARIABLES.splitlines()[0] + "\n"))
    assert [str(fault) for fault in found] == ["variables.csv:1: has no rows"]


def test_all_faults_of_all_files_are_reported_at_once_in_file_order(tmp_path):
    write(
        tmp_path,
        boards=BOARDS.replace("number = 3", "number = 64"),
        variables=VARIABLES.replace("5,GAIN", "4,GAIN").replace("-3,3", "3,-3").replace("MB;PC", "MB;ARM"),
        errors=ERRORS.replace("TOO_HOT,LEG", "TOO_HOT,ARM"),
    )
    with pytest.raises(UserError) as caught:
        load_table(tmp_path)
    assert str(caught.value).splitlines() == [
        "boards.toml:32 LEG number: is 64, outside 0 ... 63",
        "variables.csv:3 LEG_ANGLE subscribers: unknown board 'ARM'",
        "variables.csv:3 LEG_ANGLE minimum: 3 is above the maximum -3",
        "variables.csv:7 GAIN id: 4 is also the id in line 6",
        "errors.csv:3 TOO_HOT boards: unknown board 'ARM'",
    ]


def test_a_line_number_is_right_after_a_cell_of_several_lines(tmp_path):
    spoiled = VARIABLES.replace('"an estimate, inside"', '"an\nestimate"') + "7,X,f99,,0,MB,PC,,,,,wrong type\n"
    found = faults_of(write(tmp_path, variables=spoiled))
    assert [(fault.line, fault.row, fault.field) for fault in found] == [(8, "SPEED", "description"), (10, "X", "type")]


# ---- fuzzing: whatever the files hold, there is a table or a TableError with readable faults


def load_or_be_told(folder):
    try:
        load_table(folder)
    except TableError as error:
        assert error.faults
        for fault in error.faults:
            assert fault.line >= 1 and fault.rule and "\n" not in str(fault) and len(str(fault)) < 400, repr(fault)


fuzzing = settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
cells = st.one_of(
    st.text(max_size=12),
    st.integers(-(10**12), 10**12).map(str),
    st.floats().map(str),
    st.sampled_from(
        ["", "MB", "LEG;MB", "CAN1;SSP", "f32", "u32", "1e400", "-0", "0x10", "1_000", "+5", "5.", ".5", "³"]
    ),
)


@fuzzing
@given(name=st.sampled_from(["boards", "variables", "errors"]), content=st.binary(max_size=300))
def test_any_bytes_in_a_file_give_a_table_or_faults(tmp_path, name, content):
    load_or_be_told(write(tmp_path, **{name: content}))


@fuzzing
@given(content=st.text(max_size=300), name=st.sampled_from(["boards", "variables", "errors"]), at=st.integers(0, 2000))
def test_any_text_put_into_a_good_file_gives_a_table_or_faults(tmp_path, content, name, at):
    good = {"boards": BOARDS, "variables": VARIABLES, "errors": ERRORS}[name]
    text = good[: at % len(good)] + content + good[at % len(good) :]
    load_or_be_told(write(tmp_path, **{name: text.encode("utf-8", "surrogatepass")}))


@fuzzing
@given(changes=st.lists(st.tuples(st.integers(1, 7), st.integers(0, 11), cells), min_size=1, max_size=4))
def test_any_cells_in_a_good_table_give_a_table_or_faults(tmp_path, changes):
    import csv
    import io

    rows = list(csv.reader(io.StringIO(VARIABLES)))
    for row, column, cell in changes:
        rows[row][column] = cell
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    load_or_be_told(write(tmp_path, variables=text.getvalue().encode("utf-8", "surrogatepass")))


toml_values = st.recursive(
    st.one_of(
        st.integers(-(10**6), 10**20).map(str),
        st.booleans().map(lambda flag: str(flag).lower()),
        st.floats(allow_nan=False, allow_infinity=False).map(lambda value: repr(value)),
        st.sampled_from(['"LEG_ANGLE"', '"CAN1"', '"(x)"', '""', '"\\u0000"', "nan", "1979-05-27", "{ a = 1 }"]),
    ),
    lambda inner: st.lists(inner, max_size=3).map(lambda items: "[" + ", ".join(items) + "]"),
    max_leaves=6,
)


@fuzzing
@given(line=st.integers(0, len(BOARDS.splitlines()) - 1), value=toml_values)
def test_any_value_under_a_key_of_the_boards_gives_a_table_or_faults(tmp_path, line, value):
    lines = BOARDS.splitlines()
    if "=" in lines[line]:
        lines[line] = lines[line].split("=")[0] + "= " + value
    load_or_be_told(write(tmp_path, boards="\n".join(lines)))


def test_line_breaks_and_endless_names_in_cells_do_not_spoil_the_message(tmp_path):
    spoiled = VARIABLES.replace("5,GAIN,f32,,1.5,PC", '5,LEG_COMMAND,f32,,1.5,"P\nC"')
    spoiled += f"7,{'N' * 5000},f32,,0,MB,PC,,,,,a name\n" + '8,"ERR_\nX",f32,,0,MB,PC,,,,,a name\n'
    write(tmp_path, variables=spoiled)
    load_or_be_told(tmp_path)
    assert "variables.csv:7 LEG_COMMAND publisher: two publishers, MB and P\\nC" in map(str, faults_of(tmp_path))
