"""The pictures of the panel's page, one of each view: python -m studies.pictures.panel (needs Chromium; a minute).

A robot walks in real time meanwhile, so two runs of this give two pictures of the same. The view Link is of its data
link, with drop-outs, and the view Twins of a recorded walk with a weak hip spring.
"""

import base64
import contextlib
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

from tests import browser

DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"
WIDTH, HEIGHT = 1400, 940
SECONDS = 12.0
OF_A_ROBOT = {
    "plots": "panel.png",
    "parameters": "panel-parameters.png",
    "errors": "panel-errors.png",
    "inside": "panel-inside.png",
    "faults": "panel-faults.png",
}
OF_A_LINK = {"link": "panel-link.png"}
OF_A_WALK = {"twins": "panel-twins.png"}
WEAK = (
    'base = "ranger"\n[parameters]\nhip_spring_Nm_per_rad = 6.46\n[sources]\nhip_spring_Nm_per_rad = "for a picture"\n'
)
OPENED = (
    "for (const group of document.querySelectorAll('#parameter-groups details'))"
    " group.open = group.innerText.startsWith('P_H ')"
)
ARMED = (
    "{ const f = document.getElementById('fault-place'); f.value = 'MCH.joint_encoder'; f.onchange();"
    " const m = document.getElementById('fault-mode'); m.value = 'stuck'; m.onchange();"
    " document.getElementById('fault-end').value = '+4 ms';"
    " document.getElementById('fault-form').requestSubmit(); 0 }"
)


@contextlib.contextmanager
def started(*arguments):
    """A command of ours, until it is no longer needed."""
    process = subprocess.Popen([sys.executable, "-m", "ranger_sim", *arguments], stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def said(process, pattern):
    """The first of what it says that is like this."""
    return next(found[0] for line in process.stderr if (found := re.search(pattern, line)))


def picture_views(views, *arguments):
    """Of each view of a panel a picture, once it has shown SECONDS of the robot."""
    with (
        started("panel", *arguments, "--http-port", "0") as panel,
        tempfile.TemporaryDirectory() as folder,
        browser.opened(folder) as page,
    ):
        page.open(said(panel, r"http://\S+"), WIDTH, HEIGHT, 1)
        page.until("document.body?.dataset.connected === 'yes'")
        page.until(f"window.rangerPanel?.span()[1] > {SECONDS}")
        for view, name in views.items():
            page.value(f"document.querySelector('[data-view={view}]').click()")
            if view == "parameters":
                page.value(OPENED)
            if view == "faults":
                page.value(ARMED)
                page.until("window.rangerPanel.state().faults?.[0]?.cleared_s")
            if view == "twins":
                page.value("document.querySelector('#twins-walks button').click()")
                page.until("!document.getElementById('twins-answer').hidden")
            else:
                pictures = page.value("window.rangerPanel.shown()")
                page.until(f"window.rangerPanel.shown() > {pictures} + 8")
            picture = page.call("Page.captureScreenshot", format="png")["data"]
            (DOCS / name).write_bytes(base64.b64decode(picture))
            print(DOCS / name)


def main():
    picture_views(OF_A_ROBOT, "--walk")
    with started("up", "--daq-port", "pty", "--daq-dropouts") as robot:
        picture_views(OF_A_LINK, "--port", said(robot, r"/dev/pts/\d+"))
    with tempfile.TemporaryDirectory() as folder:
        body, walk = pathlib.Path(folder) / "weak.toml", pathlib.Path(folder) / "walk"
        body.write_text(WEAK)
        command = ["walk", "--steps", "48", "--seed", "71", "--battery", "80%", "--log", "full", "--body", str(body)]
        subprocess.run([sys.executable, "-m", "ranger_sim", *command, "--out", str(walk)], check=True)
        picture_views(OF_A_WALK, str(walk))


if __name__ == "__main__":
    main()
