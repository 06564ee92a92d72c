"""Units against the definitions of prefixes, degrees, turns and minutes: a word is a prefix and a base."""

import math

import pytest

from ranger_sim.sysid import units
from ranger_sim.sysid.units import unit_of

PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
BASES = ("s", "A", "V", "W", "ohm", "H", "rad", "m", "N", "Nm", "Pa", "Hz", "K", "J", "mol")
HOUR_s = 60.0 * 60.0
OTHERS = {  # a word: (what it is in SI, its SI unit)
    "min": (60.0, "s"), "h": (HOUR_s, "s"), "d": (24.0 * HOUR_s, "s"),
    "sec": (1.0, "s"), "Amp": (1.0, "A"), "Volt": (1.0, "V"),
    "Wh": (HOUR_s, "J"), "kWh": (1e3 * HOUR_s, "J"), "Ohm": (1.0, "ohm"), "Ω": (1.0, "ohm"), "bar": (1e5, "Pa"),
    "deg": (math.radians(1.0), "rad"), "°": (math.radians(1.0), "rad"), "degree": (math.radians(1.0), "rad"),
    "degrees": (math.radians(1.0), "rad"), "rev": (math.radians(360.0), "rad"), "turn": (math.radians(360.0), "rad"),
    "turns": (math.radians(360.0), "rad"), "kg": (1.0, "kg"), "counts": (1.0, "counts"), "count": (1.0, "counts"),
    "Nmm": (1e-3, "Nm"), "Ncm": (1e-2, "Nm"),
}  # fmt: skip


def meant(word):
    """(factor, SI unit) of a word by its prefix and base."""
    if word in OTHERS:
        return OTHERS[word]
    for base in sorted(BASES, key=len, reverse=True):
        if word.endswith(base) and word[: len(word) - len(base)] in PREFIXES:
            return PREFIXES[word[: len(word) - len(base)]], base
    raise AssertionError(f"{word}: no prefix and base of which it is made")


LITRES = {"l": 1e-3, "L": 1e-3, "ml": 1e-6, "mL": 1e-6}


@pytest.mark.parametrize("word", sorted(units.ATOMS.keys() - LITRES))
def test_each_word_is_worth_what_its_prefix_says(word):
    factor, base = meant(word)
    # beside something else, for K alone is a temperature
    found = unit_of(f"W {word}")
    assert found.factor == pytest.approx(factor, rel=1e-15) and found.numerator == ("W", base)
    below = unit_of(f"W/{word}2")
    assert below.factor == pytest.approx(factor**-2, rel=1e-14) and below.denominator == (f"{base}2",)


@pytest.mark.parametrize("word", LITRES)
def test_a_litre_is_a_volume_in_cubic_metres(word):
    density, flow = unit_of(f"kg/{word}"), unit_of(f"{word}/min")
    assert density.same_kind(unit_of("kg/m3")) and flow.same_kind(unit_of("m^3/s"))
    assert density.factor == pytest.approx(1.0 / LITRES[word]) and flow.factor == pytest.approx(LITRES[word] / 60.0)
    assert units.split("hip_l") == ("hip_l", None)  # the left one


def test_a_part_of_an_unknown_unit_is_not_a_unit():
    assert units.split("Q_BTU_per_h") == ("Q_BTU_per_h", None)
    assert units.split("x_BTU_per_s2_per_h") == ("x_BTU_per_s2_per_h", None)
    stem, unit = units.split("Q_kJ_per_h")
    assert (stem, unit.text, unit.factor) == ("Q", "J/s", pytest.approx(1000.0 / 3600.0))


@pytest.mark.parametrize(
    ("text", "one", "zero", "kind"),
    [
        ("rpm", math.radians(360.0) / 60.0, 0.0, "rad/s"),
        ("rps", math.radians(360.0), 0.0, "rad/s"),
        ("dps", math.radians(1.0), 0.0, "rad/s"),
        ("K", 1.0 - 273.15, -273.15, "C"),
        ("degC", 1.0, 0.0, "C"),
        ("%", 0.01, 0.0, ""),
        ("percent", 0.01, 0.0, ""),
        *(
            (each, math.radians(360.0) / 60.0, 0.0, "rad/s")
            for each in ("U/min", "Umdr/min", "r/min", "rev/min", "1/min", "min-1", "min^-1", "min⁻¹")
        ),
        *((each, 1.0, 0.0, each[0]) for each in ("Arms", "A rms", "A_rms", "Vrms", "Aeff")),
        ("enum", 1.0, 0.0, ""),
        ("bool", 1.0, 0.0, ""),
        ("1", 1.0, 0.0, ""),
        ("-", 1.0, 0.0, ""),
        ("", 1.0, 0.0, ""),
    ],
)
def test_one_and_nothing_of_a_unit_are_what_they_are_in_si(text, one, zero, kind):
    found = unit_of(text)
    assert found.factor * 1.0 + found.offset == pytest.approx(one, rel=1e-15)
    assert found.offset == zero and found.text == kind
    assert found.is_si == (one == 1.0 and zero == 0.0)


@pytest.mark.parametrize(
    ("text", "kind", "suffix", "factor"),
    [
        ("N m", "N m", "Nm", 1.0),
        ("mN m/deg", "N m/rad", "Nm_per_rad", 1e-3 / math.radians(1.0)),
        ("A s/rad", "A s/rad", "A_s_per_rad", 1.0),
        ("mA ms/deg", "A s/rad", "A_s_per_rad", 1e-6 / math.radians(1.0)),
        ("deg/s", "rad/s", "rad_per_s", math.radians(1.0)),
        ("deg/s^2", "rad/s2", "rad_per_s2", math.radians(1.0)),
        ("deg/ms²", "rad/s2", "rad_per_s2", math.radians(1.0) * 1e6),
        ("1/ms", "1/s", "per_s", 1e3),
        ("kg m^2", "kg m2", "kg_m2", 1.0),
        ("kg cm²", "kg m2", "kg_m2", 1e-4),
        ("mm^3", "m3", "m3", 1e-9),
        ("(mm) / (ms)", "m/s", "m_per_s", 1.0),
        ("N·mm·s", "N m s", "N_m_s", 1e-3),
        ("rad*s^-1", "rad/s", "rad_per_s", 1.0),
        ("rad s-1", "rad/s", "rad_per_s", 1.0),
        ("deg·s⁻²", "rad/s2", "rad_per_s2", math.radians(1.0)),
        ("mm.s^-2", "m/s2", "m_per_s2", 1e-3),
        ("V s mm^(-1)", "V s/m", "V_s_per_m", 1e3),
        ("ms^-1", "1/s", "per_s", 1e3),
    ],
)
def test_products_quotients_and_powers_multiply_their_factors(text, kind, suffix, factor):
    found = unit_of(text)
    assert found is not None
    assert found.factor == pytest.approx(factor, rel=1e-14)
    if text != "N·mm·s":  # N and m side by side are one
        assert (found.text, found.suffix) == (kind, suffix)
    assert found.same_kind(unit_of(text)) and not found.same_kind(unit_of("V/K"))


@pytest.mark.parametrize("text", ["furlong", "A/", "/per/s", "A per s per V", "m5", "per"])
def test_what_is_not_a_unit_is_none(text):
    assert unit_of(text) is None


@pytest.mark.parametrize(
    ("column", "stem", "suffix", "factor"),
    [
        ("current_mA", "current", "A", 1e-3),
        ("speed_deg_s", "speed", "rad_per_s", math.radians(1.0)),
        ("accel_mm_s2", "accel", "m_per_s2", 1e-3),
        ("cmd_dampness_A_s_per_rad", "cmd_dampness", "A_s_per_rad", 1.0),
        ("Motor current [mA]", "Motor_current", "A", 1e-3),
        ("torque_N_mm", "torque", "Nm", 1e-3),
        ("time_min", "time", "s", 60.0),
        ("t_h", "t", "s", HOUR_s),
        ("load (%)", "load", "", 0.01),
    ],
)
def test_a_column_is_split_where_its_unit_begins(column, stem, suffix, factor):
    found, unit = units.split(column)
    assert (found, unit.suffix) == (stem, suffix) and unit.factor == pytest.approx(factor, rel=1e-14)
    assert units.si_name(found, unit) == (f"{stem}_{suffix}" if suffix else stem)


@pytest.mark.parametrize(
    "column",
    [
        "current_min",
        "current_1",
        "current_d",
        "height_h",
        "A",
        "motor [furlong]",
        "V_V_V_V_V_V_V_x",
        "xyz[1]",
        "walk_state",
        "brake_flag",
        "motor_A-1",
    ],
)
def test_what_only_looks_like_a_unit_stays_in_the_name(column):
    assert units.split(column)[1] is None


def test_a_number_in_brackets_is_an_index_and_behind_a_space_a_pure_number():
    assert units.split("xyz[1]") == ("xyz[1]", None) and units.split("q[0]") == ("q[0]", None)
    stem, unit = units.split("ratio [1]")
    assert (stem, unit.text, unit.factor) == ("ratio", "", 1.0)
