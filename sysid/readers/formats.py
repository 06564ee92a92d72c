"""The formats that are known: each by what its files begin with, or by its ending where they begin with nothing."""

import dataclasses
import pathlib
from collections.abc import Mapping

from ranger_sim.can_bus.edge import log_kinds
from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.readers import binary, csv_file, layout, lvm, measurement, robodaq, run_folder
from ranger_sim.sysid.readers.csv_file import Progress, no_progress

TEXT_TABLE = "text table"
SNIFFED_BYTES = 4096


@dataclasses.dataclass(frozen=True)
class Format:
    """A format of files. holds_frames: CAN frames, which need a DBC file; may_hold_frames: when there is one."""

    name: str
    holds_frames: bool = False
    may_hold_frames: bool = False

    @property
    def has_stamps(self) -> bool:
        """True when every file of this format has stamps."""
        return self.name not in (TEXT_TABLE, *binary.OF_ARRAYS)


FOLDER = Format("folder of a run")
MDF = Format("MDF", may_hold_frames=True)
ROBODAQ = Format("RoboDAQ log")
LVM = Format("LabVIEW's .lvm")
TABLE = Format(TEXT_TABLE)
BEGINNINGS = {
    b"MDF     ": MDF,
    b"UnFinMF ": MDF,
    b"MATLAB 5.0": Format("MATLAB"),
    b"MATLAB 7.3": Format("MATLAB"),
    b"PAR1": Format("Parquet"),
    b"ULog\x01\x12\x35": Format("ULog"),
    b"\x89MCAP0\r\n": Format("MCAP"),
    b"\x89HDF": Format("HDF5"),
    b"TDSm": Format("TDMS"),
    lvm.BEGINNING: LVM,
}
REFUSED = {
    b"\xd0\xcf\x11\xe0": "a workbook of an old Excel: export the sheet as CSV",
    b"%PDF": "a PDF",
    b"\x7fELF": "a program",
    b"\x89PNG": "a picture",
    b"\x93NUMPY": "an array of NumPy without names: numpy.savetxt(FILE, array, header=...) writes a table",
    b'{"': "a JSON file: write its channels as CSV",
    b'[{"': "a JSON file: write its channels as CSV",
}
MDF_ENDINGS = (".mf4", ".mdf", ".dat")
TEXT_ENDINGS = (".dat", ".log", ".asc", ".trc")  # of other programs as well, for tables


def of(path: pathlib.Path) -> Format:
    """The format of a file or folder. UserError for what is not there or is of a kind that is not read."""
    if path.is_dir():
        return FOLDER
    try:
        with path.open("rb") as file:
            first = file.read(SNIFFED_BYTES)
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file") from None
    except OSError as error:
        raise DataError(f"{path}: it cannot be read ({error.strerror or error})") from None
    for magic, known in BEGINNINGS.items():
        if first.startswith(magic):
            return known
    for magic, what in REFUSED.items():
        if first.startswith(magic):
            raise DataError(f"{path}: this is {what}")
    if kind := log_kinds.kind_of(first):
        return Format(kind, holds_frames=True)
    suffix = path.suffix.lower()
    if suffix not in TEXT_ENDINGS or not _is_table(first.decode("utf-8", errors="replace")):
        if suffix in log_kinds.ENDINGS:
            return Format(log_kinds.ENDINGS[suffix], holds_frames=True)
        if suffix in MDF_ENDINGS and (suffix not in TEXT_ENDINGS or b"\0" in first):
            return MDF
        if suffix == ".mat":  # of version 4, which begins with numbers
            return Format("MATLAB")
    return ROBODAQ if robodaq.is_one(path) else TABLE


def _is_table(text: str) -> bool:
    """True when the text has a row of names with a time, or rows of numbers."""
    if "\0" in text or "\ufffd" in text:
        return False
    lines = [line for line in text.splitlines()[:-1] if not layout.is_blank(line)]
    cells = [layout.cells_of(line, sign) for sign in layout.SEPARATORS.values() for line in lines]
    rows = sum(len(each) > 1 and all(map(layout.is_value, each)) for each in cells)
    return bool(lines) and rows > len(lines) // 2


def read(
    path: pathlib.Path,
    known: Format,
    mapping: Mapping[str, str] | None = None,
    time_unit: str | None = None,
    rate_hz: float | None = None,
    assumed: Mapping[str, str] | None = None,
    variable_units: Mapping[str, str] | None = None,
    progress: Progress = no_progress,
) -> Dataset:
    """The channels of a file without frames. rate_hz: of one that may have no stamps; variable_units: of a robot's
    log."""
    if known is FOLDER:
        return run_folder.read(path, mapping)
    if known is MDF:
        return measurement.read(path, mapping)
    if known.name in binary.KINDS:
        return binary.read(path, known.name, mapping, time_unit, rate_hz)
    if known is LVM:
        return lvm.read(path, mapping)
    if known is ROBODAQ:
        return robodaq.read(path, mapping, variable_units)
    return csv_file.read(path, mapping, time_unit, rate_hz, assumed, progress)
