"""Every cause of the catalogue has a sentence on where to look, and places are distinguished."""

import pytest

from ranger_sim.sysid import causes, inspection


def test_every_cause_shows_where_to_look_in_one_sentence():
    for key in causes.CAUSES:
        text = inspection.LOOK_AT[key]
        assert text.endswith(".") and text.count(". ") == 0, key
        assert 40 < len(text) < 260, key
    general = {"sensor_offset", "sensor_scale"}
    assert set(inspection.LOOK_AT) == set(causes.CAUSES) | general
    assert len(set(inspection.LOOK_AT.values())) == len(inspection.LOOK_AT)


@pytest.mark.parametrize(
    ("at", "place"),
    [
        ("current_A", "sensor_offset@current"),
        ("hip_motor_current", "sensor_offset@current"),
        ("gyro", "sensor_offset@gyro"),
        ("joint_angle_rad", "sensor_offset@angle"),
        ("torque_Nm", "sensor_offset"),
        ("", "sensor_offset"),
    ],
)
def test_a_sensors_place_chooses_the_sentence(at, place):
    assert inspection.look_at("sensor_offset", at) == inspection.LOOK_AT[place]


def test_a_cause_of_a_users_own_has_no_sentence_but_words():
    assert inspection.look_at("haunted_gearbox", "attic") == ""
    assert inspection.meaning("haunted_gearbox") == "haunted gearbox"
    assert inspection.meaning("sensor_offset", "torque_Nm") == "torque_Nm shows a constant too much or too little"
    assert inspection.meaning("cogging") == "the rotor's teeth pull towards preferred angles"
