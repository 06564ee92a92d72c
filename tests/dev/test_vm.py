"""The virtual machine's parts that need no virtual machine. What boots one is in tests/vm."""

import contextlib
import lzma
import os
import pathlib
import select
import shutil
import signal
import socket
import subprocess
import sys

import pytest

from dev.vm import command, kernel, machine, ramdisk
from ranger_sim.foundation.user_error import UserError

END = b"0123456789abcdef"


def module(*needed):
    """A module file as far as we read it: the entry of its .modinfo section."""
    return b"\x7fELF....\0license=GPL\0depends=" + ",".join(needed).encode() + b"\0name=x\0"


@pytest.fixture
def tree(tmp_path):
    """A folder as the install script leaves it, with modules that depend on each other as the real ones do."""
    folder = tmp_path / "kernel"
    needs = {
        "virtio_pci": ("virtio",),
        "virtio": (),
        "9pnet_virtio": ("9pnet", "virtio"),
        "9pnet": (),
        "9p": ("9pnet",),
        "can-raw": ("can",),
        "can": (),
        "vcan": ("can-dev",),
        "can-dev": (),
        "kvaser_pci": ("sja1000", "can-dev"),
        "sja1000": ("can-dev",),
    }
    modules = folder / "lib/modules/6.1.0-9-amd64/kernel/net"
    modules.mkdir(parents=True)
    for name, depends in needs.items():
        (modules / f"{name}.ko").write_bytes(module(*depends))
    (folder / "boot").mkdir()
    (folder / "boot/vmlinuz-6.1.0-9-amd64").write_bytes(b"kernel")
    return folder


def test_modules_are_loaded_after_what_they_need(tree, monkeypatch):
    monkeypatch.setenv(kernel.FOLDER_VARIABLE, str(tree))
    found = kernel.find()
    assert found.version == "6.1.0-9-amd64" and found.image.read_bytes() == b"kernel"
    assert [name for name, _ in found.modules] == [
        *("virtio.ko", "virtio_pci.ko", "9pnet.ko", "9pnet_virtio.ko", "9p.ko", "can.ko", "can_raw.ko", "can_dev.ko"),
        *("vcan.ko", "sja1000.ko", "kvaser_pci.ko"),
    ]


def test_compressed_modules_are_unpacked(tree, monkeypatch):
    monkeypatch.setenv(kernel.FOLDER_VARIABLE, str(tree))
    plain = tree / "lib/modules/6.1.0-9-amd64/kernel/net/vcan.ko"
    (plain.parent / "vcan.ko.xz").write_bytes(lzma.compress(plain.read_bytes()))
    plain.unlink()
    assert dict(kernel.find().modules)["vcan.ko"] == module("can-dev")


def test_the_newest_kernel_that_is_whole_is_taken(tree, monkeypatch):
    monkeypatch.setenv(kernel.FOLDER_VARIABLE, str(tree))
    for version in ("6.1.0-10-amd64", "6.1.0-11-amd64"):
        shutil.copytree(tree / "lib/modules/6.1.0-9-amd64", tree / "lib/modules" / version)
        (tree / f"boot/vmlinuz-{version}").write_bytes(b"newer")
    (tree / "lib/modules/6.1.0-11-amd64/kernel/net/vcan.ko").unlink()
    assert kernel.find().version == "6.1.0-10-amd64"


def test_a_kernel_without_can_is_refused_with_what_it_lacks_and_what_to_run(tree, monkeypatch):
    monkeypatch.setenv(kernel.FOLDER_VARIABLE, str(tree))
    (tree / "lib/modules/6.1.0-9-amd64/kernel/net/kvaser_pci.ko").unlink()
    with pytest.raises(UserError, match=r"6\.1\.0-9-amd64 has no module kvaser_pci.*; run .*install-packages\.sh$"):
        kernel.find()
    monkeypatch.setenv(kernel.FOLDER_VARIABLE, str(tree / "boot"))
    with pytest.raises(UserError, match="boot has no lib/modules"):
        kernel.find()


def test_the_install_script_is_there_and_is_a_shell_script():
    assert os.access(kernel.INSTALL_SCRIPT, os.X_OK)
    assert subprocess.run(["sh", "-n", kernel.INSTALL_SCRIPT]).returncode == 0


def test_the_archive_is_what_the_kernel_unpacks():
    archive = ramdisk.Archive()
    archive.add("a", 0o100644, b"hello")
    content = archive.bytes()
    # magic, thirteen fields of eight hexadecimal digits, the name, padding to four bytes
    assert content[:110] == (
        b"070701"
        b"00000001"
        b"000081A4"
        b"00000000"
        b"00000000"
        b"00000001"
        b"00000000"
        b"00000005"
        b"00000000"
        b"00000000"
        b"00000000"
        b"00000000"
        b"00000002"
        b"00000000"
    )
    assert content[110:120] == b"a\0hello\0\0\0"
    assert content[120:126] == b"070701" and content.endswith(b"TRAILER!!!\0\0\0\0")
    assert len(content) % 4 == 0


@pytest.mark.skipif(shutil.which("cpio") is None, reason="no cpio here to read the archive with")
def test_cpio_reads_the_archive(tmp_path):
    content = ramdisk.build(pathlib.Path("/bin/sh"), (("vcan.ko", b"module"),), "#!/bin/sh\n", "true")
    subprocess.run(["cpio", "-idm", "--quiet"], cwd=tmp_path, input=content, check=True)
    assert (tmp_path / "modules/vcan.ko").read_bytes() == b"module"
    assert (tmp_path / "modules/order").read_text() == "vcan.ko"
    assert os.readlink(tmp_path / "bin/mount") == "busybox"
    assert (tmp_path / "init").stat().st_mode & 0o777 == 0o755


def test_the_command_keeps_its_words_folder_and_environment(tmp_path):
    folder = tmp_path / "a folder"
    folder.mkdir()
    command = [
        "python3",
        "-c",
        "import os, sys; print(sys.argv[1:], os.getcwd(), os.environ['A B'])",
        "it's",
        "$HOME",
        "",
    ]
    script = ramdisk.command_script(command, str(folder), {"PATH": os.environ["PATH"], "A B": "x\ny'z"})
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == f"[\"it's\", '$HOME', ''] {folder} x\ny'z\n"


@pytest.fixture
def attendant(monkeypatch):
    """attendant(write, guest) -> an Attendant and the other ends of its sockets by name; the clock is at 1 s."""
    monkeypatch.setattr(machine.wallclock, "monotonic_s", lambda: 1.0)
    with contextlib.ExitStack() as stack:

        def make(write, guest=machine.Guest()):  # noqa: B008  (frozen)
            ours, theirs = {}, {}
            for name in (ramdisk.CONTROL, ramdisk.OUTPUT, ramdisk.ERRORS, machine.CONSOLE):
                ours[name], theirs[name] = (stack.enter_context(each) for each in socket.socketpair())
            return machine.Attendant(ours, END, guest, 0.0, write), theirs

        yield make


def test_what_the_guest_writes_comes_out_unchanged_and_the_code_is_the_commands(attendant):
    written = {1: b"", 2: b""}

    def write(number, data):
        written[number] += data

    watcher, guest = attendant(write)
    guest["control"].send(b"rea")
    guest["control"].send(b"dy\nexit 7\n")
    guest["output"].send(b"\x00\r\n" + END[:5])  # looks like the end mark and is not
    guest["output"].send(b"no" + END)
    guest["errors"].send(END)
    ended = watcher.attend()
    assert (ended.code, ended.boot_s) == (7, 1.0)
    assert written == {1: b"\x00\r\n" + END[:5] + b"no", 2: b""}


def test_a_machine_that_stops_by_itself_leaves_its_last_words(attendant):
    watcher, guest = attendant(lambda number, data: None)
    guest["console"].send(b"\x1b[2Jbooting\r\nKernel panic - not syncing\r\n")
    for each in guest.values():
        each.close()
    with pytest.raises(UserError, match="its last output:\nbooting\nKernel panic - not syncing$"):
        watcher.attend()


def test_at_the_time_limit_what_was_held_back_is_written(attendant, monkeypatch):
    written = []
    clock = iter([0.0, 11.0, 11.0])
    watcher, guest = attendant(lambda number, data: written.append(data), machine.Guest(time_limit_s=10.0))
    monkeypatch.setattr(machine.wallclock, "monotonic_s", lambda: next(clock))
    guest["output"].send(b"half" + END[:3])
    ended = watcher.attend()
    assert (ended.code, ended.boot_s) == (124, None)
    assert b"".join(written) == b"half" + END[:3]


def test_without_qemu_the_command_to_run_is_printed(capfd, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    assert command.main(["--", "true"]) == 2
    reported = capfd.readouterr().err
    assert "qemu-system-x86_64 is not installed; run " in reported and "install-packages.sh" in reported
    assert reported.count("\n") == 1


def test_options_that_cannot_be_are_refused(capfd, tmp_path):
    assert command.main(["--shared", str(tmp_path / "none"), "--", "true"]) == 2
    assert "not a folder" in capfd.readouterr().err
    with pytest.raises(SystemExit):
        command.main([])
    assert "COMMAND" in capfd.readouterr().err


def test_the_child_asks_to_die_with_its_parent():
    """The runner is killed hard; what it had started is gone."""
    runner = subprocess.Popen(
        [
            *("python3", "-c"),
            "import subprocess, sys\n"
            "from dev.vm.machine import die_with_parent\n"
            "child = subprocess.Popen(['sleep', '100'], preexec_fn=die_with_parent)\n"
            "print(child.pid, flush=True)\n"
            "child.wait()\n",
        ],
        executable=sys.executable,
        cwd=pathlib.Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
    )
    child = int(runner.stdout.readline())
    with open(f"/proc/{child}/stat") as file:
        assert "sleep" in file.read()
    watch = os.pidfd_open(child)
    runner.send_signal(signal.SIGKILL)
    runner.communicate()
    assert select.select([watch], [], [], 30)[0], "still alive"
    os.close(watch)


def test_a_folder_of_shared_files_is_mounted_where_it_is():
    script = ramdisk.init_script("end", {"shared0": "/tmp/a b"})
    assert "shared0 /merged'/tmp/a b'" in script
    assert "@FOLDERS@" not in script


def test_qemu_gets_two_adapters_on_one_wire(tmp_path):
    line = machine.arguments(
        machine.Guest(), tmp_path / "vmlinuz", 9, {}, dict.fromkeys(("control", "output", "errors", "console"), 5)
    )
    assert line.count("kvaser_pci,canbus=wire") == 2 and "can-bus,id=wire" in line
    assert "readonly=on" in line[line.index("-virtfs") + 1]
    assert "-no-reboot" in line
