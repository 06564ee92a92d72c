"""The virtual machine as a child process: it passes on its command's output, and ends with its parent at the latest."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import os
import pathlib
import re
import secrets
import selectors
import shutil
import signal
import socket
import subprocess
from collections.abc import Callable, Mapping, Sequence

from dev.vm import kernel, ramdisk
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError

QEMU = "qemu-system-x86_64"
BUSYBOX_PLACES = ("/bin/busybox", "/usr/bin/busybox", "/usr/lib/busybox/bin/busybox-static")
CONSOLE = "console"
CONSOLE_LINES = 12  # the last ones, shown when the machine did not start
SET_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG, prctl(2)
C_LIBRARY = ctypes.CDLL(None, use_errno=True)

EXIT_TIME_LIMIT = 124  # as for the command `timeout`
# Software emulation: it works everywhere, even where /dev/kvm exists and hangs. 256 MiB of translated code.
ACCELERATOR = "tcg,thread=multi,tb-size=256"


@dataclasses.dataclass(frozen=True)
class Guest:
    """Parts of the machine. shared: folders of the host that the guest may write to."""

    memory_MiB: int = 2048  # chosen by us, because a pytest of the robot fits four times
    # One: waking a second one under emulation takes milliseconds on a busy host (a message between two processes and
    # back took 7 ms with two processors, 0.2 ms with one).
    processors: int = 1
    time_limit_s: float = 600.0
    shared: tuple[pathlib.Path, ...] = ()
    accelerator: str = ACCELERATOR
    shows_console: bool = False


@dataclasses.dataclass(frozen=True)
class Ended:
    """How a run ended: exit code of the command, s until it began (None: it never did), s until it ended."""

    code: int
    boot_s: float | None
    total_s: float


Write = Callable[[int, bytes], None]


def run(
    command: Sequence[str], environment: Mapping[str, str], folder: pathlib.Path, guest: Guest, write: Write
) -> Ended:
    """Run `command` in the guest, in `folder`, with only `environment`.

    `write(1, data)` receives the command's standard output, `write(2, data)` its standard error (and the guest's
    console, if requested). UserError if a file is missing here, or the machine stopped by itself.
    """
    qemu = shutil.which(QEMU)
    if qemu is None:
        raise UserError(f"vm: {QEMU} is not installed; run {kernel.INSTALL_SCRIPT}")
    busybox = static_busybox()
    image = kernel.find()
    end = secrets.token_hex(16)
    tags = {f"shared{number}": str(path) for number, path in enumerate(guest.shared)}
    init = ramdisk.init_script(end, tags)
    disk = ramdisk.build(
        busybox,
        image.modules,
        init,
        ramdisk.command_script(command, str(folder), {"RANGER_SIM_VM": "1", **environment}),
    )
    with contextlib.ExitStack() as stack:
        memory = os.memfd_create("ranger-sim-vm")
        stack.callback(os.close, memory)
        with open(memory, "wb", closefd=False) as file:
            file.write(disk)
        ours, theirs = {}, {}
        for name in (ramdisk.CONTROL, ramdisk.OUTPUT, ramdisk.ERRORS, CONSOLE):
            ours[name], theirs[name] = (stack.enter_context(each) for each in socket.socketpair())
        numbers = {name: each.fileno() for name, each in theirs.items()}
        started = wallclock.monotonic_s()
        process = subprocess.Popen(
            [qemu, *arguments(guest, image.image, memory, tags, numbers)],
            stdin=subprocess.DEVNULL,
            stdout=numbers[CONSOLE],
            stderr=numbers[CONSOLE],
            pass_fds=[memory, *numbers.values()],
            start_new_session=True,  # this process handles Ctrl-C
            preexec_fn=die_with_parent,
        )
        stack.callback(stop, process)
        for each in theirs.values():
            each.close()
        return Attendant(ours, end.encode(), guest, started, write).attend()


def die_with_parent() -> None:
    """In the child: the kernel ends it when the process that started it ends, for any reason."""
    C_LIBRARY.prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)


def stop(process: subprocess.Popen[bytes]) -> None:
    """Kill the machine: everything of the guest is in its memory, so nothing is left behind."""
    process.kill()
    process.wait()


def static_busybox() -> pathlib.Path:
    """A busybox that needs no libraries; UserError if not found."""
    for place in BUSYBOX_PLACES:
        path = pathlib.Path(place)
        if path.exists() and b"ld-linux" not in path.read_bytes()[:4096]:  # a dynamic one names its loader early
            return path
    raise UserError(f"vm: no busybox without libraries (Debian: busybox-static); run {kernel.INSTALL_SCRIPT}")


def arguments(
    guest: Guest, image: pathlib.Path, disk: int, tags: Mapping[str, str], ports: Mapping[str, int]
) -> list[str]:
    """QEMU's command line. `disk`: file descriptor of the RAM disk; `ports`: {name: file descriptor of a socket}."""
    line = [
        *("-machine", "q35", "-cpu", "max", "-accel", guest.accelerator),
        *("-m", str(guest.memory_MiB), "-smp", str(guest.processors)),
        *("-nodefaults", "-no-user-config", "-display", "none", "-nic", "none", "-no-reboot"),
        *("-kernel", str(image), "-initrd", f"/proc/self/fd/{disk}"),
        *("-append", "console=ttyS0 quiet panic=-1 mitigations=off audit=0 random.trust_cpu=on"),
        *("-chardev", f"socket,id={CONSOLE},fd={ports[CONSOLE]}", "-serial", f"chardev:{CONSOLE}"),
        *("-device", "virtio-rng-pci", "-device", "virtio-serial-pci"),
        *("-object", "can-bus,id=wire", "-device", "kvaser_pci,canbus=wire", "-device", "kvaser_pci,canbus=wire"),
        *("-virtfs", "local,path=/,mount_tag=root,security_model=none,readonly=on,multidevs=remap"),
    ]
    for name in (ramdisk.CONTROL, ramdisk.OUTPUT, ramdisk.ERRORS):
        line += [
            "-chardev",
            f"socket,id={name},fd={ports[name]}",
            "-device",
            f"virtserialport,chardev={name},name={name}",
        ]
    for tag, folder in tags.items():
        path = folder.replace(",", ",,")
        line += ["-virtfs", f"local,path={path},mount_tag={tag},security_model=none,multidevs=remap"]
    return line


class Attendant:
    """Reads the machine's output until its command is over, it stops, or the time is up."""

    def __init__(
        self, sockets: Mapping[str, socket.socket], end: bytes, guest: Guest, started_s: float, write: Write
    ) -> None:
        self.end = end
        self.guest = guest
        self.started_s = started_s
        self.write = write
        self.boot_s: float | None = None
        self.code: int | None = None
        self.received = dict.fromkeys(sockets, b"")  # of each port, data not yet processed
        self.open = {ramdisk.OUTPUT: 1, ramdisk.ERRORS: 2}
        self.selector = selectors.DefaultSelector()
        for name, each in sockets.items():
            self.selector.register(each, selectors.EVENT_READ, name)

    def seconds(self) -> float:
        """Seconds since the machine was started."""
        return wallclock.monotonic_s() - self.started_s

    def attend(self) -> Ended:
        """Read until the exit code and the ends of both streams have arrived; UserError if the machine stops before."""
        with self.selector:
            while self.code is None or self.open:
                left = self.guest.time_limit_s - self.seconds()
                if left <= 0:
                    for name in list(self.open):
                        self.pass_on(name, everything=True)
                    return Ended(EXIT_TIME_LIMIT, self.boot_s, self.seconds())
                for key, _ in self.selector.select(left):
                    data = os.read(key.fd, 65536)
                    if data:
                        self.take(key.data, data)
                    else:
                        self.selector.unregister(key.fileobj)
                if not self.selector.get_map():
                    raise UserError(
                        "vm: the machine stopped by itself; its last output:", *self.last_words().splitlines()
                    )
        return Ended(self.code, self.boot_s, self.seconds())

    def take(self, name: str, data: bytes) -> None:
        """Process data of one port."""
        self.received[name] += data
        if name in self.open:
            self.pass_on(name)
        elif name == ramdisk.CONTROL:
            *lines, self.received[name] = self.received[name].split(b"\n")
            for line in lines:
                word, _, number = line.decode(errors="replace").partition(" ")
                if word == "ready":
                    self.boot_s = self.seconds()
                elif word == "exit":
                    self.code = int(number)
        elif name == CONSOLE:
            if self.guest.shows_console:
                self.write(2, data)
            self.received[name] = self.received[name][-8192:]

    def pass_on(self, name: str, everything: bool = False) -> None:
        """Write the data that cannot be part of the end mark."""
        waiting = self.received[name]
        number = self.open[name]
        if waiting.endswith(self.end):
            waiting, kept = waiting[: -len(self.end)], b""
            del self.open[name]
        else:
            keep = 0 if everything else overlap(waiting, self.end)
            waiting, kept = waiting[: len(waiting) - keep], waiting[len(waiting) - keep :]
        self.received[name] = kept
        if waiting:
            self.write(number, waiting)

    def last_words(self) -> str:
        """The end of the guest's console, without its control codes."""
        text = self.received[CONSOLE].decode(errors="replace").replace("\r", "")
        text = re.sub(r"\x1b\[[0-9;?=]*[A-Za-z]|\x1bc", "", text)
        return "\n".join([line for line in text.splitlines() if line.strip()][-CONSOLE_LINES:]) or "(none)"


def overlap(data: bytes, mark: bytes) -> int:
    """How many bytes at the end of `data` may be the beginning of `mark`."""
    for length in range(min(len(data), len(mark)), 0, -1):
        if data.endswith(mark[:length]):
            return length
    return 0
