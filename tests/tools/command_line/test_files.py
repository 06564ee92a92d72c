"""Files that a command writes: a device, a pipe and a link stay what they are."""

import os
import stat

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timeline.files import write
from ranger_sim.harness.timeline.model import Events
from ranger_sim.tools.command_line.files import is_stream, json_target, replace_file


def test_a_pipe_gets_the_content_and_stays_a_pipe(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        target = json_target(str(path))
        replace_file(target, b"{}\n")
        assert os.read(reader, 100) == b"{}\n"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(path.stat().st_mode) and [each.name for each in tmp_path.iterdir()] == ["pipe"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root makes devices")
def test_a_device_gets_the_content_and_stays_a_device(tmp_path):
    """As root a file in the place of /dev/null would be every program's."""
    path = tmp_path / "null"
    try:
        os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
        path.write_bytes(b"")
    except OSError as error:
        pytest.skip(f"no device here: {error.strerror}")
    replace_file(json_target(str(path)), b"{}\n")
    assert stat.S_ISCHR(path.stat().st_mode)


def test_an_open_file_by_its_number_is_written_as_a_shell_gives_it():
    reader, writer = os.pipe()
    try:
        target = json_target(f"/dev/fd/{writer}")
        replace_file(target, b"{}\n")
        assert os.read(reader, 100) == b"{}\n"
    finally:
        os.close(reader)
        os.close(writer)


def test_a_link_stays_and_its_file_is_written_whole(tmp_path):
    (tmp_path / "there").mkdir()
    file, link = tmp_path / "there" / "answer.json", tmp_path / "link.json"
    file.write_bytes(b"old")
    link.symlink_to(file)
    replace_file(json_target(str(link)), b"new")
    assert link.is_symlink() and file.read_bytes() == b"new"
    assert sorted(each.name for each in tmp_path.rglob("*")) == ["answer.json", "link.json", "there"]


def test_a_file_and_what_is_not_there_yet_are_replaced(tmp_path):
    path = tmp_path / "answer.json"
    for content in (b"first", b"second"):
        assert not is_stream(path)
        replace_file(json_target(str(path)), content)
        assert path.read_bytes() == content
    with pytest.raises(UserError, match="this is a folder"):
        json_target(str(tmp_path))


def test_a_timeline_s_link_stays_and_a_pipe_is_refused(tmp_path):
    link, file, pipe = (tmp_path / name for name in ("link.vcd", "there.vcd", "pipe.vcd"))
    file.write_bytes(b"old")
    link.symlink_to(file)
    os.mkfifo(pipe)
    write(Events(0, 1000), link, "nothing")
    assert link.is_symlink() and file.read_bytes() != b"old"
    with pytest.raises(UserError, match=r"pipe\.vcd: that is a device or a pipe, not a file"):
        write(Events(0, 1000), pipe, "nothing")
