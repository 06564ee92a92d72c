"""Stamps that are numbers, in whatever unit a file has them, as seconds."""

import pathlib
import shlex
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Dataset, Finding, Repair
from ranger_sim.sysid.readers import columns

DAYS = (  # of the years 1954 to 2119: of spreadsheets since 1900, of MATLAB since the year 0, of astronomers
    (20_000.0, 80_000.0),
    (713_960.0, 773_960.0),
    (2_435_018.0, 2_495_018.0),
)
DAY_S = 86_400.0
EARLIEST_DAY, LATER_THAN_LONG = 0.01, 10.0  # parts of a day begin long after midnight; an oscilloscope's stamps about 0
FASTEST_S = 2e-5  # a smaller step is not a machine's, but may be a spreadsheet's part of a day
SLOWEST_S = 0.5  # as sanity.LONGEST_STEP_S: beyond it the unit is probably a smaller one
SHORTEST_S = 2e-5  # faster recordings have the unit of their stamps
LONGEST_S, FEWEST = 60.0, 30  # readings that a person takes one by one are fewer, and not farther apart
CENTURIES = (18_000_101, 22_001_231)  # dates as numbers, 20261105, within which
STEP, RATE = ("time", "s"), ("rate", "Hz")
SAMPLING = {  # usual names of a sample time or rate, without _
    **dict.fromkeys(("ts", "dt", "deltat", "sampletime", "samplingtime", "samplingperiod", "sampleperiod"), STEP),
    **dict.fromkeys(("fs", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency"), RATE),
}
EPOCHS = {"seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
EPOCH_YEARS_S = (631_152_000.0, 4_102_444_800.0)  # 1990 to 2100
EPOCH_STEP_S = 2.0  # a controller's count of us since its start is a date after ten minutes, with steps of many s


def or_with_rate(path: str | pathlib.Path, single: Mapping[str, float]) -> str:
    """The end of an error about a file without a time: the command that reads it.

    single: numbers that the file has once, by name; one of them may be the sample time or the rate.
    """
    read = f"ranger-sim read {shlex.quote(str(path))}"
    for name, value in single.items():
        what = SAMPLING.get(name.lower().replace("_", ""))
        if what is not None and 0.0 < value < np.inf:
            return f"; or {name}, {value:g}, is the sample {what[0]}: {read} --rate {value:g}{what[1]}"
    return f"; or its samples come at a known rate, as 100 a second: {read} --rate 100Hz"


def of_rate(dataset: Dataset, rate_hz: float, unused: Sequence[str] = ()) -> None:
    """Record in a dataset that its stamps are made from a rate. unused: columns that may be times."""
    text = f"the stamps are made from the number of the row, {1.0 / rate_hz:.6g} s apart (--rate {rate_hz:.10g}Hz)"
    if unused:
        text += f"; {', '.join(unused)} is a channel and not the time"
    dataset.findings.append(Finding("", "time_of_rate", 0.0, 0.0, 1.0 / rate_hz, "s", text, "note"))
    dataset.layout |= {"time": "row number", "rate_hz": rate_hz}


def seconds(
    dataset: Dataset,
    path: str,
    name: str,
    stamps: Array,
    whole: NDArray[np.int64] | None = None,
    unit: units.Unit | None = None,
) -> tuple[Array, int]:
    """Stamps (n,) in s, and the time in ns from which those of a calendar count, the first one; else 0.

    path: of the file, for commands. whole: the stamps where all are whole numbers: floats would round those of a
    calendar. unit: None where nothing gives it. UserError for a unit of something else, and for stamps whose unit
    does not follow from their size.
    """
    if unit is None and (dates := _compact_dates(dataset, name, stamps)) is not None:
        return dates
    if unit is not None and unit.factor > 1.0:
        dataset.clock_is_given = True  # minutes and hours are not written by mistake
    unit = unit or _assumed(dataset, path, name, stamps)
    if unit.numerator != ("s",) or unit.denominator:
        raise DataError(f"{dataset.name}: the time column {name} is in {unit.text or 'no unit'}, not in a time")
    if unit.factor != 1.0:
        dataset.repairs.append(Repair("", "si_unit", len(stamps), f"{name}: times {unit.factor:g}, now in s"))
    time_s = stamps * unit.factor
    from_zero = columns.from_zero(dataset, time_s)
    if from_zero is time_s:
        return time_s, 0
    if whole is not None and len(whole):
        return (whole - whole[0]) * unit.factor, int(whole[0]) * round(unit.factor * 1e9)
    return from_zero, round(columns.ends(time_s)[0] * 1e9)


def _compact_dates(dataset: Dataset, name: str, stamps: Array) -> tuple[Array, int] | None:
    """As `seconds`, of dates that are written as numbers, 20261105; None for other numbers.

    They are dates where every number is a day of the calendar and more than one month is met: a counter is not.
    """
    good = stamps[np.isfinite(stamps)]
    if len(good) < 2 or good.min() < CENTURIES[0] or good.max() > CENTURIES[1] or (good != np.floor(good)).any():
        return None
    number = good.astype(np.int64)
    month, day = number // 100 % 100, number % 100
    if len(np.unique(number // 100)) < 2 or month.min() < 1 or month.max() > 12 or day.min() < 1:
        return None
    months = (number // 10_000 - 1970).astype("M8[Y]").astype("M8[M]") + (month - 1)
    days = months.astype("M8[D]") + (day - 1)
    if (days.astype("M8[M]") != months).any():
        return None
    time_s = np.full(len(stamps), np.nan)
    time_s[np.isfinite(stamps)] = (days - days[0]).astype(np.int64) * DAY_S
    text = f"{name}: dates such as {number[0]} are read as seconds, 0 is {days[0]}"
    dataset.repairs.append(Repair("", "dates", len(good), text))
    dataset.layout |= {"time_unit": "dates"}
    dataset.clock_is_given = True
    return time_s, int(days[0].astype(np.int64)) * 86_400_000_000_000


def _assumed(dataset: Dataset, path: str, name: str, stamps: Array) -> units.Unit:
    """Unit of stamps without a given one: what their size can only be, else seconds."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    usual = float(np.median(np.abs(steps[steps != 0.0]))) if (steps != 0.0).any() else 0.0
    ends = columns.ends(stamps)
    of_a_day = EARLIEST_DAY < ends[0] < 1.0 and 0.0 <= ends[1] - ends[0] < ends[0] / LATER_THAN_LONG
    days = of_a_day or any(all(low < end < high for end in ends) for low, high in DAYS)
    if 0.0 < usual < FASTEST_S and days:
        text = f"{name}: {ends[0]:.10g} is taken for days: samples would be {usual:.3g} s apart otherwise"
        dataset.findings.append(Finding("", "unit_assumed", *ends, 86400.0, "s", text))
        return units.Unit(("s",), (), DAY_S)
    for spelling, factor in EPOCHS.items():
        is_of_calendar = all(EPOCH_YEARS_S[0] < end * factor < EPOCH_YEARS_S[1] for end in ends)
        if is_of_calendar and usual * factor <= EPOCH_STEP_S:
            text = (
                f"{name}: {ends[0]:.15g} is taken for {spelling} since 1970: of the years 1990 to 2100 in no other unit"
            )
            dataset.findings.append(Finding("", "unit_assumed", *ends, factor, "s", text, "note"))
            return units.Unit(("s",), (), factor)
    text = f"{name}: nothing says the unit of the stamps; seconds are assumed"
    if usual > SLOWEST_S:
        steps_s = {unit: usual * units.ATOMS[unit][1] for unit in ("ms", "us", "ns")}

        def slow(unit: str) -> bool:
            return steps_s[unit] > SLOWEST_S

        likely = {unit: step_s for unit, step_s in steps_s.items() if SHORTEST_S <= step_s <= LONGEST_S}
        if likely and (usual > LONGEST_S or len(stamps) >= FEWEST):
            others = ", ".join(f"in {unit} {step_s:g} s" for unit, step_s in likely.items())
            raise DataError(
                f"{path}: {name}: nothing says the unit of the stamps; "
                f"in seconds samples would be {usual:.6g} s apart, {others}:",
                *(
                    f"  ranger-sim read {shlex.quote(str(path))} --time-unit {unit}"
                    for unit in (*sorted(likely, key=slow), "s")
                ),
            )
        text += f", which are {usual:.6g} s apart"
        if likely:
            first = min(likely, key=slow)
            text += f"; --time-unit {first} would make them {steps_s[first]:g} s"
    dataset.findings.append(Finding("", "unit_assumed", *ends, 1.0, "s", text))
    return units.Unit(("s",))
