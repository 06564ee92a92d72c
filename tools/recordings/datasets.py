"""The options of commands that read recordings; `sysid.reading` reads them."""

from __future__ import annotations

from typing import Any

from ranger_sim.sysid import losses
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.readers import columns, layout
from ranger_sim.sysid.readers.csv_file import Progress, no_progress
from ranger_sim.sysid.reading import open_recording
from ranger_sim.tools.command_line.units import RATES_HZ, SHARES, quantity

__all__ = ["add_accept_loss", "add_options", "again", "how_of", "open_recording", "open_with"]


def add_options(command: Any) -> None:
    """The options that say how recordings are read."""
    command.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="OLD=NEW",
        help="call a column of the data by a channel's name; its unit counts where the column says none (repeatable)",
    )
    command.add_argument(
        "--dbc", action="append", default=[], metavar="FILE", help="messages of a recording of CAN frames (repeatable)"
    )
    command.add_argument(
        "--bus", action="append", default=[], metavar="NAME", help="read the frames of this bus only (repeatable)"
    )
    command.add_argument("--time-unit", metavar="ms", help="of a time column whose name does not say it")
    command.add_argument(
        "--rate",
        type=quantity(RATES_HZ, "Hz", above=0.0),
        metavar="100Hz",
        help="of the samples, or the time between two (10ms): the stamps are made from the number of the row, for a "
        "file without a time",
    )
    command.add_argument(
        "--assume",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="how a text table is written, where it can be read in two ways, and what is known of its channels: "
        f"{', '.join(layout.KEYS)} (repeatable)",
    )
    command.add_argument(
        "--recipe", metavar="FILE", help="read as an import recipe says (ranger-sim read --write-recipe)"
    )


def add_accept_loss(command: Any) -> None:
    """The option that lets a verdict follow from a recording of which much is lost."""
    command.add_argument(
        "--accept-loss",
        type=quantity(SHARES, "1", least=0.0, most=1.0),
        default=losses.ACCEPTED,
        metavar="SHARE",
        help="conclude from a channel that lost up to this share of its samples (1%%)",
    )


def open_with(options: Any, path: str, progress: Progress = no_progress) -> Dataset:
    """The recording `path` as `add_options` says."""
    return open_recording(path, progress=progress, **how_of(options))


def how_of(options: Any) -> dict[str, Any]:
    """The options of `add_options` as those of `open_recording`."""
    return {
        "mapping": columns.mapping_of(options.map),
        "databases": options.dbc,
        "time_unit": options.time_unit,
        "rate_hz": options.rate,
        "buses": options.bus,
        "assume": layout.assumptions(options.assume),
        "recipe": options.recipe,
    }


def again(options: Any) -> list[str]:
    """The options of `add_options` as words of a command line."""
    several = {"--map": options.map, "--dbc": options.dbc, "--bus": options.bus, "--assume": options.assume}
    words = [word for name, values in several.items() for value in values for word in (name, value)]
    rate = None if options.rate is None else f"{options.rate!r}Hz"
    single = {"--time-unit": options.time_unit, "--rate": rate, "--recipe": options.recipe}
    return words + [word for name, value in single.items() if value is not None for word in (name, value)]
