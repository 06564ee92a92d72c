"""The pictures of the panel's page: python docs/panel_pictures.py (needs Chromium; a minute).

A robot walks in real time beside it, so two runs of this give two pictures of the same.
"""

import base64
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from tests import browser

HERE = pathlib.Path(__file__).parent
WIDTH, HEIGHT = 1400, 940
SECONDS = 12.0
VIEWS = {"plots": "panel.png", "inside": "panel-inside.png", "faults": "panel-faults.png"}
ARMED = (
    "{ const f = document.getElementById('fault-place'); f.value = 'MCH.joint_encoder'; f.onchange();"
    " document.getElementById('fault-mode').value = 'stuck'; document.getElementById('fault-end').value = '+4 ms';"
    " document.getElementById('fault-form').requestSubmit(); 0 }"
)


class Address:
    """Where a page is, as tests.browser takes it."""

    def __init__(self, text):
        self.text = text

    def as_uri(self):
        return self.text


def main():
    command = [sys.executable, "-m", "ranger_sim", "panel", "--walk", "--http-port", "0"]
    panel = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    address = next(found[0] for line in panel.stderr if (found := re.search(r"http://\S+", line)))
    try:
        with tempfile.TemporaryDirectory() as folder, browser.opened(folder) as page:
            page.open(Address(address), WIDTH, HEIGHT, 1)
            page.until("document.body?.dataset.connected === 'yes'")
            page.until(f"window.rangerPanel?.span()[1] > {SECONDS}")
            for view, name in VIEWS.items():
                page.value(f"document.querySelector('[data-view={view}]').click()")
                if view == "faults":
                    page.value(ARMED)
                    page.until("window.rangerPanel.state().faults?.[0]?.cleared_s")
                pictures = page.value("window.rangerPanel.shown()")
                page.until(f"window.rangerPanel.shown() > {pictures} + 8")
                picture = page.call("Page.captureScreenshot", format="png")["data"]
                (HERE / name).write_bytes(base64.b64decode(picture))
                print(HERE / name)
    finally:
        panel.send_signal(signal.SIGINT)
        panel.communicate()


if __name__ == "__main__":
    main()
