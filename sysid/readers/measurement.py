"""ASAM MDF files (.mf4, .mdf, .dat): what `walk` and `daq` write, and what measurement tools of the CAN world write."""

import contextlib
import gc
import logging
import pathlib
import sys
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Array, Dataset, Finding
from ranger_sim.sysid.readers import columns

TRUTH = "plant."  # of a simulated walk: the body's true state, which no instrument sees


def read(path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, truth: bool = False) -> Dataset:
    """The numeric channels of a file at the stamps of their groups. truth: the simulated body's own state as well.

    UserError for what asammdf cannot read, or without a channel.
    """
    path = pathlib.Path(path)
    if not path.is_file():
        raise UserError(f"{path}: there is no such file")
    dataset = Dataset(path.name, {})
    mapping = dict(mapping or {})
    said = ""
    with _silence():
        import asammdf  # only here: a second

        try:
            found = list(_channels(asammdf.MDF(path), truth))
        except UserError:
            raise
        except Exception as error:  # what a broken file makes of asammdf is of many kinds
            said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        if said:
            gc.collect()  # a half-made file of the library complains when it is deleted: here, unheard
    if said:
        raise UserError(f"{path}: not a measurement file that asammdf can read ({said})")
    columns.check_mapping(dataset, mapping, [name for name, *_ in found])
    skipped = [name for name, _, _, value in found if value is None]
    if skipped:
        text = f"{len(skipped)} channels hold no plain numbers and are left out: {', '.join(skipped[:5])}"
        dataset.findings.append(Finding("", "no_numbers", 0.0, 0.0, float(len(skipped)), "channels", text, "note"))
    offset_s = None
    for name, unit, time_s, value in found:
        if value is None or not len(value):
            continue
        if offset_s is None:
            offset_s = time_s[0] - columns.from_zero(dataset, time_s)[0]
        columns.add(dataset, name, columns.label(dataset.name, name, unit, mapping), time_s - offset_s, value)
    if not dataset.channels:
        raise UserError(f"{path}: there is no channel with numbers in it")
    return dataset


def _channels(measurement: Any, truth: bool) -> Iterator[tuple[str, str, Array, Array | None]]:
    """(name, unit, stamps, values or None when they are no numbers) of every channel that is no group's clock."""
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
                plain = value.ndim == 1 and value.dtype.kind in "fiub"
                yield (
                    name,
                    signal.unit or "",
                    np.asarray(signal.timestamps, dtype=float),
                    value.astype(float) if plain else None,
                )


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """The library's log, its complaints at deletion, and what its dependencies announce are not the user's."""
    logger = logging.getLogger("asammdf")
    level, hook = logger.level, sys.unraisablehook
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logger.setLevel(logging.CRITICAL + 1)
        sys.unraisablehook = lambda _: None
        try:
            yield
        finally:
            logger.setLevel(level)
            sys.unraisablehook = hook
