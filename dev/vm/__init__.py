"""`python -m dev.vm`: a small virtual machine with SocketCAN, for hosts whose kernel has none.

Debian's kernel under QEMU's software emulation, the host's own root directory inside it (nothing is installed or
copied), vcan0 ... vcan3 up, and two Kvaser PCI adapters on one bus as can0 and can1.
"""
