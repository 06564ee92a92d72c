"""Units in the names of columns, and their conversion to SI.

A column has its unit at the end of its name, `current_mA`, `rate_deg_per_s`, `torque_N_mm`, or in brackets,
`Motor current [mA]`. Temperatures stay in degrees Celsius, as `temperature_C` everywhere in the project.
An unknown unit counts as none: nothing is guessed.
"""

import dataclasses
import math
import re

# common spellings: (our spelling, factor). An exponent may follow: s2, m^2.
ATOMS: dict[str, tuple[str, float]] = {
    "s": ("s", 1.0), "ms": ("s", 1e-3), "us": ("s", 1e-6), "µs": ("s", 1e-6), "μs": ("s", 1e-6), "ns": ("s", 1e-9),
    "min": ("s", 60.0), "h": ("s", 3600.0), "d": ("s", 86400.0), "sec": ("s", 1.0),
    "A": ("A", 1.0), "mA": ("A", 1e-3), "uA": ("A", 1e-6), "kA": ("A", 1e3), "Amp": ("A", 1.0),
    "V": ("V", 1.0), "mV": ("V", 1e-3), "uV": ("V", 1e-6), "kV": ("V", 1e3), "Volt": ("V", 1.0),
    "W": ("W", 1.0), "mW": ("W", 1e-3), "kW": ("W", 1e3), "MW": ("W", 1e6),
    "J": ("J", 1.0), "mJ": ("J", 1e-3),
    "kJ": ("J", 1e3), "MJ": ("J", 1e6), "Wh": ("J", 3600.0), "kWh": ("J", 3.6e6),
    "ohm": ("ohm", 1.0), "Ohm": ("ohm", 1.0), "mohm": ("ohm", 1e-3), "Ω": ("ohm", 1.0), "mH": ("H", 1e-3),
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", math.pi / 180.0), "°": ("rad", math.pi / 180.0),
    "degree": ("rad", math.pi / 180.0), "degrees": ("rad", math.pi / 180.0),
    "rev": ("rad", 2.0 * math.pi), "turn": ("rad", 2.0 * math.pi), "turns": ("rad", 2.0 * math.pi),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "cm": ("m", 1e-2), "um": ("m", 1e-6), "µm": ("m", 1e-6), "km": ("m", 1e3),
    "N": ("N", 1.0), "mN": ("N", 1e-3), "kN": ("N", 1e3),
    "Nm": ("Nm", 1.0), "mNm": ("Nm", 1e-3), "Nmm": ("Nm", 1e-3), "Ncm": ("Nm", 1e-2), "kNm": ("Nm", 1e3),
    "l": ("m3", 1e-3), "L": ("m3", 1e-3), "ml": ("m3", 1e-6), "mL": ("m3", 1e-6),
    "mol": ("mol", 1.0), "mmol": ("mol", 1e-3), "kmol": ("mol", 1e3),
    "kg": ("kg", 1.0), "Pa": ("Pa", 1.0), "kPa": ("Pa", 1e3), "MPa": ("Pa", 1e6), "bar": ("Pa", 1e5),
    "Hz": ("Hz", 1.0), "kHz": ("Hz", 1e3), "MHz": ("Hz", 1e6),
    "counts": ("counts", 1.0), "count": ("counts", 1.0), "K": ("K", 1.0),
}  # fmt: skip
# words for more than one atom, or not a power of others: (numerator, denominator, factor, offset)
WHOLE: dict[str, tuple[str, str, float, float]] = {
    "rpm": ("rad", "s", 2.0 * math.pi / 60.0, 0.0),
    "RPM": ("rad", "s", 2.0 * math.pi / 60.0, 0.0),
    "rps": ("rad", "s", 2.0 * math.pi, 0.0),
    "dps": ("rad", "s", math.pi / 180.0, 0.0),
    "C": ("C", "", 1.0, 0.0),
    "degC": ("C", "", 1.0, 0.0),
    "°C": ("C", "", 1.0, 0.0),
    "K": ("C", "", 1.0, -273.15),
    "percent": ("", "", 1e-2, 0.0),
    "%": ("", "", 1e-2, 0.0),
    "1": ("", "", 1.0, 0.0),
    # usual for drives: per minute is revolutions per minute
    **{each: ("rad", "s", 2.0 * math.pi / 60.0, 0.0)
       for each in ("U/min", "Umdr/min", "Upm", "r/min", "1/min", "min-1", "min^-1", "min⁻¹")},
    # of an alternating current or voltage, the effective value (rms)
    **{f"{unit}{mark}": (unit, "", 1.0, 0.0) for unit in "AV" for mark in ("rms", "_rms", " rms", "(rms)", "eff")},
    # numbers of states and the like
    **{each: ("", "", 1.0, 0.0) for each in ("enum", "bool", "boolean", "state", "flag", "none", "unitless")},
}  # fmt: skip
# whole words, where a unit is expected: in a name "second" may be the second of two
SPELT_OUT = {
    "second": "s", "seconds": "s", "sekunde": "s", "sekunden": "s", "millisecond": "ms", "milliseconds": "ms",
    "msec": "ms", "usec": "us", "hour": "h", "hours": "h", "minute": "min", "minutes": "min",
    "volt": "V", "volts": "V", "ampere": "A", "amperes": "A", "amp": "A", "amps": "A", "watt": "W", "watts": "W",
    "newton": "N", "newtons": "N", "radian": "rad", "radians": "rad",
}  # fmt: skip
# current_min is a minimum and hip_l the left one; units of time by themselves only behind a word for it
AMBIGUOUS_ALONE = ("min", "h", "d", "l", "L")
WORDS_OF_NAMES = ("enum", "bool", "boolean", "state", "flag", "none", "unitless")  # walk_state is a name
TIME_WORDS = ("t", "time", "times", "timestamp", "timestamps", "stamp", "elapsed", "elapsed_time", "zeit")
SUPERSCRIPTS = str.maketrans("⁻−¹²³⁴", "--1234")
NEGATIVE = re.compile(r"([^\d^-]+)\^?\(?-([1-4])\)?")  # a word and its exponent
LONGEST_SUFFIX = 6  # tokens of a unit in a name, as in cmd_dampness_A_s_per_rad


@dataclasses.dataclass(frozen=True)
class Unit:
    """SI value = factor x written value + offset. `numerator`, `denominator`: SI units with exponents."""

    numerator: tuple[str, ...] = ()
    denominator: tuple[str, ...] = ()
    factor: float = 1.0
    offset: float = 0.0

    @property
    def text(self) -> str:
        """Text as in "A s/rad"; empty for a plain number."""
        top = " ".join("N m" if each == "Nm" else each for each in self.numerator)
        if not self.denominator:
            return top
        return f"{top or '1'}/{' '.join(self.denominator)}"

    @property
    def suffix(self) -> str:
        """Text as at the end of a name: "A_s_per_rad"."""
        parts = list(self.numerator)
        if self.denominator:
            parts += ["per", *self.denominator]
        return "_".join(parts)

    @property
    def is_si(self) -> bool:
        """True when no conversion is necessary."""
        return self.factor == 1.0 and self.offset == 0.0

    def same_kind(self, other: "Unit") -> bool:
        """True when both measure the same quantity."""
        return self.numerator == other.numerator and self.denominator == other.denominator


def unit_of(text: str) -> Unit | None:
    """The unit of `text` ("deg/s", "A s/rad", "N m", "1/K"), None for an unknown one."""
    text = text.strip()
    text = SPELT_OUT.get(text.lower(), text)
    if not text or text == "-":
        return Unit()
    if text in WHOLE:
        return _whole(text)
    text = _with_a_bar(text.translate(SUPERSCRIPTS))
    top, slash, bottom = text.partition("/")
    words = _words(top.strip("() "))
    if slash:
        words = [*(words if words != ["1"] else []), "per", *_words(bottom.strip("() "))]
    return _of_words(words)


def _with_a_bar(text: str) -> str:
    """The unit's text with negative exponents below a bar: "rad*s^-1" is "rad/s"."""
    words = _words(text)
    below = [match[1] + match[2].replace("1", "") for word in words if (match := NEGATIVE.fullmatch(word))]
    if not below or "/" in text:
        return text
    return f"{' '.join(word for word in words if not NEGATIVE.fullmatch(word)) or '1'}/{' '.join(below)}"


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[\s*·⋅._]+", text) if word]


def _whole(text: str) -> Unit:
    top, bottom, factor, offset = WHOLE[text]
    return Unit((top,) if top else (), (bottom,) if bottom else (), factor, offset)


def _of_words(words: list[str]) -> Unit | None:
    """A unit of words with at most one "per" among them; None when one is unknown."""
    if len(words) == 1 and words[0] in WHOLE:
        return _whole(words[0])
    sides: tuple[list[str], list[str]] = ([], [])
    factor = 1.0
    below = 0
    for word in words:
        if word == "per":
            if below:
                return None
            below = 1
            continue
        match = re.fullmatch(r"(\D+?)\^?([2-4]?)", word.translate(SUPERSCRIPTS))
        if match is None or match[1] not in ATOMS:
            return None
        name, size = ATOMS[match[1]]
        exponent = int(match[2] or 1)
        factor *= size ** (-exponent if below else exponent)
        if name == "m3":  # litres
            name, exponent = "m", 3 * exponent
        sides[below].append(name + (str(exponent) if exponent > 1 else ""))
    if not below and len(sides[0]) == 2 and sides[0][0] in ("rad", "m") and sides[0][1] in ("s", "s2"):
        sides = (sides[0][:1], sides[0][1:])  # speed_rad_s, accel_m_s2: products of these are never measured
        factor = _ratio(words)
    if not sides[0] and not sides[1] or (below and not sides[1]):
        return None
    top = sides[0]
    for place in range(len(top) - 1):
        if top[place : place + 2] == ["N", "m"]:
            top[place : place + 2] = ["Nm"]
            break
    return Unit(tuple(top), tuple(sides[1]), factor)


def _ratio(words: list[str]) -> float:
    """The factor of two words of which the second divides."""
    top, bottom = _of_words(words[:1]), _of_words(words[1:])
    return top.factor / bottom.factor if top is not None and bottom is not None else 1.0


def split(column: str) -> tuple[str, Unit | None]:
    """(name without unit, unit) of a column's name; the unit is None when the name has no known one."""
    column = column.strip()
    if re.search(r"\w\[\d+\]$", column):  # xyz[1] is the second of several, "ratio [1]" a pure number
        return _plain(column), None
    bracketed = re.fullmatch(r"(.*?\S)\s*_?[\[(]([^\])]*)[\])]", column)
    if bracketed is not None:
        unit = unit_of(bracketed[2])
        return (_plain(bracketed[1]), unit) if unit is not None else (_plain(column), None)
    tokens = _plain(column).split("_")
    for length in range(min(LONGEST_SUFFIX, len(tokens) - 1), 0, -1):
        words = tokens[-length:]
        if words == ["1"] or words[0] in WORDS_OF_NAMES:  # current_1 is the first of two, not a pure number
            continue
        stem = "_".join(tokens[:-length])
        if len(words) == 1 and words[0] in AMBIGUOUS_ALONE and stem.lower() not in TIME_WORDS:
            continue
        unit = _of_words(words)
        unknown = words[0] == "per" and "_" in stem and unit is not None and not unit.is_si
        if unknown or stem.endswith("_per"):
            return _plain(column), None  # perhaps a part of a unit only: Q_BTU_per_h
        if unit is not None and stem:
            return stem, unit
    return _plain(column), None


def _plain(name: str) -> str:
    """A name without spaces."""
    return re.sub(r"\s+", "_", name.strip())


def si_name(stem: str, unit: Unit) -> str:
    """The name of a channel in SI: "current_A"."""
    return f"{stem}_{unit.suffix}" if unit.suffix else stem
