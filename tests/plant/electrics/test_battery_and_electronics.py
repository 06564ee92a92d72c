"""Battery voltage, charge and losses; the electronics' itemised power."""

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.electrics import electronics
from ranger_sim.plant.electrics.battery import Battery, BatteryParameters

H = 125e-6


def test_seven_packs_of_67_Wh_hold_the_nominal_470_Wh():
    p = BatteryParameters()
    assert p.packs * p.pack_energy_Wh == 469.0
    battery = Battery(BatteryParameters(charge=1.0, pack_resistance_ohm=0.0))
    while not battery.cut_off:
        battery.step(10.0, 10.0, 0.0)
    assert battery.delivered_J / 3600.0 == pytest.approx(469.0, rel=0.005)


def test_the_mean_cell_voltage_is_the_nominal_3_7_volts():
    p = BatteryParameters()
    assert p.capacity_As * 25.9 / 3600.0 == pytest.approx(469.0, rel=0.002)


def test_voltage_without_load_runs_from_21_to_29_4_volts_and_always_falls():
    battery = Battery()
    assert battery.open_circuit_V(0.0) == pytest.approx(21.0)
    assert battery.open_circuit_V(1.0) == pytest.approx(29.4)
    volts = [battery.open_circuit_V(i / 200.0) for i in range(201)]
    assert all(a < b for a, b in zip(volts, volts[1:], strict=False))


def test_the_terminal_voltage_solves_current_and_power_together():
    battery = Battery()
    battery.step(H, 5.0, 5.15)
    V, R = battery.voltage_V, 0.5 / 7
    assert V == pytest.approx(26.74 - R * (5.0 + 5.15 / V), rel=1e-12)
    assert battery.current_A == pytest.approx(5.0 + 5.15 / V, rel=1e-12)


def test_one_pack_sags_3_volts_at_140_watts():
    battery = Battery(BatteryParameters(packs=1))
    battery.step(H, 0.0, 140.0)
    assert 26.74 - battery.voltage_V == pytest.approx(3.0, abs=0.3)


def test_charge_is_the_integral_of_the_current_and_energy_is_kept():
    battery = Battery()
    start = battery.charge
    for _ in range(8000):  # one second; 8000 roundings of 1e-16 of a charge of 1e-5
        battery.step(H, 3.0, 0.0)
    assert (start - battery.charge) * battery.parameters.capacity_As == pytest.approx(3.0, rel=1e-8)
    # E I t = V I t + R I^2 t; E falls by 1e-5 V in this second
    assert battery.delivered_J + battery.lost_J == pytest.approx(26.74 * 3.0, rel=1e-5)


def test_feeding_current_back_charges_the_battery():
    battery = Battery()
    battery.step(1.0, -2.0, 0.0)
    assert battery.charge > battery.parameters.charge
    assert battery.voltage_V > battery.open_circuit_V(battery.parameters.charge)


def test_the_protection_opens_when_the_packs_are_empty():
    battery = Battery(BatteryParameters(charge=1e-6))
    battery.step(10.0, 10.0, 0.0)
    assert battery.cut_off and battery.voltage_V == 0.0
    battery.step(H, 1.0, 5.0)
    assert battery.voltage_V == 0.0 and battery.current_A == 0.0


def test_more_power_than_the_battery_can_give_is_limited_and_stays_finite():
    battery = Battery()
    battery.step(H, 0.0, 1e6)
    assert battery.voltage_V == pytest.approx(0.5 * 26.74)


@pytest.mark.parametrize(
    "field, value",
    [("packs", 0), ("charge", 1.1), ("charge", 0.0), ("pack_resistance_ohm", -1.0), ("cell_volts", (4.0,))],
)
def test_impossible_battery_numbers_are_refused_by_name(field, value):
    with pytest.raises(UserError, match=field):
        BatteryParameters(**{field: value})


def test_the_electronics_draw_5_15_watts_and_4_7_on_the_long_walk():
    assert electronics.power_W() == pytest.approx(5.15, abs=1e-12)
    assert electronics.power_W(("left-outer-ankle",)) == pytest.approx(4.70, abs=1e-12)
    assert sum(electronics.itemised_W().values()) == pytest.approx(5.15, abs=1e-12)
    assert sum(electronics.itemised_W(("left-outer-ankle",)).values()) == pytest.approx(4.70, abs=1e-12)


def test_every_item_of_the_electronics_is_positive_and_has_a_source():
    assert all(watts > 0.0 for watts in electronics.itemised_W().values())
    assert all(source for _, _, source in electronics.ITEMS)
    assert len({name for name, _, _ in electronics.ITEMS}) == len(electronics.ITEMS)


def test_four_angle_encoders_take_0_8_of_5_watts():
    items = electronics.itemised_W()
    assert sum(watts for name, watts in items.items() if "absolute encoder" in name) == pytest.approx(0.8)


def test_switching_an_item_off_saves_its_power_and_its_share_of_the_converter():
    assert electronics.power_W() - electronics.power_W(off=("inertial sensor",)) == pytest.approx(0.4 / (8.0 / 9.0))


def test_an_unknown_item_is_refused_with_the_list_of_items():
    with pytest.raises(UserError, match="'toaster'.*main brain"):
        electronics.power_W(off=("toaster",))
