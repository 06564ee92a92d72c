"""`ranger-sim new DIR`: a project for a user's own machine, whose first test passes at once."""

import argparse
import importlib.util
import pathlib
import re
import shutil
import tempfile
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.new.words import variant

HERE = pathlib.Path(__file__).resolve().parent
# file of the project: (template next to this module, its word for "board")
FILES: dict[str, tuple[str, str]] = {
    "README.md": ("README.md.j2", ""),
    "body.py": ("body.py.j2", ""),
    "campaign.toml": ("campaign.toml.j2", ""),
    "common.h": ("common.h.j2", ""),
    "conftest.py": ("conftest.py.j2", ""),
    "machine.py": ("machine.py.j2", ""),
    "test_machine.py": ("test_machine.py.j2", ""),
    "table/boards.toml": ("boards.toml.j2", ""),
    "table/variables.csv": ("variables.csv.j2", ""),
    "table/errors.csv": ("errors.csv.j2", ""),
    "wheel/firmware.toml": ("firmware.toml.j2", "wheel"),
    "wheel/wheel.c": ("wheel.c.j2", ""),
    "panel/firmware.toml": ("firmware.toml.j2", "panel"),
    "panel/panel.c": ("panel.c.j2", ""),
}
# pytest.ini: a separate file, so that a configuration in a folder above has no effect.
WRITTEN = {
    "pytest.ini": "[pytest]\naddopts = --strict-markers\n",
    ".gitignore": "build/\nruns/\n__pycache__/\n",
    ".vscode/launch.json": (HERE / "launch.json").read_text(encoding="utf-8"),
}
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,59}")


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "new",
        description="Two boards in C, a body, a master table, tests and a campaign. `pytest` in DIR passes at once.",
        epilog="docs/how-to/machine.md goes through it; examples/servo is a larger one.",
    )
    command.add_argument("folder", metavar="DIR", help="a folder that is not there yet, or is empty")
    command.add_argument(
        "--from",
        dest="dbc",
        type=pathlib.Path,
        metavar="FILE.dbc",
        help="boards, messages and tests from the nodes and messages of a DBC file",
    )
    command.add_argument(
        "--bit-rate", type=int, metavar="BIT/S", help="with --from: of the bus, where the file has no Baudrate (500000)"
    )
    command.add_argument(
        "--plant",
        nargs=2,
        metavar=("mujoco|fmu", "FILE"),
        help="mujoco: a board for each actuator of a robot's MJCF or URDF model, and a main board; fmu: boards at the "
        "inputs and outputs of a unit of FMI 2.0 or 3.0 for co-simulation, and a main board",
    )
    command.add_argument(
        "--drive",
        choices=("cia402", "odrive"),
        help="joints' drives that a robot's own driver talks to: CiA 402 over CANopen, or ODrive's CAN protocol; with "
        "--plant mujoco at each actuator of the model",
    )
    command.add_argument(
        "--fd", action="store_true", help="boards with CAN FD controllers, and frames of up to 64 bytes on their bus"
    )
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Write it whole or not at all."""
    folder = pathlib.Path(options.folder)
    name = folder.resolve().name
    if not NAME.fullmatch(name):
        raise UserError(
            f"new {options.folder!r}: a folder's name of letters, digits, spaces and ._- is needed, 60 at most"
        )
    check(folder)
    if options.dbc is None and options.bit_rate is not None:
        raise UserError("new --bit-rate: belongs to --from FILE.dbc")
    if options.plant is not None and options.dbc is not None:
        raise UserError("new: --plant and --from exclude each other")
    if options.drive is not None and options.dbc is not None:
        raise UserError("new: --drive and --from exclude each other")
    is_fmu = options.plant is not None and options.plant[0] == "fmu"
    if options.fd and (options.dbc is not None or options.drive is not None or is_fmu):
        raise UserError("new: --fd excludes --from, --drive and --plant fmu, whose boards are classic")
    files = {}
    if options.dbc is not None:
        files = files_of_dbc(options.dbc, options.bit_rate, name)
    elif options.drive is not None:
        files = files_of_drives(options.drive, options.plant, name)
    elif options.plant is not None:
        files = files_of_model(options.plant[0], options.plant[1], name, options.fd)
    try:
        folder.resolve().parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".ranger-sim-new-", dir=folder.resolve().parent) as making:
            project = pathlib.Path(making) / "project"
            write_files(project, files or own_files(name, options.fd))
            if (project / "table").is_dir():
                generate_table(project)
            check(folder)
            take_over(project, folder)
    except OSError as error:
        raise UserError(f"new {folder}: {error.filename or folder}: {error.strerror}") from None
    print(f"{folder}: written. cd {folder}; pytest")
    return 0


def check(folder: pathlib.Path) -> None:
    """UserError for an existing file or link, or a folder that is not empty."""
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise UserError(f"new {folder}: it exists and is not a folder")
    if folder.is_dir() and any(folder.iterdir()):
        raise UserError(f"new {folder}: the folder is not empty; give one that is not there yet")


def own_files(name: str, fd: bool = False) -> dict[str, bytes]:
    """The files of the project with a wheel; `fd`: on a CAN FD bus."""
    return {
        path: variant((HERE / template).read_text(encoding="utf-8"), fd)
        .replace("[% name %]", name)
        .replace("[% board %]", board)
        .encode("utf-8")
        for path, (template, board) in FILES.items()
    }


def generate_table(project: pathlib.Path) -> None:
    """Write the files generated from the project's table."""
    from ranger_sim.datatable import generate
    from ranger_sim.datatable.loader import load_table

    generate.write(load_table(project / "table"), project / "table" / "generated")


def files_of_model(kind: str, model: str, name: str, fd: bool = False) -> dict[str, bytes]:
    """The files of a project for the actuators of a robot's model; fd: its boards on a CAN FD bus."""
    if kind == "fmu":
        return files_of_unit(model, name)
    if kind != "mujoco":
        raise UserError(f"new --plant {kind}: allowed are mujoco and fmu")
    from ranger_sim.tools.new import from_mujoco

    robot = from_mujoco.read(pathlib.Path(model))
    made = from_mujoco.files(robot, name, fd)
    print(f"{model}: {len(robot.joints)} actuators, {len(robot.others)} other joints")
    for line in robot.left_out:
        print(f"{model}: left out: {line}")
    return made


def files_of_unit(file: str, name: str) -> dict[str, bytes]:
    """The files of a project for the inputs and outputs of an FMI unit."""
    if importlib.util.find_spec("fmpy") is None:
        raise UserError("new --plant fmu: needs FMPy: pip install fmpy")
    from ranger_sim.tools.new import from_fmu

    unit = from_fmu.read(pathlib.Path(file))
    print(f"{file}: {len(unit.inputs)} inputs, {len(unit.outputs)} outputs")
    for line in unit.left_out:
        print(f"{file}: left out: {line}")
    return from_fmu.files(unit, name)


def files_of_drives(protocol: str, plant: list[str] | None, name: str) -> dict[str, bytes]:
    """The files of a project with drives of this protocol, at links or at the actuators of a model."""
    from ranger_sim import __version__
    from ranger_sim.tools.new import drives

    made: dict[str, bytes] = {}
    axes, model = drives.links(), ""
    if plant is not None:
        if plant[0] != "mujoco":
            raise UserError(f"new --drive {protocol} --plant {plant[0]}: allowed is mujoco")
        from ranger_sim.tools.new import from_mujoco

        robot = from_mujoco.read(pathlib.Path(plant[1]))
        axes = from_mujoco.axes(robot)
        model, made = from_mujoco.model_files(robot.file)
        for line in robot.left_out:
            print(f"{plant[1]}: left out: {line}")
    texts = drives.files(axes, protocol, name, __version__, model)
    return made | {path: text.encode("utf-8") for path, text in texts.items()}


def files_of_dbc(dbc: pathlib.Path, bit_rate: int | None, name: str) -> dict[str, bytes]:
    """The files of a project for the boards of a DBC file, with a copy of that file."""
    from ranger_sim.tools.new import from_dbc

    if bit_rate is not None and not 10_000 <= bit_rate <= 3_000_000:
        raise UserError(f"new --bit-rate {bit_rate}: 10000 to 3000000 bit/s")
    network = from_dbc.read(dbc, bit_rate)
    files = {path: text.encode("utf-8") for path, text in from_dbc.files(network, name, dbc).items()}
    files[f"{network.stem}.dbc"] = dbc.read_bytes()  # as it is: the encoding of a DBC file is not written in it
    print(f"{dbc}: {len(network.nodes)} boards, {len(network.messages)} messages, {network.bit_rate} bit/s")
    for line in network.left_out:
        print(f"{dbc}: left out: {line}")
    return files


def write_files(project: pathlib.Path, files: dict[str, bytes]) -> None:
    """Write a project's files, {path: content}."""
    for path, content in (files | {path: text.encode("utf-8") for path, text in WRITTEN.items()}).items():
        (project / path).parent.mkdir(parents=True, exist_ok=True)
        (project / path).write_bytes(content)


def take_over(project: pathlib.Path, folder: pathlib.Path) -> None:
    """Rename the project to `folder`; into an empty one, in which a shell may be running, move its parts."""
    if not folder.exists():
        project.rename(folder)
        return
    moved = []
    try:
        for each in sorted(project.iterdir()):
            each.rename(folder / each.name)
            moved.append(folder / each.name)
    except OSError:
        for each in moved:
            shutil.rmtree(each) if each.is_dir() else each.unlink()
        raise
