"""The robot's text logs: `NAME<tab>id<tab>` per variable, then `id<tab>value<tab>robot time in ms` per sample.

`ranger-sim daq --log FILE.txt` writes them, as the robot's own logging program did (docs/robot.md, C6.1), which pads
its numbers with spaces. The log has no units: the caller passes those it knows. Logs of 2015 have no names; the meaning
of an id depends on the robot's program of that day, so their channels are called id_14, and a mapping names them.
"""

import pathlib
from collections.abc import Mapping

import numpy as np

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset, Finding, Loss, Repair
from ranger_sim.sysid.readers import columns

SNIFFED_LINES = 40
LOG_PART = 0.7  # part of these that must read as a log's: a few may be torn, as where a radio link broke off


def is_one(path: pathlib.Path) -> bool:
    """True when most of the first lines look like such a log's."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            lines = [line for _, line in zip(range(SNIFFED_LINES), file, strict=False) if line.strip()]
    except OSError:
        return False
    return sum(bool(_kind(_parts(line))) for line in lines) > LOG_PART * len(lines)


def _parts(line: str) -> list[str]:
    """The texts between the tabs, without the spaces that pad them."""
    return [part.strip() for part in line.split("\t")]


def _kind(parts: list[str]) -> str:
    """ "name", "sample", or nothing."""
    if len(parts) in (2, 3) and parts[1].isdigit() and not any(parts[2:]) and not _is_number(parts[0]):
        return "name"
    if len(parts) in (3, 4) and parts[0].isdigit() and not any(parts[3:]) and all(map(_is_number, parts[1:3])):
        return "sample"
    return ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read(
    path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> Dataset:
    """The channels of a log, each at its own stamps. units: {variable: unit}. UserError for a file that is not a
    log."""
    path = pathlib.Path(path)
    dataset = Dataset(path.name, {})
    mapping, units = dict(mapping or {}), units or {}
    names: dict[str, str] = {}
    samples: dict[str, list[tuple[float, float]]] = {}
    odd: list[int] = []
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                parts = _parts(line)
                kind = _kind(parts)
                dataset.rows += bool(line.strip())
                if kind == "sample":
                    samples.setdefault(parts[0], []).append((float(parts[2]), float(parts[1])))
                elif kind == "name":
                    names[parts[1]] = parts[0]
                elif line.strip():
                    odd.append(number)
    except OSError as error:
        raise DataError(f"{path}: the log cannot be read ({error.strerror or error})") from None
    if not samples:
        raise DataError(f"{path}: this is not a log of the robot: no line reads id, value and time in ms between tabs")
    if odd:
        text = f"{len(odd)} lines are not id, value, time, and are left out (the first: line {odd[0]})"
        dataset.findings.append(Finding("", "ragged", 0.0, 0.0, float(len(odd)), "rows", text))
        dataset.repairs.append(Repair("", "ragged", len(odd), text))
        dataset.losses.append(Loss("ragged", len(odd), f"in line {odd[0]}"))
    dataset.lines = {"rows": dataset.rows - len(odd), "left out: ragged": len(odd)}
    if not names:
        text = "the log has no names; what an id means depends on the robot's program of its day"
        dataset.findings.append(Finding("", "no_header", 0.0, 0.0, float(len(samples)), "columns", text))
    called = {key: names.get(key, f"id_{key}") for key in samples}
    columns.check_mapping(dataset, mapping, list(called.values()))
    for key, pairs in samples.items():
        pair = np.array(pairs)
        written = pair[:, 0] != 0.0
        again = np.zeros(len(pair), dtype=bool)
        again[1:] = written[1:] & (pair[1:] == pair[:-1]).all(axis=1)  # idle channels repeat value and stamp
        kept = written & ~again
        named = columns.label(dataset.name, called[key], units.get(called[key]), mapping)
        if not kept.any():
            continue  # a variable that was never written
        counts = {"never_written": int((~written).sum()), "repeated": int(again.sum())}
        lost = tuple(Loss(reason, count) for reason, count in counts.items() if count)
        columns.add(dataset, called[key], named, pair[kept, 0] * 1e-3, pair[kept, 1], losses=lost)
    if not dataset.channels:
        raise DataError(f"{path}: no variable of this log was ever written")
    return dataset
