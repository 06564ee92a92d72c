"""Bodies by name: what the files of plant/bodies say, what a user's file may say, and what is wrong with it."""

import dataclasses
import json
import math
import re

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.plant.electrics.electrics import Electrics
from ranger_sim.plant.mechanics.body import Body
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.tools import cli


def written(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def refused(tmp_path, text):
    """The one line with which a file is refused."""
    path = written(tmp_path, text)
    with pytest.raises(UserError) as reported:
        body_files.load(path)
    line = str(reported.value)
    assert path in line and "\n" not in line
    return line


def test_the_body_of_the_appendix_has_its_printed_numbers():
    p = body_files.load("appendix").parameters
    assert (p.outer_foot_radius_m, p.inner_foot_radius_m) == (0.2, 0.2)
    assert (p.outer_ankle_offset_m, p.inner_ankle_offset_m) == (0.11, 0.11)
    assert (p.outer_mass_offset_kg_m, p.inner_mass_offset_kg_m) == (0.0, 0.0)
    assert p.foot_inertia_kg_m2 == 0.0
    assert p.contact == "sticking"
    assert not Body(p).unilateral


def test_the_robots_ankles_are_54_mm_above_its_soles_and_its_mass_lies_ahead():
    p = body_files.load("ranger").parameters
    # r - d of the firmware's estimator, robot.md C3.1: the same 54 mm for both legs
    assert p.outer_foot_radius_m - p.outer_ankle_offset_m == pytest.approx(0.054, abs=1e-9)
    assert p.inner_foot_radius_m - p.inner_ankle_offset_m == pytest.approx(0.054, abs=1e-9)
    # section 2 of the appendix: 1 m from sole to hip, two digits
    assert p.leg_length_m + 0.054 == pytest.approx(1.0, abs=0.05)
    assert 0.035 <= p.outer_mass_offset_kg_m <= 0.04 and 0.035 <= p.inner_mass_offset_kg_m <= 0.04
    assert 0.001 <= p.foot_inertia_kg_m2 <= 0.0013
    assert p.contact != "sticking"


@pytest.mark.parametrize("name", body_files.available())
def test_every_body_says_where_each_number_comes_from(name):
    body = body_files.load(name)
    assert set(body.values) == set(body.sources) == set(body_files.keys())
    assert all(len(source) > 5 for source in body.sources.values())
    assert body.title and body.description


def test_a_file_changes_what_it_names_and_keeps_the_rest_of_its_base(tmp_path):
    body = body_files.load(
        written(
            tmp_path,
            'base = "ranger"\n[parameters]\nleg_length_m = 1\nouter_ankle_constant_friction_Nm = 0.03\n'
            '[sources]\nleg_length_m = "measured"\nouter_ankle_constant_friction_Nm = "oiled"\n',
        )
    )
    base = body_files.load("ranger")
    assert body.parameters == dataclasses.replace(base.parameters, leg_length_m=1.0)
    assert body.changes == {"leg_length_m": 1.0, "outer_ankle_constant_friction_Nm": 0.03}
    electrics = Electrics(body.electrics)
    assert (electrics.outer_ankle.C0, electrics.inner_ankle.C0) == (
        0.03,
        base.electrics.inner_ankle.constant_friction_Nm,
    )
    assert body.sources["leg_length_m"] == "measured (mine)"


def test_gears_and_rotor_of_body_motors_and_encoders_are_the_same(tmp_path):
    body = body_files.load(
        written(
            tmp_path,
            'base = "appendix"\n[parameters]\nhip_gear = 50.0\nankle_gear = 43.0\nmotor_inertia_kg_m2 = 2e-6\n'
            '[sources]\nhip_gear = "x"\nankle_gear = "x"\nmotor_inertia_kg_m2 = "x"\n',
        )
    )
    plant = RangerPlant(parameters=body.parameters, electrics=body.electrics)
    assert (plant.hip.gear, plant.outer_ankle.gear, plant.inner_ankle.gear) == (50.0, 43.0, 43.0)
    assert plant.hip.parameters.reflected_inertia_kg_m2 == pytest.approx(body.parameters.hip_rotor_inertia_kg_m2)
    # EQUATIONS 11.1: edges of channel A, two for each of 192 and 512 lines, per turn of the rotor
    for encoder, edges in ((plant.hip_motor, 2 * 192 * 50), (plant.inner_motor, 2 * 512 * 43)):
        turned = encoder.position(0.1) - encoder.position(0.0)
        assert turned == pytest.approx(0.1 / (2.0 * math.pi) * edges, abs=1.0)  # errors of the disc: below an edge


def test_each_leg_has_its_own_foot(tmp_path):
    body = Body(
        BodyParameters(
            outer_foot_radius_m=0.168,
            outer_ankle_offset_m=0.114,
            inner_foot_radius_m=0.23,
            inner_ankle_offset_m=0.176,
        )
    )
    assert (body.outer.r, body.outer.d, body.inner.r, body.inner.d) == (0.168, 0.114, 0.23, 0.176)


def test_all_faults_of_a_file_come_in_one_line_with_key_value_and_limit(tmp_path):
    line = refused(
        tmp_path,
        'colour = "red"\ntitle = 3\n[parameters]\nleg_length_m = 96\ncontact = "glue"\nlegs = 4\nhip_rotor = 1\n'
        'ankle_spring_Nm_per_rad = "stiff"\ninner_ankle_load_friction = -0.1\n[sources]\nlegs = "counted"\n'
        'leg_length_m = "  "\ngravity_m_per_s2 = "the moon"\n',
    )
    for words in (
        "'colour'",
        "title = 3",
        "leg_length_m is 96, allowed are 0.05 to 10 m",
        "contact is 'glue', allowed are 'sticking' and 'unilateral'",
        "legs = 4: no such parameter",
        "hip_rotor is 1, allowed are False and True",
        "ankle_spring_Nm_per_rad is 'stiff', it must be a finite number",
        "inner_ankle_load_friction is -0.1, allowed are 0 to 0.9",
        "[sources] lacks contact",
        "[sources] gravity_m_per_s2: no such entry",
        "leg_length_m = '  ': a sentence is expected",
    ):
        assert words in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("= 1", "not valid TOML"),
        ('base = "nobody"\n', "nobody"),
        ('base = "mine"\n', "leads back"),
        ("parameters = 3\n", "[parameters]"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(UserError, match=re.escape(words)):
        body_files.load(path)


def test_values_that_contradict_each_other_are_refused_with_the_file(tmp_path):
    line = refused(
        tmp_path, 'base = "appendix"\n[parameters]\nankle_stop_low_rad = 3.3\n[sources]\nankle_stop_low_rad = "x"\n'
    )
    assert "3.3" in line and "3.2" in line


def test_an_unknown_body_is_reported_with_those_that_exist():
    with pytest.raises(UserError, match="appendix, ranger"):
        body_files.load("unicorn")


@pytest.mark.parametrize(
    ("field", "low", "high"),
    [("leg_length_m", 0.05, 10.0), ("outer_mass_offset_kg_m", -1.0, 1.0), ("slope_rad", -0.5, 0.5)],
)
def test_limits_are_kept_on_both_sides(field, low, high):
    for value in (low, high):
        BodyParameters(**{field: value})
    for value in (low - 1e-9, high + 1e-9, math.nan, math.inf, -math.inf, True, "1"):
        with pytest.raises(UserError, match=field):
            BodyParameters(**{field: value})


@pytest.mark.parametrize(
    ("key", "low", "high"),
    [
        ("hip_resistance_ohm", 0.01, 1000.0),
        ("hip_contact_drop_V", 0.0, 10.0),
        ("hip_torque_constant_Nm_per_A", 1e-4, 10.0),
        ("hip_load_friction", 0.0, 0.9),
        ("hip_constant_friction_Nm", 0.0, 10.0),
        ("hip_viscous_friction_Nms", 0.0, 10.0),
        ("foot_rise_time_constant_s", 1e-4, 1.0),
        ("foot_share", 0.0, 1.0),
        ("foot_full_load_N", 0.1, 1000.0),
    ],
)
def test_limits_of_motors_and_sensors_are_kept_on_both_sides(tmp_path, key, low, high):
    def text(value):
        return f'title = "a body"\n[parameters]\n{key} = {value!r}\n[sources]\n{key} = "this test"\n'

    for value in (low, high):
        body_files.load(written(tmp_path, text(value)))
    for value in (low - 1e-6, high * 1.000001):
        with pytest.raises(UserError, match=f"{key} is .*, allowed are"):
            body_files.load(written(tmp_path, text(value)))


def test_the_command_shows_every_number_with_unit_limits_and_source(capsys):
    assert cli.main(["body", "show", "ranger", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["base"] == "appendix"
    by_key = {row["key"]: row for row in shown["parameters"]}
    assert set(by_key) == set(body_files.keys())
    assert by_key["leg_length_m"] | {"source": ""} == {
        "key": "leg_length_m",
        "value": 0.96,
        "unit": "m",
        "limits": "0.05 to 10",
        "source": "",
    }
    assert cli.main(["body", "show", "ranger", "--changes"]) == 0
    reported = capsys.readouterr().out
    assert "outer_ankle_offset_m" in reported and "leg_length_m" not in reported
    assert cli.main(["body", "list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(body_files.available())
