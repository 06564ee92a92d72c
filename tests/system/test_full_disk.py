"""Commands whose disk is full: a line with the file and the cause, code 2, no half-written file under a finished name.

The disk is a small file system in memory that only the command sees.
"""

import json
import pathlib
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]
HIP = ROOT / "examples" / "hip_in_c"
MOUNT = 'mount -t tmpfs -o size="$1" none "$2" && cd "$2" && shift 2 && "$@"; code=$?; cp -r . "$KEPT"; exit $code'


def can_mount():
    try:
        return subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


pytestmark = pytest.mark.skipif(not can_mount(), reason="no right to mount a file system here")

# words, size of the disk, what the last line reports
COMMANDS = {
    "walk's folder": (["walk", "--time", "1s", "--out", "out"], "64k", "out/report.partial.html"),
    "a walk's logs": (["walk", "--time", "1s", "--log", "full", "--out", "out"], "400k", "out/report.partial.html"),
    "a walk's summary": (["walk", "--time", "10ms", "--json", "s.json"], "4k", "s.json"),
    "a timeline": (["walk", "--time", "1s", "--trace", "a.pftrace", "--json", "-"], "64k", "rows of the timeline"),
    "slots": (["slots", "MCH", "--json", "s.json"], "4k", "s.json"),
    "a project": (["new", "my"], "16k", "my"),
    "a firmware's program": (["firmware", "build", "PROGRAM"], "64k", ""),
    "a body as FMU": (["fmu", "body.fmu"], "16k", ""),
}
WHOLE = {".json": b"}", ".html": b"</html>", ".log": b"\n"}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk_is_reported_and_leaves_no_half_written_file(name, tmp_path):
    words, size, place = COMMANDS[name]
    disk, kept = tmp_path / "disk", tmp_path / "kept"
    disk.mkdir()
    if "PROGRAM" in words:  # in the tree it may be built already
        program = shutil.copytree(HIP, tmp_path / "program", ignore=shutil.ignore_patterns("build"))
        words = [program if word == "PROGRAM" else word for word in words]
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", MOUNT, "sh", size, disk, sys.executable, "-m", "ranger_sim", *map(str, words)],
        env={"PATH": "/usr/bin:/bin:/usr/local/bin", "PYTHONPATH": str(ROOT), "KEPT": str(kept), "TMPDIR": str(disk)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert "No space left on device" in done.stderr and "Traceback" not in done.stderr
    assert any(place in line and "No space left" in line for line in done.stderr.splitlines()), done.stderr
    for path in kept.rglob("*"):
        data = path.read_bytes() if path.is_file() and ".partial" not in path.name else b""
        assert (
            not data.strip()
            or path.suffix not in WHOLE
            or data.rstrip(b"\n \0")[-7:].endswith(WHOLE[path.suffix].strip())
        ), path
    if (summary := kept / "out" / "summary.json").is_file():
        assert json.loads(summary.read_text(encoding="utf-8"))["complete"] is False
