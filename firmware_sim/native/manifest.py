"""`firmware.toml`: the parts of a folder of firmware in C, and the devices at its chip.

[firmware]
name = "hip"                 # of the library
sources = ["*.c"]            # patterns, relative to this file; C++ is refused, also next to them where this is left out
include = ["."]              # folders of headers, in addition to ours
tables = ["mch"]             # generated C of these boards' data tables, compiled along
master = "../table"          # folder of the master table that they are of; left out: Ranger's
options = ["-O2"]            # more for the compiler, behind ours
[defines]
REZERO = 1                   # -DREZERO=1
[hardware]                   # all of it may be left out
hz = 60000000
can = "fd"                   # its CAN controllers: "classic" of the LPC2194, or "fd"; left out: as the master table's
[hardware.external]          # ADS7871: eint, conversion_ns, reference_V, scale, offset_counts, inputs
inputs = { 2 = 0, 1 = 1 }    # multiplexer code = analog place
[hardware.internal]          # reference_V, scale, offset_counts, inputs
[hardware.spi.0]             # word, bits, bit_rate, value_bits
"""

import dataclasses
import pathlib
import re
from typing import Any

from ranger_sim.firmware_sim.native.hardware import CAN_KINDS, ExternalConverter, Hardware, InternalConverter, SpiDevice
from ranger_sim.foundation import toml_file
from ranger_sim.foundation.user_error import FirmwareError

FILE = "firmware.toml"
DEFAULT_SOURCES = ["*.c"]
CPLUSPLUS = (".cpp", ".cc", ".cxx", ".c++", ".C")
NAME = re.compile(r"[A-Za-z_]\w*")


@dataclasses.dataclass(frozen=True)
class Manifest:
    """A folder of firmware. `sources` are found already; `hardware` is None where the file has none."""

    folder: pathlib.Path
    name: str
    sources: tuple[pathlib.Path, ...]
    include: tuple[pathlib.Path, ...]
    tables: tuple[str, ...]
    master: pathlib.Path | None
    options: tuple[str, ...]
    defines: tuple[tuple[str, str], ...]
    hardware: Hardware | None


def load(folder: str | pathlib.Path) -> Manifest:
    """The manifest in `folder`; UserError that names file, key and value for whatever is wrong with it."""
    folder = pathlib.Path(folder)
    path = folder / FILE
    if not path.exists():
        raise FirmwareError(f"{folder}: no {FILE} in it, so it is not a folder of firmware")
    found = toml_file.load(path)
    _known(path, "", found, ("firmware", "defines", "hardware"))
    firmware = _table(path, found, "firmware")
    _known(path, "firmware.", firmware, ("name", "sources", "include", "tables", "master", "options"))
    name = firmware.get("name", folder.resolve().name)
    if not isinstance(name, str) or not re.fullmatch(r"[\w-]+", name):
        raise FirmwareError(f"{path}: firmware.name {name!r}: letters, digits, _ and - are expected")
    return Manifest(
        folder=folder,
        name=name,
        sources=_sources(path, folder, _texts(path, firmware, "sources", DEFAULT_SOURCES), "sources" in firmware),
        include=tuple(_folder(path, folder, each) for each in _texts(path, firmware, "include", ["."])),
        tables=tuple(_texts(path, firmware, "tables", [])),
        master=_master(path, folder, firmware),
        options=tuple(_texts(path, firmware, "options", [])),
        defines=_defines(path, _table(path, found, "defines")),
        hardware=_hardware(path, _table(path, found, "hardware")) if "hardware" in found else None,
    )


def _table(path: pathlib.Path, within: dict, key: str, prefix: str = "") -> dict[str, Any]:
    found = within.get(key, {})
    if not isinstance(found, dict):
        raise FirmwareError(f"{path}: {prefix}{key} is {found!r}, a table is expected")
    return found


def _known(path: pathlib.Path, prefix: str, found: dict, names: tuple[str, ...]) -> None:
    for key in found:
        if key not in names:
            raise FirmwareError(f"{path}: {prefix}{key}: not known here; there are {', '.join(names)}")


def _texts(path: pathlib.Path, firmware: dict, key: str, default: list[str]) -> list[str]:
    found = firmware.get(key, default)
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise FirmwareError(f"{path}: firmware.{key} is {found!r}, a list of texts is expected")
    return found


def _sources(path: pathlib.Path, folder: pathlib.Path, patterns: list[str], given: bool) -> tuple[pathlib.Path, ...]:
    sources: list[pathlib.Path] = []
    for pattern in patterns:
        try:
            matching = sorted(folder.glob(pattern))
        except (ValueError, NotImplementedError):
            raise FirmwareError(
                f"{path}: firmware.sources: {pattern!r} is not a pattern relative to its folder"
            ) from None
        if not matching:
            raise FirmwareError(f"{path}: firmware.sources: {pattern!r} matches no file in {folder}")
        sources += [each for each in matching if each not in sources]
    others = [] if given else [each for each in sorted(folder.iterdir()) if each not in sources]
    for each in (*sources, *others):
        if each.suffix in CPLUSPLUS:
            way_out = "" if each in sources else f" (firmware.sources = {DEFAULT_SOURCES} leaves it out)"
            raise FirmwareError(f"{path}: {each.name} is C++, and firmware is built from C alone{way_out}")
    return tuple(sources)


def _folder(path: pathlib.Path, folder: pathlib.Path, name: str) -> pathlib.Path:
    if not (folder / name).is_dir():
        raise FirmwareError(f"{path}: firmware.include: {name!r} is not a folder in {folder}")
    return folder / name


def _master(path: pathlib.Path, folder: pathlib.Path, firmware: dict) -> pathlib.Path | None:
    name = firmware.get("master")
    if name is None:
        return None
    if not isinstance(name, str) or not (folder / name).is_dir():
        raise FirmwareError(f"{path}: firmware.master: {name!r} is not a folder in {folder}")
    return folder / name


def _defines(path: pathlib.Path, found: dict) -> tuple[tuple[str, str], ...]:
    for name, value in found.items():
        if not NAME.fullmatch(name):
            raise FirmwareError(f"{path}: defines: {name!r} is not a name in C")
        if not isinstance(value, int | float | str):
            raise FirmwareError(f"{path}: defines.{name} is {value!r}, a number, text or truth value is expected")
    return tuple((name, str(int(v) if isinstance(v, bool) else v)) for name, v in found.items())


def _hardware(path: pathlib.Path, found: dict) -> Hardware:
    _known(path, "hardware.", found, ("hz", "can", "external", "internal", "spi"))
    given: dict[str, Any] = {}
    if "hz" in found:
        given["hz"] = _number(path, "hardware.hz", found["hz"], int)
        if given["hz"] < 1:
            raise FirmwareError(f"{path}: hardware.hz {given['hz']} must be above 0")
    if "can" in found:
        if found["can"] not in CAN_KINDS:
            raise FirmwareError(f"{path}: hardware.can is {found['can']!r}, allowed are {', '.join(CAN_KINDS)}")
        given["can"] = found["can"]
    for key, kind in (("external", ExternalConverter), ("internal", InternalConverter)):
        if key in found:
            given[key] = _record(path, f"hardware.{key}", _table(path, found, key, "hardware."), kind)
    if "spi" in found:
        given["spi"] = {}
        for number, device in _table(path, found, "spi", "hardware.").items():
            if not number.isdecimal() or not isinstance(device, dict):
                raise FirmwareError(f"{path}: hardware.spi.{number}: a number of an SPI, and a table, are expected")
            given["spi"][int(number)] = _record(path, f"hardware.spi.{number}", device, SpiDevice)
    return Hardware(**given)


def _record(path: pathlib.Path, where: str, found: dict, kind: Any) -> Any:
    """A record of `kind` from the table at `where`."""
    fields = {field.name: field for field in dataclasses.fields(kind)}
    _known(path, f"{where}.", found, tuple(fields))
    given = {}
    for key, value in found.items():
        if key == "inputs":
            if not isinstance(value, dict) or not all(
                code.isdecimal() and type(place) is int and 0 <= place < 8 for code, place in value.items()
            ):
                raise FirmwareError(f"{path}: {where}.inputs is {value!r}, channel = analog place 0 ... 7 is expected")
            given[key] = {int(code): place for code, place in value.items()}
        else:
            given[key] = _number(path, f"{where}.{key}", value, fields[key].type)
    return kind(**given)


def _number(path: pathlib.Path, where: str, value: Any, kind: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int if kind is int else int | float):
        raise FirmwareError(
            f"{path}: {where} is {value!r}, a {'whole number' if kind is int else 'number'} is expected"
        )
    return value
