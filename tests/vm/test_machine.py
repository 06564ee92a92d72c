"""The virtual machine itself, seen from the host that starts it."""

import os
import pathlib
import select
import signal
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VM = [sys.executable, "-m", "dev.vm"]
pytestmark = pytest.mark.machine


def vm(*arguments, **options):
    return subprocess.run([*VM, *map(str, arguments)], cwd=ROOT, capture_output=True, timeout=300, **options)


def test_a_command_runs_among_our_files_with_four_vcans_and_two_adapters(tmp_path, figure):
    shared = tmp_path / "a shared folder"
    shared.mkdir()
    program = (
        'cat README.md; cat "$1"/in >&2; echo written >"$1"/out; echo lost >>README.md;'
        "ls /sys/class/net | tr '\\n' ' ' >\"$1\"/interfaces; (sleep 1000 &) ; exit 7"
    )
    (shared / "in").write_bytes(b"\x00\xff\r\n")
    done = vm("--shared", shared, "--", "sh", "-c", program, "sh", shared)
    assert done.returncode == 7, done.stderr
    assert done.stdout == (ROOT / "README.md").read_bytes()  # unchanged, neither by the way nor by the command
    assert done.stderr == b"\x00\xff\r\n"
    assert (shared / "out").read_text() == "written\n"
    assert (shared / "interfaces").read_text().split() == ["can0", "can1", "lo", "vcan0", "vcan1", "vcan2", "vcan3"]


def children(process):
    return [int(each) for each in pathlib.Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def test_at_the_time_limit_the_machine_is_switched_off():
    done = vm("--time-limit", "30s", "--", "sh", "-c", "echo begun; sleep 1000")
    assert done.returncode == 124
    assert done.stdout == b"begun\n"
    assert b"the command had not ended after 30 s (--time-limit); switched off" in done.stderr


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_nothing_is_left_when_the_runner_is_ended(number, code):
    runner = subprocess.Popen(
        [*VM, "--", "sh", "-c", "echo begun; sleep 1000"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert runner.stdout.readline() == b"begun\n"
    (qemu,) = children(runner.pid)
    watch = os.pidfd_open(qemu)
    runner.send_signal(number)
    runner.communicate(timeout=60)
    assert runner.returncode == code
    assert select.select([watch], [], [], 30)[0], "the virtual machine lives on"
    os.close(watch)
