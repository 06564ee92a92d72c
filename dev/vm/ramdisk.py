"""The guest's initial RAM disk: busybox, the modules, and a script that becomes the guest's first process."""

from __future__ import annotations

import pathlib
import shlex
import stat
from collections.abc import Mapping, Sequence

CONTROL, OUTPUT, ERRORS = "control", "output", "errors"  # names of the ports to the host
# The programs of busybox that the script below uses.
APPLETS = ("cat", "chroot", "echo", "insmod", "ln", "mkdir", "mkfifo", "mount", "printf", "sh", "unshare")

# The host's root, read-only, under a layer of memory: the command sees the host's files and may write anywhere.
# The command has a separate process namespace, so that no process it leaves behind keeps the pipes open.
INIT = r"""#!/bin/sh
export PATH=/bin
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs devtmpfs /dev
for module in $(cat /modules/order); do insmod /modules/$module || echo "cannot load $module"; done
for port in /sys/class/virtio-ports/*; do
  ln -s /dev/${port##*/} /ports/$(cat $port/name)
done
exec 9>/ports/control
mount -t 9p -o trans=virtio,version=9p2000.L,cache=loose,msize=512000,ro root /lower || exit
mount -t tmpfs -o size=75% tmpfs /upper
mkdir /upper/data /upper/work
mount -t overlay -o lowerdir=/lower,upperdir=/upper/data,workdir=/upper/work overlay /merged || exit
@FOLDERS@
mount -t sysfs sysfs /merged/sys
mount -t devtmpfs devtmpfs /merged/dev
mkdir -p /merged/dev/pts /merged/dev/shm
mount -t devpts -o ptmxmode=666 devpts /merged/dev/pts
mount -t tmpfs tmpfs /merged/dev/shm
mount -t tmpfs tmpfs /merged/run
ln -sf /proc/self/fd /merged/dev/fd
ln -sf /proc/self/fd/0 /merged/dev/stdin
ln -sf /proc/self/fd/1 /merged/dev/stdout
ln -sf /proc/self/fd/2 /merged/dev/stderr
cat /command >/merged/run/ranger-sim-vm
mkfifo /output /errors
(cat /output; printf %s "$END") >/ports/output &
(cat /errors; printf %s "$END") >/ports/errors &
(
  exec 9>&-
  chroot /merged /bin/sh -c '
    export PATH=/usr/sbin:/usr/bin:/sbin:/bin
    ip link set lo up
    for i in 0 1 2 3; do ip link add vcan$i type vcan && ip link set vcan$i up; done'
) || echo "cannot make vcan0 ... vcan3"
echo ready >&9
unshare -p -f sh -c '
  mount -t proc proc /merged/proc
  chroot /merged /bin/sh /run/ranger-sim-vm
  exit $?' 9>&- >/output 2>/errors </dev/null
echo "exit $?" >&9
wait
while true; do cat /ports/control; done
"""


def init_script(end: str, shared: Mapping[str, str]) -> str:
    """The first process's script. `end`: closes both streams; `shared`: {tag: folder that the guest may write}."""
    folders = [
        f"mkdir -p /merged{shlex.quote(folder)} && mount -t 9p "
        f"-o trans=virtio,version=9p2000.L,msize=512000 {tag} /merged{shlex.quote(folder)} || exit"
        for tag, folder in shared.items()
    ]
    return INIT.replace("@FOLDERS@", "\n".join(folders)).replace("$END", end)


def command_script(command: Sequence[str], folder: str, environment: Mapping[str, str]) -> str:
    """The script inside the host's root: the command in `folder` with only `environment`."""
    lines = [f"cd {shlex.quote(folder)} || exit 126"]
    words = [f"{name}={value}" for name, value in sorted(environment.items())]
    lines.append(f"exec env -i {shlex.join(words)} {shlex.join(command)}")
    return "\n".join(lines) + "\n"


def build(busybox: pathlib.Path, modules: tuple[tuple[str, bytes], ...], init: str, command: str) -> bytes:
    """The archive that the kernel unpacks, uncompressed: under emulation unpacking costs more than reading."""
    archive = Archive()
    for folder in ("bin", "dev", "lower", "merged", "modules", "ports", "proc", "sys", "upper"):
        archive.add(folder, stat.S_IFDIR | 0o755)
    archive.add("bin/busybox", stat.S_IFREG | 0o755, busybox.read_bytes())
    for name in APPLETS:
        archive.add(f"bin/{name}", stat.S_IFLNK | 0o777, b"busybox")
    for name, content in modules:
        archive.add(f"modules/{name}", stat.S_IFREG | 0o644, content)
    archive.add("modules/order", stat.S_IFREG | 0o644, "\n".join(name for name, _ in modules).encode())
    archive.add("command", stat.S_IFREG | 0o600, command.encode())
    archive.add("init", stat.S_IFREG | 0o755, init.encode())
    return archive.bytes()


class Archive:
    """A cpio archive in the format `newc`: the kernel's documentation, driver-api/early-userspace/buffer-format."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.entries = 0

    def add(self, name: str, mode: int, content: bytes = b"") -> None:
        """Add a folder, a file or a symbolic link (content: where it points)."""
        self.entries += 1
        path = name.encode() + b"\0"
        # inode, mode, user, group, links, time, size, device, device of a node, length of the name, check sum
        fields = (self.entries, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(path), 0)
        head = b"070701" + b"".join(b"%08X" % field for field in fields) + path
        self.parts += [padded(head), padded(content)]

    def bytes(self) -> bytes:
        """The archive with its end entry."""
        self.add("TRAILER!!!", 0)
        return b"".join(self.parts)


def padded(part: bytes) -> bytes:
    """Pad with zeros to a multiple of four bytes."""
    return part + bytes(-len(part) % 4)
