"""The catalogue is whole, its names are those of the terms that can be put into the simulator, and they stay."""

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import terms
from ranger_sim.sysid import causes

# In the order of the catalogue: reports and users' programs hold on to these names.
IDENTIFIERS = """
contact_drop_change resistance_temperature torque_constant_temperature inductance_frequency pwm_ripple dead_time
battery_sag charge_drift current_step_at_zero_duty sensor_scale sensor_offset voltage_clip cogging commutation_ripple
once_per_turn coulomb_friction viscous_friction stribeck presliding load_friction direction_friction friction_warm_up
cable_backlash cable_stiffening cable_creep pulley_slip hip_spring_bend return_spring eccentricity lost_counts
sensor_lag bit_flip clock_drift gyro_misalignment sensor_scale sensor_offset leg_asymmetry floor contact_loss drag
geometry inertia spring_value sensor_offset firmware_parameter
""".split()


def test_the_identifiers_are_in_their_order():
    assert [cause.identifier for cause in causes.CAUSES.values()] == IDENTIFIERS
    assert {cause.number for cause in causes.CAUSES.values()} == set(range(1, causes.NUMBERS + 1))


def test_a_cause_with_a_form_has_its_name_and_may_stand_where_the_cause_says():
    spring = {"hip_spring_bend": "spring", "return_spring": "spring"}  # one form of the simulator, two springs
    for cause in causes.CAUSES.values():
        if cause.identifier in terms.FORMS:
            assert cause.form == cause.identifier
        else:
            assert cause.form == spring.get(cause.identifier, "")
        if cause.form:
            assert cause.form in terms.FORMS
    places = {"current": "hip_motor_current", "gyro": "gyro"}
    for cause in causes.CAUSES.values():
        if cause.at in places and cause.form and places[cause.at] in terms.ANALOG_NAMES + ("gyro",):
            assert places[cause.at] in terms.FORMS[cause.form].places


def test_every_cause_names_known_balances_and_known_rivals():
    for cause in causes.CAUSES.values():
        assert cause.balances and set(cause.balances) <= set(causes.BALANCES)
        assert all(1 <= number <= causes.NUMBERS for number in cause.confusable)
        assert cause.meaning[0].islower() and not cause.meaning.endswith(".")
        assert cause.key not in causes.rivals(cause)


def test_a_cause_is_found_by_key_or_by_a_name_that_is_at_one_place():
    assert causes.find("stribeck").number == 17
    assert causes.find("sensor_offset@gyro").number == 33
    with pytest.raises(UserError, match="sensor_offset: this cause has several places: sensor_offset@current"):
        causes.find("sensor_offset")
    with pytest.raises(UserError, match="unknown cause 'ghost'"):
        causes.find("ghost")
    assert causes.as_json(causes.find("drag"))["confusable_with"] == [
        "coulomb_friction",
        "viscous_friction",
        "stribeck",
    ]
