"""Measured data of any kind, read in one place: every sample accounted for, what is odd found, repairs proposed.

    measurement = read("run1.csv")
    measurement["current_A"].value            # in SI, at measurement["current_A"].time_s
    measurement.findings, measurement.proposals, measurement.ledger()

`ranger-sim read` prints it; `diagnose`, `identify`, `panel` and `compare-walk` read by `open_recording`.
"""

import dataclasses
import pathlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np

from ranger_sim.foundation.user_error import DataError, unknown
from ranger_sim.sysid import repairs, sanity
from ranger_sim.sysid.dataset import Channel, Dataset, Finding, Loss, Repair
from ranger_sim.sysid.readers import formats, frames, layout
from ranger_sim.sysid.readers.csv_file import Progress, no_progress
from ranger_sim.sysid.recipe import Recipe

EXIT_READ, EXIT_FINDINGS = 0, 1
Path = str | pathlib.Path


@dataclasses.dataclass(frozen=True)
class Measurement:
    """A recording as it was read.

    findings: of the file and of its channels; proposals: repairs that `mended` makes. Those with an option are made
    elsewhere only when it is given; the others by `diagnose` and `identify` as well, but for inputs of the machine.
    """

    dataset: Dataset
    findings: list[Finding]
    proposals: list[Repair]

    def __getitem__(self, name: str) -> Channel:
        return self.dataset[name]

    @property
    def channels(self) -> dict[str, Channel]:
        """The channels by name, in SI, as they are in the file."""
        return self.dataset.channels

    @property
    def matters(self) -> list[Finding]:
        """The findings that may change a conclusion."""
        return [each for each in self.findings if each.severity != sanity.NOTE]

    @property
    def exit_code(self) -> int:
        """Of `ranger-sim read`: 1 with findings that matter."""
        return EXIT_FINDINGS if self.matters else EXIT_READ

    def ledger(self) -> dict[str, Any]:
        """What became of every line and sample, and where the stamps are from.

        {"lines": {kind: number}, "stamps": text, "" where the file has them, "channels": {channel: account}}.
        """
        made = next((each.text for each in self.dataset.findings if each.kind == "time_of_rate"), "")
        return {"lines": dict(self.dataset.lines), "stamps": made, "channels": self.dataset.ledger()}

    def mended(self) -> Dataset:
        """The dataset with all proposals carried out."""
        if any(each.kind == "even_clock" for each in self.proposals):
            return repairs.mend(repairs.evenly_stamped(self.dataset))
        return repairs.mend(self.dataset, self.findings)

    def to_dict(self) -> dict[str, Any]:
        """For programs: JSON's types only."""
        return {
            "file": self.dataset.name,
            "layout": self.dataset.layout,
            "channels": {name: _described(channel) for name, channel in self.channels.items()},
            "ledger": self.ledger(),
            "changes": [dataclasses.asdict(each) for each in self.dataset.repairs],
            "findings": [sanity.as_json(each) for each in self.findings],
            "proposals": [
                {**dataclasses.asdict(each), "share": self.share_of(each)} for each in self.proposals
            ],
        }  # fmt: skip

    def share_of(self, proposal: Repair) -> float:
        """The part of its channel's samples that a proposal changes: 0 to 1."""
        count = len(self.channels[proposal.channel].value) if proposal.channel in self.channels else self.dataset.rows
        return min(1.0, proposal.count / count) if count else 0.0


def _described(channel: Channel) -> dict[str, Any]:
    finite = channel.time_s[np.isfinite(channel.time_s)]
    values = channel.value[np.isfinite(channel.value)]
    steps = np.diff(finite)
    return {
        "unit": channel.unit,
        "source": channel.source,
        "samples": len(channel.value),
        "start_s": float(finite[0]) if len(finite) else None,
        "end_s": float(finite[-1]) if len(finite) else None,
        "step_s": float(np.median(steps)) if len(steps) else None,
        "least": float(values.min()) if len(values) else None,
        "most": float(values.max()) if len(values) else None,
        "resolution": channel.resolution,
    }


@overload
def read(files: Path, **how: Any) -> Measurement: ...


@overload
def read(files: Sequence[Path], **how: Any) -> list[Measurement]: ...


def read(files: Path | Sequence[Path], **how: Any) -> Measurement | list[Measurement]:
    """One file or folder as a Measurement, a sequence of them as a list. how: as of `open_recording`.

    UserError for a file that cannot be read, or can be read in two ways: the lines of the error are then commands.
    """
    if isinstance(files, str | pathlib.Path):
        return inspected(open_recording(files, **how))
    return [inspected(open_recording(each, **how)) for each in files]


def inspected(dataset: Dataset) -> Measurement:
    """A dataset with what is odd about it and the repairs that are possible."""
    findings = [*sanity.inspect(dataset), *sanity.pairs(dataset)]
    proposals: list[Repair] = []
    if not any(each.severity == sanity.FATAL for each in findings):
        even = bool(repairs.even_clocks(dataset)[1])
        ready, found = (repairs.evenly_stamped(dataset), None) if even else (dataset, findings)
        proposals = repairs.mend(ready, found).repairs[len(dataset.repairs) :]
    return Measurement(dataset, findings, proposals)


def open_recording(
    path: Path,
    mapping: Mapping[str, str] | None = None,
    databases: Sequence[Path] = (),
    time_unit: str | None = None,
    rate_hz: float | None = None,
    each_frame: Callable[[frames.Frame], None] | None = None,
    buses: Collection[str] = (),
    assume: Mapping[str, str] | None = None,
    recipe: Recipe | Path | None = None,
    progress: Progress = no_progress,
) -> Dataset:
    """The channels of a file or folder, in SI.

    mapping: {name in the file: name of the channel}. databases: DBC files, for frames, of these `buses`; an MDF file is
    read as frames when there are some. time_unit: of stamps whose column does not give it. rate_hz: of the samples: the
    stamps are made from the number of the row. assume: parts of a text
    table's layout, and what is known of the channels (readers.layout.KEYS). recipe: of `ranger-sim read
    --write-recipe`, in place of these. each_frame is called with every frame. UserError for all that is wrong.
    """
    path = pathlib.Path(path)
    mapping, assume = dict(mapping or {}), dict(assume or {})
    if recipe is not None:
        recipe = recipe if isinstance(recipe, Recipe) else Recipe.load(recipe)
        mapping = {**recipe.mapping, **mapping}
        assume = {**recipe.assume, **assume}
        time_unit, rate_hz = time_unit or recipe.time_unit, rate_hz or recipe.rate_hz
        databases, buses = databases or recipe.databases, buses or recipe.buses
    of_table = {key: value for key, value in assume.items() if key not in layout.OF_ANY_FORMAT}
    if rate_hz is not None and (time_unit or "time" in assume):
        raise DataError(f"--rate {rate_hz:g}Hz: the stamps are those of a column already (--time-unit, --assume time)")
    dataset = _read(path, mapping, databases, time_unit, rate_hz, each_frame, buses, of_table, progress)
    dataset.clock_is_given |= time_unit is not None or rate_hz is not None
    if recipe is not None:
        recipe.check(dataset)
    dataset = _assumed(dataset, assume)
    dataset.findings += sanity.of_recording(dataset)
    if mapping:
        dataset.layout["map"] = mapping
    return dataset


def _assumed(dataset: Dataset, assume: Mapping[str, str]) -> Dataset:
    """The dataset with what is assumed of its channels, whatever its format. UserError for an unknown channel."""
    names = [each.strip() for each in assume.get("limits", "").split(",") if each.strip()]
    for name in names:
        if name not in dataset:
            raise DataError(f"--assume limits={name}: {unknown('channel', name, dataset.channels)}")
        dataset.channels[name] = dataclasses.replace(dataset[name], limits_are_true=True)
    if "clock" in assume:
        dataset = repairs.evenly_stamped(dataset)
    dataset.layout |= {key: assume[key] for key in layout.OF_ANY_FORMAT if key in assume}
    return dataset


def _read(
    path: pathlib.Path,
    mapping: Mapping[str, str],
    databases: Sequence[Path],
    time_unit: str | None,
    rate_hz: float | None,
    each_frame: Callable[[frames.Frame], None] | None,
    buses: Collection[str],
    assume: Mapping[str, str],
    progress: Progress,
) -> Dataset:
    known = formats.of(path)
    if rate_hz is not None and known.has_stamps:
        raise DataError(f"--rate {rate_hz:g}Hz: {path} has stamps, as every file of its format does ({known.name})")
    if known.holds_frames or (databases and known.may_hold_frames):
        if not databases:
            raise DataError(f"{path}: a recording of CAN frames needs a DBC file (--dbc FILE)")
        dataset = _decoded(path, mapping, databases, each_frame, buses)
        dataset.layout |= {"dbc": [str(each) for each in databases], "bus": sorted(buses)}
    else:
        if buses:
            raise DataError(f"--bus {' '.join(buses)}: {path} is not a recording of CAN frames, or --dbc is missing")
        if assume and known.name != formats.TEXT_TABLE:
            raise DataError(f"--assume {next(iter(assume))}=...: {path} is not a text table, but {known.name}")
        dataset = formats.read(path, known, mapping, time_unit, rate_hz, assume, _robot_units(), progress)
    dataset.layout = {"format": known.name, **dataset.layout}
    return dataset


def _decoded(
    path: pathlib.Path,
    mapping: Mapping[str, str],
    databases: Sequence[Path],
    each_frame: Callable[[frames.Frame], None] | None,
    buses: Collection[str],
) -> Dataset:
    """The channels of recorded frames, with what became of the file's lines."""
    from ranger_sim.can_bus.edge.logs import read_log  # python-can: a fifth of a second

    log = read_log(path, fd=True)

    def passing() -> Iterator[frames.Frame]:
        for frame in log:
            if each_frame is not None:
                each_frame(frame)
            yield frame

    dataset = frames.decode(path.name, passing(), databases, mapping, buses)
    dataset.rows = log.read
    for reason, count, where in log.losses:
        loss = Loss(reason, count, where)
        dataset.losses.append(loss)
        text = f"{log.read} frames should be there, {loss.text}"
        dataset.findings.append(Finding("", "lost_frames", 0.0, 0.0, float(count), "frames", text))
    of_log = log.ledger()
    errors = of_log.pop("frames") - sum(dataset.lines.values())
    dataset.lines |= ({"error frames": errors} if errors else {}) | of_log
    return dataset


def _robot_units() -> dict[str, str]:
    """{variable: unit} of the robot's own table, which its text logs do not carry."""
    from ranger_sim.datatable.generated import all_variables

    return {name: all_variables.UNITS[number] for number, name in all_variables.NAMES.items()}
