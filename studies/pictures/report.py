"""The picture of a walk's report, as README.md shows it: python -m studies.pictures.report (needs Chromium)."""

import base64
import pathlib
import subprocess
import sys
import tempfile

from tests import browser

PICTURE = pathlib.Path(__file__).resolve().parents[2] / "docs" / "report.png"
WIDTH, HEIGHT, RATIO = 1110, 1990, 0.8  # down to the first chart over time
CURSOR_S = 56.9  # early in a step, both legs apart


def main():
    with tempfile.TemporaryDirectory() as folder, browser.opened(f"{folder}/profile") as page:
        walk = [sys.executable, "-m", "ranger_sim", "walk", "--steps", "100", "--out", f"{folder}/walk"]
        subprocess.run(walk, check=True, stdout=subprocess.DEVNULL)
        page.open(pathlib.Path(folder, "walk", "report.html"), WIDTH, HEIGHT, RATIO)
        page.call("Emulation.setScrollbarsHidden", hidden=True)
        page.until(f"window.rangerReport && document.documentElement.dataset.drawn == {WIDTH}")
        page.value(f"rangerReport.setRunning(false); rangerReport.setCursor({CURSOR_S})")
        picture = page.call("Page.captureScreenshot", format="png")["data"]
    PICTURE.write_bytes(base64.b64decode(picture))
    print(PICTURE)


if __name__ == "__main__":
    main()
