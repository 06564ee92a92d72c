#!/bin/sh
# What `python -m dev.vm` and `make test-vm` need, on Debian: QEMU, busybox, can-utils, ip, and Debian's kernel.
# The kernel is only downloaded and unpacked, into ${XDG_CACHE_HOME:-~/.cache}/ranger-sim/kernel: this machine goes on
# starting with its own. The cloud kernels are no use here, they have no CAN. May be run again at any time.
set -eu
programs="qemu-system-x86 busybox-static can-utils iproute2"
kernel=linux-image-amd64
folder="${XDG_CACHE_HOME:-$HOME/.cache}/ranger-sim/kernel"

if ! command -v apt-get >/dev/null; then
  echo "No apt-get here. Install what Debian calls: $programs." >&2
  echo "Unpack Debian's kernel (package $kernel) and let RANGER_SIM_VM_KERNEL name that folder." >&2
  exit 1
fi
as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"
  elif command -v sudo >/dev/null; then sudo "$@"
  else echo "Run this as root, or install sudo: $*" >&2; exit 1
  fi
}
as_root apt-get update -qq
as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $programs >/dev/null

package=$(apt-cache depends "$kernel" | sed -n 's/^ *Depends: *\(linux-image-[0-9]\)/\1/p' | head -n 1)
if [ -z "$package" ]; then
  echo "apt knows no $kernel: the virtual machine needs Debian's kernel. Unpack one and let RANGER_SIM_VM_KERNEL name" >&2
  echo "that folder (it holds boot/vmlinuz-VERSION and lib/modules/VERSION)." >&2
  exit 1
fi
version=${package#linux-image-}
if [ ! -d "$folder/lib/modules/$version" ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  (cd "$work" && apt-get download -qq "$package" 2>/dev/null)
  mkdir "$work/kernel"
  # of 400 MB the parts that the virtual machine may load: 90 MB
  (cd "$work" && dpkg-deb --fsys-tarfile ./*.deb | tar -x -C kernel --wildcards \
    './boot/vmlinuz-*' './lib/modules/*/kernel/net/*' './lib/modules/*/kernel/fs/*' './lib/modules/*/kernel/lib/*' \
    './lib/modules/*/kernel/drivers/virtio/*' './lib/modules/*/kernel/drivers/char/*' \
    './lib/modules/*/kernel/drivers/net/can/*')
  mkdir -p "$(dirname "$folder")"
  rm -rf "$folder"
  mv "$work/kernel" "$folder"
fi
echo "ready: $(qemu-system-x86_64 --version | head -n 1); kernel $version in $folder"
