"""The guest's kernel: found on this machine, with the modules it needs in the order of loading."""

from __future__ import annotations

import dataclasses
import gzip
import lzma
import os
import pathlib
import re
import subprocess
from collections.abc import Callable

from ranger_sim.foundation.user_error import UserError

INSTALL_SCRIPT = pathlib.Path(__file__).with_name("install-packages.sh")
FOLDER_VARIABLE = "RANGER_SIM_VM_KERNEL"

# Modules that the guest loads, by the kernel's names; their dependencies are added.
MODULES = (
    "virtio_pci",  # the devices below
    "virtio_console",  # standard output and error of the command
    "9pnet_virtio",  # the host's files
    "9p",
    "overlay",  # keeps writes over the host's files in the guest's memory
    "can_raw",
    "can_bcm",
    "can_gw",
    "can_isotp",
    "vcan",
    "vxcan",
    "slcan",
    "kvaser_pci",
)
# Compressions of module files and the functions that undo them.
UNPACK: dict[str, Callable[[bytes], bytes]] = {
    ".ko": lambda data: data,
    ".ko.xz": lzma.decompress,
    ".ko.gz": gzip.decompress,
    ".ko.zst": lambda data: subprocess.run(["zstd", "-dc"], input=data, capture_output=True, check=True).stdout,
}
# Not modules in every kernel: if built in, they have no file.
MAY_BE_BUILT_IN = {"virtio_pci", "virtio_console", "9pnet_virtio", "9p", "overlay", "can_bcm", "can_gw", "can_isotp"}
OPTIONAL = {"vxcan", "slcan"}


@dataclasses.dataclass(frozen=True)
class Kernel:
    """A kernel image and its modules, each (file name, content), in the order of loading."""

    version: str
    image: pathlib.Path
    modules: tuple[tuple[str, bytes], ...]


def own_folder() -> pathlib.Path:
    """The folder into which the install script unpacks a kernel for the machine, separate from installed ones."""
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return pathlib.Path(cache).expanduser() / "ranger-sim" / "kernel"


def candidates() -> list[pathlib.Path]:
    """Folders that may hold boot/vmlinuz-* and lib/modules/*, best first."""
    chosen = os.environ.get(FOLDER_VARIABLE)
    return [pathlib.Path(chosen)] if chosen else [own_folder(), pathlib.Path("/")]


def find() -> Kernel:
    """The newest usable kernel; UserError with the reason against each other one, and the command to run."""
    faults = []
    for folder in candidates():
        trees = sorted((folder / "lib" / "modules").glob("*/kernel"), key=lambda tree: version_key(tree.parent.name))
        for tree in reversed(trees):
            version = tree.parent.name
            image = folder / "boot" / f"vmlinuz-{version}"
            if not os.access(image, os.R_OK):
                faults.append(f"{image} is not readable")
                continue
            try:
                return Kernel(version, image, load_order(tree))
            except LookupError as missing:
                faults.append(f"{tree.parent} has no module {missing.args[0]}")
        if not trees:
            faults.append(f"{folder} has no lib/modules/*/kernel")
    raise UserError(f"vm: no kernel with SocketCAN ({'; '.join(faults)}); run {INSTALL_SCRIPT}")


def version_key(version: str) -> list[int]:
    """A sort key: 6.1.0-10 is newer than 6.1.0-9."""
    return [int(number) for number in re.findall(r"\d+", version)]


def load_order(tree: pathlib.Path) -> tuple[tuple[str, bytes], ...]:
    """MODULES of one kernel and their dependencies, dependencies first; LookupError names a missing one."""
    files: dict[str, pathlib.Path] = {}
    for path in tree.rglob("*.ko*"):
        files[path.name.partition(".")[0].replace("-", "_")] = path
    loaded: dict[str, bytes] = {}

    def load(name: str) -> None:
        if name in loaded:
            return
        if name not in files:
            if name in MAY_BE_BUILT_IN | OPTIONAL:
                return
            raise LookupError(name)
        data = UNPACK["." + files[name].name.partition(".")[2]](files[name].read_bytes())
        for needed in dependencies(data):
            load(needed)
        loaded[name] = data

    for name in MODULES:
        load(name)
    return tuple((f"{name}.ko", data) for name, data in loaded.items())


def dependencies(module: bytes) -> list[str]:
    """The dependencies of a module: the `depends=` entry of its .modinfo section."""
    found = re.search(rb"\0depends=([\w,-]*)\0", module)
    return [name.replace("-", "_") for name in found.group(1).decode().split(",") if name] if found else []
