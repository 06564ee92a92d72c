"""One true recording, written by other people's writers: libraries, and the forms that programs and instruments have.

The recording is that of dialects.py. Each entry writes a file and says how it is read; what no library writes here (R,
MATLAB, oscilloscopes) follows its documentation. `python -m dev.dialects` judges all of them, and so does the suite.
"""

import contextlib
import csv
import dataclasses
import io
import json
import locale
import pathlib
import sys
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import scipy.io

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.reading import read
from tests.sysid.dialects import EPOCH_S, FALSELY, REFUSED, RIGHT, ROWS, STEP_S, UNITS, WRONG, truth

MISSING = "not installed"
Row = tuple[float, float, float, float]
DBC = """VERSION ""
BU_: A
BO_ 291 M: 8 A
 SG_ voltage : 0|16@1- (0.0005,0) [0|0] "V" A
 SG_ current : 16|16@1- (0.0001,0) [0|0] "A" A
 SG_ angle : 32|32@1- (0.00001,0) [0|0] "rad" A
"""


@dataclasses.dataclass(frozen=True)
class Stranger:
    """A file: write(folder) returns its path. how: of `read`; units: True where the file says them.

    off: what its digits lose, in SI; off_s: of its stamps, s; refused: words of a true refusal.
    """

    write: Callable[[pathlib.Path], pathlib.Path]
    how: dict[str, Any] = dataclasses.field(default_factory=dict)
    units: bool = True
    off: float = 2e-5
    off_s: float = 2e-5
    refused: str = ""


def rows() -> Iterator[Row]:
    data = truth()
    return zip(*(map(float, data[name]) for name in ("t", *UNITS)), strict=True)


NAMES = ("t_s", *(f"{name}_{unit}" for name, unit in UNITS.items()))


def text(content: str | Callable[[], str], name: str = "a.csv", encoding: str = "utf-8") -> Callable:
    def write(folder: pathlib.Path) -> pathlib.Path:
        path = folder / name
        path.write_text(content if isinstance(content, str) else content(), encoding=encoding)
        return path

    return write


def lines(form: str, head: str = "", every: Callable[[float], str] = lambda t: f"{t:.6f}") -> Callable[[], str]:
    """head, then a line of each row: {t} as `every` writes it, {v}, {i}, {a}, {k}."""

    def made() -> str:
        return head + "".join(
            form.format(t=every(t), v=v, i=i, a=a, k=k, n=k + 1) + "\n" for k, (t, v, i, a) in enumerate(rows())
        )

    return made


def with_commas(made: Callable[[], str], keep: int) -> Callable[[], str]:
    """Decimal commas in all lines but the first `keep`."""

    def swapped() -> str:
        above, below = made().split("\n")[:keep], made().split("\n")[keep:]
        return "\n".join([*above, *(line.replace(".", ",") for line in below)])

    return swapped


# --- pandas and numpy -------------------------------------------------------------------------------------------


def frame(index: str = "") -> Any:
    import pandas

    data = truth()
    found = pandas.DataFrame({name: data[name.partition("_")[0]] for name in NAMES})
    if index == "dates":
        found = found.drop(columns="t_s")
        found.index = pandas.to_datetime(EPOCH_S * 10**9 + np.round(data["t"] * 1e9).astype(np.int64))
    elif index == "utc":
        found = frame("dates").tz_localize("UTC")
        found.index.name = "time"
    elif index == "timedelta":
        found = found.drop(columns="t_s")
        found.index = pandas.to_timedelta(np.round(data["t"] * 1e9).astype(np.int64))
        found.index.name = "time"
    elif index == "units":
        found.columns = pandas.MultiIndex.from_tuples([("t", "s"), *UNITS.items()])
    return found


def pandas_csv(index: str = "", encoding: str = "utf-8", **how: Any) -> Callable:
    return text(lambda: frame(index).to_csv(**how), encoding=encoding)


def of_pandas() -> Iterator[tuple[str, Stranger]]:
    yield "to_csv", Stranger(pandas_csv())
    yield "to_csv without index", Stranger(pandas_csv(index=""), {})
    yield "to_csv, semicolons and decimal commas", Stranger(pandas_csv(sep=";", decimal=","))
    yield "to_csv, dates as index", Stranger(pandas_csv("dates"))
    yield "to_csv, dates with a zone", Stranger(pandas_csv("utc"))
    yield "to_csv, time differences as index", Stranger(pandas_csv("timedelta"))
    yield "to_csv, tabs, quoted text", Stranger(pandas_csv(sep="\t", quoting=csv.QUOTE_NONNUMERIC))
    yield "to_csv, %g", Stranger(pandas_csv(float_format="%.8g"))
    yield "to_csv, UTF-16", Stranger(pandas_csv(encoding="utf-16"))
    yield "to_csv, two rows of names", Stranger(pandas_csv("units"))
    yield "to_csv, names and units, no index", Stranger(text(lambda: frame("units").to_csv(index=False)))
    yield "to_csv, German dates", Stranger(pandas_csv("dates", date_format="%d.%m.%Y %H:%M:%S.%f", sep=";"))
    yield "to_string", Stranger(text(lambda: frame().to_string(float_format="%.6f")))
    yield "to_string without index", Stranger(text(lambda: frame().to_string(index=False, float_format="%.6f")))

    def written(method: str, ending: str, index: str = "", **how: Any) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                getattr(frame(index), method)(folder / f"a.{ending}", **how)
            return folder / f"a.{ending}"

        return write

    for index in ("", "dates", "utc", "timedelta"):
        yield f"to_parquet, {index or 'numbers'}", Stranger(written("to_parquet", "parquet", index))
    yield "to_hdf, numbers", Stranger(written("to_hdf", "h5", key="run"))
    yield "to_hdf, dates", Stranger(written("to_hdf", "h5", "dates", key="run"))
    yield "to_json", Stranger(text(lambda: frame().to_json()), refused="JSON")
    yield "to_pickle", Stranger(written("to_pickle", "pkl"), refused="not a text table")


def of_numpy() -> Iterator[tuple[str, Stranger]]:
    def saved(**how: Any) -> Callable:
        def made() -> str:
            file = io.StringIO()
            np.savetxt(file, np.array(list(rows())), **how)
            return file.getvalue()

        return text(made, "a.txt")

    names = ",".join(NAMES)
    yield "savetxt", Stranger(saved(), units=False)
    yield "savetxt, names behind a hash", Stranger(saved(delimiter=",", header=names))
    yield "savetxt, names", Stranger(saved(delimiter=",", header=names, comments="", fmt="%.6f"))
    yield "savetxt, tabs, %g", Stranger(saved(delimiter="\t", header=names.replace(",", "\t"), fmt="%.9g"))
    yield "savetxt, spaces, names with spaces", Stranger(saved(header=names.replace(",", " "), fmt="%.8e"))

    def npy(folder: pathlib.Path) -> pathlib.Path:
        np.save(folder / "a.npy", np.array(list(rows())))
        return folder / "a.npy"

    yield "save", Stranger(npy, refused="NumPy")


def of_scipy() -> Iterator[tuple[str, Stranger]]:
    def saved(struct: bool = False, **how: Any) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            data = {name: truth()[name.partition("_")[0]] for name in NAMES}
            scipy.io.savemat(folder / "a.mat", {"run": data} if struct else data, **how)
            return folder / "a.mat"

        return write

    yield "savemat", Stranger(saved())
    yield "savemat, version 4", Stranger(saved(format="4"))
    yield "savemat, compressed structure", Stranger(saved(struct=True, do_compression=True))
    yield "savemat, columns", Stranger(saved(oned_as="column"))


def of_csv_module() -> Iterator[tuple[str, Stranger]]:
    def written(dialect: str, cell: Callable[[float], str] = repr, **how: Any) -> Callable:
        def made() -> str:
            file = io.StringIO()
            writer = csv.writer(file, dialect, **how)
            writer.writerow(NAMES)
            writer.writerows([cell(value) for value in row] for row in rows())
            return file.getvalue()

        return text(made)

    for dialect in ("excel", "excel-tab", "unix"):
        yield f"csv module, {dialect}", Stranger(written(dialect))
    german = {"decimal_point": ",", "thousands_sep": ".", "grouping": [3, 3, 0]}

    def grouped(value: float) -> str:
        assert german["grouping"] == [3, 3, locale.CHAR_MAX] or german["decimal_point"] == ","
        return f"{1000.0 * value:,.4f}".replace(",", "_").replace(".", ",").replace("_", ".")

    head = ("t_ms", "voltage_mV", "current_mA", "angle_mrad")

    def of_locale() -> str:
        file = io.StringIO()
        writer = csv.writer(file, delimiter=";")
        writer.writerow(head)
        writer.writerows([grouped(value) for value in row] for row in rows())
        return file.getvalue()

    yield (
        "csv module, decimal commas quoted between commas",
        Stranger(written("excel", lambda value: f"{value:.7f}".replace(".", ","))),
    )
    yield "csv module, numbers of a German locale", Stranger(text(of_locale))


# --- ASAM MDF ---------------------------------------------------------------------------------------------------


def of_asammdf() -> Iterator[tuple[str, Stranger]]:
    def measurement(version: str) -> Any:
        import asammdf

        data = truth()
        found = asammdf.MDF(version=version)
        found.append([asammdf.Signal(data[name], data["t"], unit=unit, name=name) for name, unit in UNITS.items()])
        return found

    def saved(version: str, ending: str) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            with measurement(version) as file:
                return pathlib.Path(file.save(folder / f"a.{ending}", overwrite=True))

        return write

    def exported(kind: str, ending: str, **how: Any) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with measurement("4.10") as file:
                    file.export(kind, folder / f"a.{ending}", **how)
            return next(folder.glob(f"a*.{ending}"))

        return write

    for version, ending in (("4.10", "mf4"), ("4.20", "mf4"), ("3.30", "mdf")):
        yield f"MDF {version}", Stranger(saved(version, ending))
    yield "export to CSV", Stranger(exported("csv", "csv", single_time_base=True), units=False)
    yield "export to CSV, units", Stranger(exported("csv", "csv", single_time_base=True, add_units=True))
    yield (
        "export to CSV, dates",
        Stranger(exported("csv", "csv", single_time_base=True, time_as_date=True), units=False),
    )
    yield "export to MATLAB 5", Stranger(exported("mat", "mat", format="5"), units=False)
    yield "export to Parquet", Stranger(exported("parquet", "parquet", single_time_base=True), units=False)
    yield "export to HDF5", Stranger(exported("hdf5", "hdf"), units=False)


# --- CAN --------------------------------------------------------------------------------------------------------


def messages() -> Iterator[Any]:
    import can

    for t, v, i, a in rows():
        data = b"".join(
            round(value / step).to_bytes(size, "little", signed=True)
            for value, step, size in ((v, 0.0005, 2), (i, 0.0001, 2), (a, 0.00001, 4))
        )
        yield can.Message(
            timestamp=EPOCH_S + round(t, 6), arbitration_id=291, data=data, is_extended_id=False, channel=0, is_rx=True
        )


def of_can() -> Iterator[tuple[str, Stranger]]:
    def database(folder: pathlib.Path) -> str:
        path = folder / "m.dbc"
        path.write_text(DBC, encoding="utf-8")
        return str(path)

    def logged(ending: str) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            import can

            with can.Logger(folder / f"a.{ending}") as logger:
                for message in messages():
                    logger(message)
            return folder / f"a.{ending}"

        return write

    how = {"databases": database}
    for ending in ("asc", "blf", "trc", "csv", "db", "log", "mf4"):
        yield f"python-can, .{ending}", Stranger(logged(ending), how, off=3e-4, off_s=6e-5)

    def printed(folder: pathlib.Path) -> pathlib.Path:
        import can

        with can.Printer(folder / "a.txt") as printer:
            for message in messages():
                printer(message)
        return folder / "a.txt"

    yield "python-can, Printer", Stranger(printed, refused="words such as 'Timestamp:'")

    def decoded(*options: str) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            import cantools

            shown = "".join(
                f"({each.timestamp:.6f})  vcan0  123   [8]  {' '.join(f'{byte:02X}' for byte in each.data)}\n"
                for each in messages()
            )
            path = folder / "a.log"
            before = sys.argv, sys.stdin
            sys.argv, sys.stdin = ["cantools", "decode", *options, database(folder)], io.StringIO(shown)
            try:
                with path.open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
                    cantools._main()
            finally:
                sys.argv, sys.stdin = before
            return path

        return write

    yield "cantools decode --single-line", Stranger(decoded("--single-line"), how, off=3e-4)
    yield "cantools decode", Stranger(decoded(), how, off=3e-4, refused=":2: not `(stamp) interface identifier")

    def captured(folder: pathlib.Path) -> pathlib.Path:
        import dpkt

        with (folder / "a.pcap").open("wb") as file:
            writer = dpkt.pcap.Writer(file, linktype=227)
            for message in messages():
                packet = (291).to_bytes(4, "big") + bytes([8, 0, 0, 0]) + bytes(message.data)
                writer.writepkt(packet, ts=message.timestamp)
        return folder / "a.pcap"

    yield "dpkt, pcap", Stranger(captured, how, off=3e-4)


# --- other libraries --------------------------------------------------------------------------------------------


def of_other_libraries() -> Iterator[tuple[str, Stranger]]:
    def mcap(compression: str) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            from mcap.writer import CompressionType, Writer

            with (folder / "a.mcap").open("wb") as file:
                writer = Writer(file, compression=CompressionType[compression])
                writer.start()
                schema = writer.register_schema("motor", "jsonschema", b"{}")
                channel = writer.register_channel("/motor", "json", schema)
                for t, *values in rows():
                    content = json.dumps(dict(zip(NAMES[1:], values, strict=True))).encode()
                    time_ns = EPOCH_S * 10**9 + round(t * 1e9)
                    writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=content)
                writer.finish()
            return folder / "a.mcap"

        return write

    for compression in ("NONE", "LZ4", "ZSTD"):
        yield f"MCAP, {compression}", Stranger(mcap(compression))

    def tdms(waveform: bool) -> Callable:
        def write(folder: pathlib.Path) -> pathlib.Path:
            import nptdms

            data = truth()
            with nptdms.TdmsWriter(folder / "a.tdms") as writer:
                for part in (slice(0, 150), slice(150, ROWS)):  # two segments
                    own = [
                        nptdms.ChannelObject(
                            "run",
                            name,
                            data[name][part],
                            {"unit_string": unit, "wf_increment": STEP_S} if waveform else {},
                        )
                        for name, unit in UNITS.items()
                    ]
                    time = [] if waveform else [nptdms.ChannelObject("run", "t_s", data["t"][part])]
                    writer.write_segment([*time, *own])
            return folder / "a.tdms"

        return write

    yield "TDMS, waveforms", Stranger(tdms(True))
    yield "TDMS, a channel of stamps", Stranger(tdms(False), units=False)

    def hdf5(folder: pathlib.Path) -> pathlib.Path:
        import h5py

        with h5py.File(folder / "a.h5", "w") as file:
            for name in NAMES:
                file.create_dataset(name, data=truth()[name.partition("_")[0]], compression="gzip")
        return folder / "a.h5"

    yield "h5py, compressed", Stranger(hdf5)


# --- R, MATLAB, LabVIEW -----------------------------------------------------------------------------------------

QUOTED = ",".join(f'"{name}"' for name in NAMES)


def of_programs() -> Iterator[tuple[str, Stranger]]:
    numbers = "{v:.6f},{i:.6f},{a:.6f}"
    yield "R, write.csv", Stranger(text(lines('"{n}",{t},' + numbers, f'"",{QUOTED}\n')))
    yield (
        "R, write.csv2",
        Stranger(text(with_commas(lines('"{n}";{t};{v:.6f};{i:.6f};{a:.6f}', f'"";{QUOTED.replace(",", ";")}\n'), 1))),
    )
    yield (
        "R, write.table",
        Stranger(text(lines('"{n}" {t} {v:.6f} {i:.6f} {a:.6f}', QUOTED.replace(",", " ") + "\n"), "a.txt")),
    )
    yield "R, write.table, missing values", Stranger(text(lines("{t} {v:.6f} {i:.6f} {a:.6f}", " ".join(NAMES) + "\n")))
    yield "MATLAB, writetable", Stranger(text(lines("{t}," + numbers, ",".join(NAMES) + "\n")))
    yield (
        "MATLAB, writetimetable, durations",
        Stranger(text(lines("{t} sec," + numbers, "Time," + ",".join(NAMES[1:]) + "\n", lambda t: f"{t:g}"))),
    )
    yield (
        "MATLAB, writetimetable, dates",
        Stranger(
            text(
                lines("{t}," + numbers, "Time," + ",".join(NAMES[1:]) + "\n", lambda t: f"05-Nov-2026 09:30:{t:06.3f}")
            )
        ),
    )
    yield (
        "MATLAB, save -ascii",
        Stranger(text(lines("{t}  {v:.7e}  {i:.7e}  {a:.7e}", every=lambda t: f"  {t:.7e}"), "a.txt"), units=False),
    )
    yield "MATLAB, dlmwrite", Stranger(text(lines("{t}," + numbers), "a.txt"), units=False)
    yield (
        "rostopic echo -p",
        Stranger(
            text(
                lines(
                    "{t}," + numbers,
                    "%time,field.voltage,field.current,field.angle\n",
                    lambda t: str(EPOCH_S * 10**9 + round(t * 1e9)),
                )
            ),
            units=False,
        ),
    )
    yield (
        "PlotJuggler",
        Stranger(
            text(
                lines("{t}," + numbers, "__time,/run/voltage,/run/current,/run/angle\n", lambda t: f"{EPOCH_S + t:.6f}")
            ),
            units=False,
        ),
    )
    yield (
        "Excel with its line of the separator",
        Stranger(
            text(
                with_commas(lines("{t};{v:.6f};{i:.6f};{a:.6f}", "sep=;\n" + ";".join(NAMES) + "\n"), 2),
                encoding="cp1252",
            )
        ),
    )
    yield "Saleae Logic", Stranger(text(lines("{t}," + numbers, "Time [s],voltage [V],current [A],angle [rad]\n")))
    yield (
        "Digilent WaveForms",
        Stranger(
            text(
                lines(
                    "{t}," + numbers,
                    "#Digilent WaveForms Oscilloscope Acquisition\n#Device Name: Discovery2\n#Serial Number: SN:2\n"
                    "#Date Time: 2026-11-05 09:30:00.000.000\n#Sample rate: 100Hz\n#Samples: 400\n#Trigger: None\n"
                    "Time (s),voltage (V),current (A),angle (rad)\n",
                )
            )
        ),
    )
    yield (
        "sigrok",
        Stranger(
            text(
                lines(
                    numbers,
                    "; CSV generated by libsigrok 0.5.2 on Thu Nov  5 2026\n; Channels (3/3): voltage, current, "
                    "angle\n; Samplerate: 100 Hz\nvoltage,current,angle\n",
                )
            ),
            units=False,
        ),
    )
    yield (
        "MoTeC",
        Stranger(
            text(
                lines(
                    '"{t}","{v:.6f}","{i:.6f}","{a:.6f}"',
                    '"Format","MoTeC CSV File",,,"Workbook","bench"\n"Venue","",,,"Worksheet","1"\n"Sample Rate","100",'
                    '"Hz",,"Duration","4.0","s"\n\n"Time","voltage","current","angle"\n"s","V","A","rad"\n\n',
                )
            )
        ),
    )


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t{mark}
Multi_Headings\tYes
X_Columns\t{columns}
Time_Pref\tAbsolute
Operator\tm
Date\t2026/11/05
Time\t09:30:00{mark}0
***End_of_Header***\t
"""


def segment(columns: str, first: int, count: int, mark: str) -> str:
    data = truth()
    begin = f"09:30:{first * STEP_S:07.4f}0000000"
    gap = "\t\t" if columns == "Multi" else "\t"

    def each(*values: str) -> str:
        return gap.join(values)

    head = [
        "",
        "Channels\t3",
        f"Samples\t{each(*[str(count)] * 3)}",
        f"Date\t{each(*['2026/11/05'] * 3)}",
        f"Time\t{each(*[begin] * 3)}",
        f"Y_Unit_Label\t{each('Volts', 'Amps', 'rad')}",
        f"X_Dimension\t{each(*['Time'] * 3)}",
        f"X0\t{each(*['0.0000000000000000E+0'] * 3)}",
        f"Delta_X\t{each(*['0.010000'] * 3)}",
        "***End_of_Header***",
        "X_Value\t" + ("\tX_Value\t" if columns == "Multi" else "\t").join(UNITS) + "\tComment",
    ]
    for k in range(count):
        x = "" if columns == "No" else f"{k * STEP_S:.6f}"
        values = [f"{data[name][first + k]:.6f}" for name in UNITS]
        glue = f"\t{x}\t" if columns == "Multi" else "\t"
        head.append(f"{x}\t{glue.join(values)}")
    return ("\n".join(head) + "\n").replace(".", mark)


def of_labview() -> Iterator[tuple[str, Stranger]]:
    for columns in ("No", "One", "Multi"):
        for mark in ".,":
            content = LVM.format(mark=mark, columns=columns) + segment(columns, 0, ROWS, mark)
            yield f"LabVIEW, X_Columns {columns}, decimal {mark}", Stranger(text(content, "a.lvm"))
        parts = "".join(segment(columns, first, 100, ".") for first in range(0, ROWS, 100))
        yield (
            f"LabVIEW, X_Columns {columns}, four segments",
            Stranger(text(LVM.format(mark=".", columns=columns) + parts, "a.lvm"), off_s=2e-4),
        )


# --- instruments ------------------------------------------------------------------------------------------------


def of_instruments() -> Iterator[tuple[str, Stranger]]:
    numbers = "{v:.6f},{i:.6f},{a:.6f}"
    exponents = "{v:+.7E},{i:+.7E},{a:+.7E}"
    yield (
        "Rohde & Schwarz",
        Stranger(
            text(lines("{t}," + exponents, "in s,voltage in V,current in A,angle in rad\n", lambda t: f"{t:.6E}"))
        ),
    )
    yield (
        "Rigol MSO5000",
        Stranger(
            text(
                lines(
                    "{t}," + numbers + ",,",
                    "Time(s),voltage(V),current(A),angle(rad),t0 = 0.000000e+00, tInc = 1.000000e-02,\n",
                )
            )
        ),
    )
    yield (
        "Rigol DS1000Z",
        Stranger(
            text(
                lines(
                    "{k}," + numbers + ",,", "X,voltage,current,angle,Start,Increment,\nSequence,V,A,rad,0.0,1.0e-02\n"
                )
            )
        ),
    )
    yield (
        "Keysight InfiniiVision",
        Stranger(
            text(
                lines(
                    "{t}," + exponents, "x-axis,voltage,current,angle\nsecond,Volt,Ampere,rad\n", lambda t: f"{t:+.7E}"
                )
            )
        ),
    )
    yield (
        "Tektronix MSO",
        Stranger(
            text(
                lines(
                    "{t}," + numbers,
                    "Model,MSO54\nFirmware Version,1.44\nWaveform Type,ANALOG\nPoint Format,Y\nHorizontal Units,s\n"
                    "Horizontal Scale,0.4\nHorizontal Delay,0\nSample Interval,0.01\nRecord Length,400\nGating,0.0% to "
                    "100.0%\nProbe Attenuation,1,1,1\nVertical Units,V,A,rad\nVertical Offset,0,0,0\n"
                    "Vertical Scale,1,1,1\nVertical Position,0,0,0\n,,,\n,,,\n,,,\nLabel,,,\nTIME,voltage,"
                    "current,angle\n",
                    lambda t: f"{t:.6e}",
                )
            )
        ),
    )
    yield (
        "PicoScope 7, ms",
        Stranger(
            text(
                lines(
                    "{t}," + numbers,
                    "Time,voltage,current,angle\n(ms),(V),(A),(rad)\n\n",
                    lambda t: f"{1000.0 * t:.8f}",
                )
            )
        ),
    )
    yield (
        "Siglent",
        Stranger(
            text(
                lines(
                    "{t}," + numbers,
                    "Record Length,Analog:400\nSample Interval,Analog:0.01\nVertical Units,a:V,b:A,c:rad\n"
                    "Vertical Scale,voltage:1.0,current:1.0,angle:1.0\nHorizontal Units,s\nHorizontal Scale,0.4\n"
                    "Model Number,SDS1104X-E\nSerial Number,1\nSoftware Version,8.2\nSource,voltage,current,angle\n"
                    "Second,voltage,current,angle\n",
                    lambda t: f"{t:.8f}",
                )
            )
        ),
    )
    yield (
        "Hantek, tabs",
        Stranger(
            text(
                lines(
                    "{k}\t{t}\t{v:.6f}\t{i:.6f}\t{a:.6f}", "sample\ttime\tvoltage\tcurrent\tangle\n", lambda t: f"{t:g}"
                )
            ),
            units=False,
        ),
    )
    yield (
        "Yokogawa",
        Stranger(
            text(
                lines(
                    numbers,
                    '"Model","DL850"\n"BlockNumber",1\n"TraceName","voltage","current","angle"\n"BlockSize",400,400,400\n'
                    '"VUnit","V","A","rad"\n"SampleRate",100,100,100\n"HResolution",0.01,0.01,0.01\n"HOffset",0,0,0\n'
                    '"HUnit","s","s","s"\n"DisplayBlockSize",400,400,400\n"Date","2026/11/05","2026/11/05","2026/11/05"\n'
                    '"Time","09:30:00.0","09:30:00.0","09:30:00.0"\n\n',
                )
            )
        ),
    )
    yield (
        "LeCroy, one channel",
        Stranger(
            text(
                lines(
                    "{t},{v:.6f}",
                    "LECROYHDO6104,1234,Waveform\nSegments,1,SegmentSize,400\nSegment,TrigTime,TimeSinceSegment1\n"
                    "#1,05-Nov-2026 09:30:00,0                 \nTime,voltage\n",
                    lambda t: f"{t:.7e}",
                )
            ),
            units=False,
        ),
    )


def strangers() -> Iterator[tuple[str, Stranger]]:
    """(name, file) of all, in a fixed order."""
    for group, made in (
        ("pandas", of_pandas), ("NumPy", of_numpy), ("SciPy", of_scipy), ("Python", of_csv_module),
        ("asammdf", of_asammdf), ("CAN", of_can), ("library", of_other_libraries), ("program", of_programs),
        ("LabVIEW", of_labview), ("instrument", of_instruments),
    ):  # fmt: skip
        for name, each in made():
            yield f"{group}: {name}", each


def judged(stranger: Stranger, folder: pathlib.Path) -> tuple[str, str]:
    """(verdict, reason); the verdict is MISSING where a library is not installed."""
    try:
        path = stranger.write(folder)
    except (ImportError, NotImplementedError) as error:  # python-can's for a library that lacks what it needs
        return MISSING, str(error)
    how = dict(stranger.how)
    if "databases" in how:
        how["databases"] = [how["databases"](folder)]
    try:
        found = read(path, **how)
    except UserError as error:
        said = " ".join(map(str, error.args))
        return (REFUSED if stranger.refused and stranger.refused in said else FALSELY), said
    except ModuleNotFoundError as error:
        return MISSING, str(error)
    difference = _difference(stranger, found.channels)
    return (WRONG, difference) if difference else (RIGHT, "")


def _difference(stranger: Stranger, channels: Any) -> str:
    true = truth()
    unnamed = list(channels)
    for place, (stem, unit) in enumerate(UNITS.items()):
        named = [name for name in channels if stem in name]
        if not named and all(name.startswith("column_") for name in unnamed):
            named = [unnamed[place]]
        if not named:
            if len(channels) == 1:
                continue  # a file of one channel
            return f"without {stem}, there are {', '.join(channels)}"
        channel = channels[named[0]]
        if channel.unit != (unit if stranger.units else channel.unit):
            return f"{stem} in {channel.unit!r}"
        if len(channel.value) != ROWS:
            return f"{stem}: {len(channel.value)} samples"
        off_s = np.abs(channel.time_s - channel.time_s[0] - true["t"]).max()
        if not off_s < stranger.off_s:
            return f"{stem}: stamps off by {off_s:g} s"
        off = np.abs(channel.value - true[stem]).max()
        if not off < stranger.off:
            return f"{stem}: off by {off:g}"
    return ""
