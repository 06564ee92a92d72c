"""`make test-vm`: the tests on real SocketCAN, on this machine's vcan where it has one, else in a virtual machine.

Two runs of pytest: one on this machine, one in the virtual machine (`python -m dev.vm`). Nothing is skipped: what
cannot run fails and says why. All of it ends within the time limit.
"""

import os
import pathlib
import shutil
import subprocess
import sys

from ranger_sim.foundation import wallclock
from tests.vm import places

ROOT = pathlib.Path(__file__).resolve().parents[2]
TIME_LIMIT_S = 900.0  # of everything; what makes a merge wait longer is not run
INSTALL = "dev/vm/install-packages.sh"


def pytest_call(*selection: str) -> list[str]:
    """One run of pytest; every skip with its reason, nothing written into the tree."""
    return [
        sys.executable,
        "-m",
        "pytest",
        "tests/vm",
        "-v",
        "-rs",
        "--durations=5",
        "-p",
        "no:cacheprovider",
        *selection,
    ]


def main() -> int:
    """Both runs; the first code that is not 0."""
    started = wallclock.monotonic_s()
    os.chdir(ROOT)
    missing = [name for name in ("qemu-system-x86_64", "candump", "ip") if shutil.which(name) is None]
    if missing:
        print(f"make test-vm: {', '.join(missing)} not installed; run {INSTALL}", file=sys.stderr)
        return 2
    why_not = places.why_no_vcan_here()
    if why_not:
        print(f"{why_not}: SocketCAN is tested in a virtual machine", flush=True)
        here, inside = "machine", "not machine"
    else:
        print("SocketCAN is tested on this machine's vcan0 ... vcan3, adapters in a virtual machine", flush=True)
        here, inside = "not adapters", "adapters"
    codes = [
        subprocess.run(pytest_call("-m", here), env={**os.environ, places.PLACE: "host"}).returncode,
        subprocess.run(
            [
                *(sys.executable, "-m", "dev.vm"),
                *("--time-limit", f"{TIME_LIMIT_S - (wallclock.monotonic_s() - started):.0f}s", "--"),
                *pytest_call("-m", inside),
            ],
            env={**os.environ, places.PLACE: "guest"},
        ).returncode,
    ]
    print(f"make test-vm took {wallclock.monotonic_s() - started:.0f} s of {TIME_LIMIT_S:.0f} s", flush=True)
    return next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
