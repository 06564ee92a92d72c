"""Parameter sets: what they hold, and one clear line for everything that can be wrong with a file."""

import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ranger_sim.boards.main_brain import controllers, programs
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.generated.all_variables import TABLE_SIZE
from ranger_sim.datatable.store import DataStore
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.user_error import UserError
from tests.examples import examples


def test_every_set_loads_and_gives_the_parameters_of_its_program_and_no_others():
    assert {"record-2011", "robust", "reflex", "efficient"} <= set(controllers.available())
    for name in controllers.available():
        controller = controllers.load(name)
        assert set(controller.values) == programs.program(controller.program).parameters()
        assert controller.name == name
    assert controllers.load("robust").program == "record" and controllers.load("reflex").program == "reflex"


def test_every_parameter_of_the_table_is_read_by_a_program():
    read = set().union(*(each.parameters() for each in programs.PROGRAMS.values()))
    assert read == set(programs.parameter_rows())


def test_a_base_of_another_program_gives_what_both_read(tmp_path):
    reflex, record = controllers.load("reflex"), controllers.load("record-2011")
    assert reflex.base == "record-2011"
    shared = set(reflex.values) & set(record.values)
    assert {"P_E_GYRO_BIAS", "P_S_MAX_CUR", "P_HI_SH_H_TANG", "P_UI_LCD_TIME", "D_UI_STOP_ON_FALL"} <= shared
    assert all(reflex.values[name] == record.values[name] for name in shared - set(reflex.changes))
    # what differs from the base needs a reason, what the base does not have needs none
    assert set(reflex.reasons) == set(reflex.changes) & shared
    path = write(tmp_path, 'base = "reflex"\n')
    assert controllers.load(path).program == "reflex"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('program = "dance"\n', ("dance", "record", "reflex")),
        ("program = 3\n", ("program", "3", "text")),
        ('base = "reflex"\n[parameters]\nC_H_PM_H_RATE = 3.0\n', ("C_H_PM_H_RATE", "'reflex' does not read it")),
        ('base = "record-2011"\n[parameters]\nR_W_REF = -0.5\n', ("R_W_REF", "'record' does not read it")),
        ('base = "record-2011"\nprogram = "reflex"\n', ("lacks", "R_W_REF", "R_F_FD_KV")),
    ],
)
def test_a_set_that_does_not_fit_its_program_gets_one_clear_line(tmp_path, text, words):
    with pytest.raises(UserError) as caught:
        controllers.load(write(tmp_path, text))
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_a_board_does_not_take_the_set_of_another_program():
    board = MainBrainBoard(Crystal(), Quirks(), 0, "reflex")
    board.load_controller("reflex")
    with pytest.raises(UserError, match="robust.*'record'.*'reflex'"):
        board.load_controller("robust")
    assert board.controller.name == "reflex"


def test_the_first_set_of_each_program_is_what_the_table_starts_with():
    for name, value in {**controllers.load("reflex").values, **controllers.load("record-2011").values}.items():
        assert value == pytest.approx(table.INITIAL[getattr(table, name)], rel=1e-7)  # single precision


# robot.md C1.8, copied from there name by name, not from the set.
WALK_OF_MAY_2011 = {
    "C_H_OUTER_STIFFNESS": 2,
    "C_H_PM_H_RATE": 3,
    "P_H_PM_H_TRATE": 2,
    "P_H_PM_TIME": 300,
    "C_HI_SH_H_ANG": 30,
    "C_HI_SH_H_RATE": 3,
    "P_HI_SH_H_TANG": 0.35,
    "C_H_EH_H_ANG": 30,
    "C_H_EH_H_RATE": 4,
    "P_H_EH_H_TANG": 0.35,
    "P_H_EHOLD_ANG": 0.2,
    "P_H_EHOLD_ANG2": 0.3,
    "P_H_EH_L_TRATE": 0.4,
    "P_H_PM_F_RATE": 5,
    "D_H_ON": 1,
    "DP_H_AM_H_ANG": 0,
    "DP_H_AM_L_ABSRATE": 0.72,
    "DP_H_AM_H_RATE": 1.66,
    "DP_H_AM_TIME1": 150,
    "DP_H_AM_TIME2": 300,
    "DC2_H_AM_H_ANG1": -1,
    "DC2_H_AM_H_ANG2": -0.5,
    "DC2_H_AM_H_RATE1": -0.3,
    "DC2_H_AM_H_RATE2": -0.2,
    "DC3_H_AM_H_ANG1": 2,
    "DC3_H_AM_H_ANG2": 1,
    "DC3_H_AM_L_ABSRATE1": 0,
    "DC3_H_AM_L_ABSRATE2": 0,
    "DC3_H_AM_H_RATE1": 0,
    "DC3_H_AM_H_RATE2": 0,
    "C_F_ST_F_ANG": 4,
    "C_F_ST_F_RATE": 0.2,
    "P_F_ST_F_TANG": 2.0,
    "C_F_PP_F_ANG": 10,
    "C_F_PP_F_RATE": 0,
    "P_F_PP_F_TANG": 0.2,
    "P_F_PP_FRAC_ANG": 0.5,
    "C_F_FU_F_ANG": 1.5,
    "C_F_FU_F_RATE": 0.1,
    "P_F_FU_F_TANG": 0.2,
    "C_F_FD_F_ANG": 1.5,
    "C_F_FD_F_RATE": 0.1,
    "P_F_FD_F_TANG": 2.0,
    "C_F_SST_F_ANG": 30,
    "C_F_SST_F_RATE": 0.3,
    "P_F_SST_F_TANG": 2.0,
    "P_F_PP_F_ABSANG": 1.7,
    "P_FO_PP_THEIGHT": 0.012,
    "P_FI_PP_THEIGHT": 0.012,
    "P_F_FU_H_ANG": 0.1,
    "P_F_FU_F_CABL_STRETCH": 0.07,
    "P_F_AP_TIME": 30,
    "D_F_ON": 1,
    "DP_F_PP_L_ABSRATE": 0.65,
    "DC_F_PP_L_ABSRATE": 5,
    "DC_F_PP_L_ABSRATE2": 0.5,
    "P_S_NULL_H_TANG": 0.1,
    "P_S_MAX_CUR": 75,
    "P_S_ILST_TWITCH_FRAC": 1,
    "P_S_ILST_TWITCH_TIME": 1,
    "P_S_RC_DEADBAND": 0.02,
    "P_UI_PP2HS_TTIME": 70,
}
# Literals of the robot's programs (robot.md C1.0, C1.6, C1.7, C3.1, C3.2), and our own.
NOT_IN_ITS_LIST = {
    "D_S_SHUT_DOWN": 1,
    "P_L_START_ABSRATE": 0.5,
    "P_L_START_H_RATE": 1.66,
    "P_E_GYRO_BIAS": -0.004,
    "P_E_ROLL_BIAS": -0.021,
    "P_E_RESET": 0.1,
    "P_E_HS_THRESHOLD": 2000,
    "P_E_HS_BASE_LIMIT": 5000,
    "P_E_HS_TICKS": 2,
    "P_E_HS_H_ANG": 0.005,
    "P_E_HS_F_ANG": 0.8,
    "P_E_MIN_STEP_TIME": 250,
    "P_E_FALL_ANG": math.pi / 4,
    "P_UI_LCD_TIME": 4000,
    "P_UI_SONG_STEPS": 3000,
    "D_UI_STOP_ON_FALL": 1,
}


def test_every_record_parameter_is_that_of_the_walk():
    assert controllers.load("record-2011").values == {**WALK_OF_MAY_2011, **NOT_IN_ITS_LIST}


def test_each_difference_of_the_robust_set_has_a_reason():
    robust = controllers.load("robust")
    record = controllers.load("record-2011")
    assert robust.base == "record-2011"
    different = {name for name in robust.values if robust.values[name] != record.values[name]}
    assert different == set(robust.changes) == set(robust.reasons)
    assert different


def test_a_set_is_written_into_the_data_table():
    store = DataStore(TABLE_SIZE)
    controllers.load("robust").apply(store)
    assert store.get_float(table.P_FO_PP_THEIGHT) == pytest.approx(controllers.load("robust").values["P_FO_PP_THEIGHT"])
    assert store.get_float(table.C_F_PP_F_ANG) == 10.0


def test_the_operators_script_says_how_the_robot_is_held_and_which_keys_are_pressed():
    operator = controllers.load("robust").operator
    assert operator.stance == "outer"
    assert operator.hip_angle_rad == 0.35
    assert [press.key for press in operator.keys] == [1]
    assert operator.keys[0].time_s < operator.release_time_s


def write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return str(path)


BASE = 'base = "record-2011"\n'


@pytest.mark.parametrize(
    "text, words",
    [
        ("title = ", ("mine.toml", "not valid TOML")),
        ("title = 3\n" + BASE, ("mine.toml", "title", "3", "text")),
        ('colour = "red"\n' + BASE, ("mine.toml", "colour", "allowed")),
        ('base = "nothing"\n', ("nothing", "unknown", "record-2011")),
        ("[parameters]\nP_F_ST_F_TANG = 2.0\n", ("mine.toml", "lacks", "C_H_OUTER_STIFFNESS")),
        (BASE + "[parameters]\nP_WRONG = 1.0\n", ("mine.toml", "P_WRONG", "no such parameter")),
        (BASE + '[parameters]\nP_F_ST_F_TANG = "2"\n', ("mine.toml", "P_F_ST_F_TANG", "'2'", "number")),
        (BASE + "[parameters]\nP_F_ST_F_TANG = true\n", ("P_F_ST_F_TANG", "True", "number")),
        (BASE + "[parameters]\nP_F_ST_F_TANG = nan\n", ("P_F_ST_F_TANG", "nan", "number")),
        (BASE + "[parameters]\nP_F_ST_F_TANG = 9.0\n", ("P_F_ST_F_TANG", "9 is outside 0 to 3.2 rad")),
        (BASE + "[parameters]\nP_F_ST_F_TANG = 2.1\n", ("P_F_ST_F_TANG", "reason")),
        (
            BASE + '[parameters]\nP_F_ST_F_TANG = 2.1\n[reasons]\nP_F_ST_F_TANG = ""\n',
            ("P_F_ST_F_TANG", "sentence"),
        ),
        (BASE + '[reasons]\nP_F_ST_F_TANG = "why"\n', ("P_F_ST_F_TANG", "no such entry")),
        ("parameters = 4\n" + BASE, ("parameters", "4", "table")),
        (BASE + '[operator]\nstance = "outer"\n', ("[operator]", "lacks")),
    ],
)
def test_a_broken_file_gets_one_clear_line(tmp_path, text, words):
    with pytest.raises(UserError) as caught:
        controllers.load(write(tmp_path, text))
    line = str(caught.value)
    assert "\n" not in line
    for word in words:
        assert word in line


OPERATOR = """
[operator]
stance = "outer"
lean_rad = 0.1
hip_angle_rad = 0.35
outer_ankle_rad = 1.8
inner_ankle_rad = 2.1
release_time_s = 1.0
release_rate_rad_per_s = 0.7
radio = 0.0
[[operator.keys]]
key = 1
time_s = 0.5
hold_s = 0.2
"""


def test_a_set_may_bring_its_own_operator(tmp_path):
    operator = controllers.load(write(tmp_path, BASE + OPERATOR)).operator
    assert (operator.lean_rad, operator.keys[0].time_s) == (0.1, 0.5)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"outer"', '"left"', ("stance", "'left'")),
        ("lean_rad = 0.1", "lean_rad = 0.9", ("lean_rad", "0.9", "-0.5 to 0.5")),
        ("key = 1", "key = 6", ("key", "6", "0 to 5")),
        ("key = 1", "key = 1.5", ("key", "1.5", "whole number")),
        ("hold_s = 0.2", "hold_s = 0.0", ("hold_s", "0.0")),
        ("hold_s = 0.2", "", ("hold_s",)),
        ("radio = 0.0", "radio = 0.0\ncolour = 1", ("colour",)),
    ],
)
def test_a_broken_operator_gets_one_clear_line(tmp_path, old, new, words):
    with pytest.raises(UserError) as caught:
        controllers.load(write(tmp_path, BASE + OPERATOR.replace(old, new)))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("name", ["", "nobody", "../robust", "/nowhere/x.toml", "."])
def test_an_unknown_set_gets_one_clear_line(name):
    with pytest.raises(UserError) as caught:
        controllers.load(name)
    assert "\n" not in str(caught.value)


def test_a_folder_is_not_a_set(tmp_path):
    (tmp_path / "x.toml").mkdir()
    with pytest.raises(UserError, match="x.toml"):
        controllers.load(tmp_path / "x.toml")


def test_a_set_that_is_its_own_base_is_refused(tmp_path):
    one, two = tmp_path / "one.toml", tmp_path / "two.toml"
    one.write_text(f'base = "{one}"\n')
    with pytest.raises(UserError, match=r"one\.toml: base .* leads back to this set"):
        controllers.load(one)
    one.write_text(f'base = "{two}"\n')
    two.write_text(f'base = "{one}"\n')
    with pytest.raises(UserError, match=r"two\.toml: base .*one\.toml' leads back to this set"):
        controllers.load(one)


def test_a_file_may_be_called_as_the_set_of_the_package_that_is_its_base(tmp_path):
    path = tmp_path / "robust.toml"
    path.write_text('base = "robust"\n')
    assert controllers.load(path).values == controllers.load("robust").values


toml_values = st.one_of(
    st.floats().map(lambda x: repr(x)),
    st.integers(-(2**70), 2**70).map(str),
    st.sampled_from(["true", '"text"', "[1, 2]", "{ a = 1 }", "1979-05-27", "inf", "-nan"]),
)


@settings(max_examples=examples(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    key=st.sampled_from(["title", "base", "parameters", "reasons", "operator", "P_F_ST_F_TANG", "stance", "keys"]),
    value=toml_values,
    where=st.sampled_from(["", "[parameters]\n", "[reasons]\n", "[operator]\n", "[[operator.keys]]\n"]),
)
def test_no_value_anywhere_makes_a_traceback(tmp_path, key, value, where):
    path = tmp_path / "fuzz.toml"
    path.write_text(f'base = "record-2011"\n{where}{key} = {value}\n')
    try:
        controllers.load(path)
    except UserError as error:
        assert "\n" not in str(error)


@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=200))
def test_no_bytes_make_a_traceback(tmp_path, content):
    path = tmp_path / "fuzz.toml"
    path.write_bytes(content)
    with pytest.raises(UserError):
        controllers.load(path)
