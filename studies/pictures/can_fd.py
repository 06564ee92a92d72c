"""The pictures of a CAN FD bus: python -m studies.pictures.can_fd (needs Chromium and a C compiler; half a minute).

A project of `ranger-sim new --fd` runs for two seconds. One picture is its recorded bus in the panel, by the DBC file
of its table, and one the page of its timeline. python-can's Logger writes the recording.
"""

import base64
import pathlib
import subprocess
import sys
import tempfile

from studies.pictures.panel import said, started
from tests import browser

DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"
SECONDS = 2.0
AT_S = 1.9485  # a frame of the wheel's state is then on the bus, and is here on the page
FRAME = (800, 315)
LATER = "document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', shiftKey: true, bubbles: true}))"
RUN = """
import contextlib, sys
import can
from ranger_sim.can_bus.edge.lockstep_bus import LockstepBus
from machine import new

with contextlib.closing(new(seed=3)) as machine, LockstepBus(machine) as bus, can.Logger(sys.argv[1]) as log:
    timeline = machine.timeline(last_s=0.1)
    for number in range(int(sys.argv[3])):
        if number % 5 == 0:
            bus.send(can.Message(arbitration_id=0x7F0, data=[number % 256, 1, 2], is_extended_id=False))
        if number % 7 == 0:
            bus.send(can.Message(arbitration_id=0x7F1, is_fd=True, data=bytes(range(12)), is_extended_id=False))
        end_ns = machine.loop.time + 20_000_000
        while (left_ns := end_ns - machine.loop.time) > 0:
            if (message := bus.recv(left_ns * 1e-9)) is not None:
                log(message)
    timeline.write(sys.argv[2])
"""


def run(folder, *command):
    """A command of ours, in a folder."""
    subprocess.run([sys.executable, *command], cwd=folder, check=True)


def screenshot(page, name):
    """Keep what a page shows."""
    picture = page.call("Page.captureScreenshot", format="png")["data"]
    (DOCS / name).write_bytes(base64.b64decode(picture))
    print(DOCS / name)


def main():
    with tempfile.TemporaryDirectory() as base, browser.opened(f"{base}/profile") as page:
        project = pathlib.Path(base) / "my-wheel"
        run(base, "-m", "ranger_sim", "new", "my-wheel", "--fd")
        run(project, "-c", RUN, f"{base}/can1.blf", f"{base}/run.pftrace", str(round(SECONDS / 0.02)))
        (database,) = project.rglob("*.dbc")
        recording = ("panel", f"{base}/can1.blf", "--dbc", str(database), "--http-port", "0")
        with started(*recording) as panel:
            page.open(said(panel, r"http://\S+"), 1400, 760, 1)
            page.until("document.body?.dataset.connected === 'yes'")
            page.value("document.querySelector('[data-view=inside]').click()")
            for _ in range(15):  # the cursor of a recording begins at its start: to 1.5 s
                page.value(LATER)
            page.until("document.querySelectorAll('#frames tbody tr').length > 20")
            screenshot(page, "panel-can-fd.png")
        opened = ("trace", "open", "run.pftrace", "--offline", "--no-browser", "--at", f"{AT_S:g}s", "--shown", "2ms")
        run(base, "-m", "ranger_sim", *opened)
        page.open(pathlib.Path(base, "run.html"), 1400, 560, 1)
        page.until("document.querySelector('canvas')")
        for kind in ("mousePressed", "mouseReleased"):
            page.call("Input.dispatchMouseEvent", type=kind, x=FRAME[0], y=FRAME[1], button="left", clickCount=1)
        screenshot(page, "machine-timeline.png")


if __name__ == "__main__":
    main()
