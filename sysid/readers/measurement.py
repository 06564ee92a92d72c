"""ASAM MDF files (.mf4, .mdf, .dat): files of `walk` and `daq`, and of measurement tools in the CAN world."""

import contextlib
import gc
import logging
import pathlib
import sys
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError, UserError
from ranger_sim.sysid.dataset import Array, Dataset, Finding, Loss
from ranger_sim.sysid.readers import columns

VALUES_TO_TEXT, RANGES_TO_TEXT = 7, 8  # kinds of conversions that have a text for some raw numbers (MDF 4)
TRUTH = "plant."  # of a simulated walk: the body's true state, which no instrument measures


def read(path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, truth: bool = False) -> Dataset:
    """The numeric channels of a file at the stamps of their groups. truth: include the simulated body's own state.

    UserError for a file that asammdf cannot read, or without a channel.
    """
    path = pathlib.Path(path)
    if not path.is_file():
        raise DataError(f"{path}: there is no such file")
    dataset = Dataset(path.name, {})
    mapping = dict(mapping or {})
    said = ""
    with _silence():
        import asammdf  # only here: a second

        try:
            found = list(_channels(asammdf.MDF(path), truth))
        except UserError:
            raise
        except Exception as error:  # a broken file raises many kinds of exceptions in asammdf
            said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        if said:
            gc.collect()  # a half-made file of the library complains when it is deleted: suppressed here
    if said:
        raise DataError(f"{path}: not a measurement file that asammdf can read ({said})")
    columns.check_mapping(dataset, mapping, [name for name, *_ in found])
    skipped = [name for name, _, _, value, _ in found if value is None]
    if skipped:
        text = f"{len(skipped)} channels hold no plain numbers and are left out: {', '.join(skipped[:5])}"
        dataset.findings.append(Finding("", "no_numbers", 0.0, 0.0, float(len(skipped)), "channels", text, "note"))
    offset_s = None
    for name, unit, time_s, value, has_text in found:
        if value is None or not len(value):
            continue
        if offset_s is None:
            offset_s = time_s[0] - columns.from_zero(dataset, time_s)[0]
        named = columns.label(dataset.name, name, unit, mapping)
        stamps = time_s - offset_s
        lost: tuple[Loss, ...] = ()
        if has_text.any():
            lost = (Loss("text", int(has_text.sum()), f"at {stamps[has_text][0]:.6g} s"),)
            text = f"{lost[0].count} of {len(value)} values have a text instead of a number and are left out"
            ends = columns.ends(stamps[has_text])
            dataset.findings.append(Finding(named.name, "text", *ends, float(lost[0].count), "samples", text))
        columns.add(dataset, name, named, stamps[~has_text], value[~has_text], losses=lost)
    if not dataset.channels:
        raise DataError(f"{path}: there is no channel with numbers in it")
    return dataset


def _channels(measurement: Any, truth: bool) -> Iterator[tuple[str, str, Array, Array | None, NDArray[np.bool_]]]:
    """(name, unit, stamps, values, mask of texts instead of values) of every channel that is not a group's clock.

    The values are None when they are not numbers at all.
    """
    seen: set[str] = set()
    with measurement as file:
        for number, group in enumerate(file.groups):
            master = file.masters_db.get(number)
            for index, channel in enumerate(group.channels):
                if index == master or (channel.name.startswith(TRUTH) and not truth):
                    continue
                signal: Any = file.get(group=number, index=index)
                value = signal.samples
                name = channel.name
                while name in seen:
                    name += f".{number}"
                seen.add(name)
                numbers: Array | None = None
                has_text = np.zeros(len(value), dtype=bool)
                kind = getattr(channel.conversion, "conversion_type", None)
                if file.version >= "4" and kind in (VALUES_TO_TEXT, RANGES_TO_TEXT):
                    raw = file.get(group=number, index=index, raw=True).samples
                    numbers, has_text = _with_texts(channel.conversion, raw)
                elif value.ndim == 1 and value.dtype.kind in "fiub":
                    numbers = value.astype(float)
                yield name, signal.unit or "", np.asarray(signal.timestamps, dtype=float), numbers, has_text


def _with_texts(conversion: Any, raw: NDArray[Any]) -> tuple[Array | None, NDArray[np.bool_]]:
    """(numbers or None, mask of those with a text instead) of raw values (n,) of which some have a text.

    Where every occurring value has one, they are states, and their raw numbers are the values.
    """
    has_text = np.zeros(len(raw), dtype=bool)
    if raw.ndim != 1 or raw.dtype.kind not in "fiub":
        return None, has_text
    meanings = conversion.referenced_blocks
    value = _converted(meanings.get("default_addr"), raw)
    rest = np.ones(len(raw), dtype=bool)
    for place in range(conversion.ref_param_nr - 1):
        if conversion.conversion_type == VALUES_TO_TEXT:
            here = raw == conversion[f"val_{place}"]
        else:
            here = (raw >= conversion[f"lower_{place}"]) & (raw <= conversion[f"upper_{place}"])
        meaning = meanings.get(f"text_{place}")
        value[here] = _converted(meaning, raw)[here]
        has_text |= here & (not hasattr(meaning, "convert"))
        rest &= ~here
    if isinstance(meanings.get("default_addr"), bytes) and meanings["default_addr"]:
        has_text |= rest
    if has_text.all():
        return raw.astype(float), np.zeros(len(raw), dtype=bool)
    return value, has_text


def _converted(meaning: Any, raw: NDArray[Any]) -> Array:
    """Raw values by a conversion; unchanged by a conversion of another kind."""
    return np.asarray(meaning.convert(raw) if hasattr(meaning, "convert") else raw, dtype=float).copy()


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Suppress the library's log, its complaints at deletion, and its dependencies' announcements."""
    logger = logging.getLogger("asammdf")
    level, hook = logger.level, sys.unraisablehook
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logger.setLevel(logging.CRITICAL + 1)
        sys.unraisablehook = lambda failure: hook(failure) if failure.exc_type is KeyboardInterrupt else None
        try:
            yield
        finally:
            logger.setLevel(level)
            sys.unraisablehook = hook
