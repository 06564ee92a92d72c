"""Files that a command writes: checked before the work begins, written whole or not at all."""

import contextlib
import pathlib
import tempfile

from ranger_sim.foundation.user_error import UserError

OPEN_FILES = ("/dev", "/dev/fd", "/proc/self/fd")  # /dev/stdout, /dev/fd/63 of a shell's >(...)


def writable_folder(name: str | pathlib.Path) -> pathlib.Path:
    """Return the folder, made if missing; UserError if it is not writable."""
    folder = pathlib.Path(name)
    if folder.exists() and not folder.is_dir():
        raise UserError(f"cannot write to {folder}: this is a file, a folder is needed")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise UserError(f"cannot write to {folder}: {error.strerror}") from None
    return folder


def json_target(option: str | None) -> pathlib.Path | None:
    """The file that `--json` names, its folder made if missing; None for `-` or without the option."""
    if option in (None, "-"):
        return None
    path = pathlib.Path(option or "")
    if path.is_dir():
        raise UserError(f"--json {option!r}: this is a folder, give a file or -")
    if not is_stream(path):
        writable_folder(path.resolve().parent)
    return path


def is_stream(path: pathlib.Path) -> bool:
    """True for a device, a pipe, or an open file by its number: written into, where a file would be replaced."""
    return str(path.parent) in OPEN_FILES or (path.exists() and not path.is_file())


def replace_file(path: pathlib.Path, content: bytes) -> None:
    """Write the file whole or not at all; a link stays and its file is written, a stream gets the content.

    OSError that names it, where the disk is full.
    """
    if is_stream(path):
        path.write_bytes(content)
        return
    path = path.resolve()
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.name, delete=False) as handle:
        temporary = pathlib.Path(handle.name)
        try:
            handle.write(content)
            handle.close()
            temporary.chmod(0o644)
            temporary.replace(path)
        except BaseException as error:
            with contextlib.suppress(OSError):
                handle.close()  # what did not fit is not tried again
            temporary.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise OSError(error.errno, error.strerror, str(path)) from None
            raise
