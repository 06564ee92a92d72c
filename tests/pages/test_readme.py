"""README and tutorial are run by `python -m dev.readme`: here are its parts, and the size of the base installation."""

import os
import pathlib
import subprocess

from dev import readme
from set_up import name_of, part_of_lock
from tests.test_packaging import PROJECT

ROOT = pathlib.Path(__file__).resolve().parents[2]
BASE_MB = 150.0
LONGEST_S = 600.0
TRACEBACK = "python3 -c 'raise KeyError'  # exit code 1"


def test_a_page_is_run_in_order_and_what_is_wrong_is_shown(tmp_path):
    page = tmp_path / "page.md"
    commands = ("python3 one.py", ". ./set.sh", "echo $MINE", "false  # exit code 1", "false", TRACEBACK)
    page.write_text(
        "```python\n# one.py\nprint(1 + 1)\n```\n"
        "```sh\n" + "".join(f"{line}\n" for line in commands) + "```\n"
        "```console\nrm -rf here\n```\n"
    )
    (tmp_path / "set.sh").write_text("MINE=yes\n")
    done = list(readme.in_order(page, tmp_path, readme.of_a_stranger()))
    assert [each.printed for each in done[:2]] == ["2\n", "yes\n"]
    assert [each.is_right for each in done] == [True, True, True, False, False]
    assert "code 0 is expected" in done[3].text() and "Traceback" in done[4].text()
    assert all(each.seconds >= 0.0 for each in done)


def size_MB(folder, without=()):
    files = [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    kept = [path for path in files if path.relative_to(folder).parts[0].partition("-")[0] not in without]
    return sum(path.stat().st_size for path in kept) * 1e-6


def test_the_base_is_small_and_walks_and_runs_a_new_project(tmp_path):
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    wanted = {name_of(each) for each in PROJECT["project"]["dependencies"]}
    (tmp_path / "base.txt").write_text(part_of_lock(lock, wanted), encoding="utf-8")
    python = tmp_path / "env" / "bin" / "python"
    environment = {**readme.of_a_stranger(), "PYTHONDONTWRITEBYTECODE": "1"}
    install = [python, "-m", "pip", "install", "-q", "--no-deps", "--no-compile", "--require-hashes", "-r"]
    for command in ([readme.base_python(), "-m", "venv", tmp_path / "env"], [*install, tmp_path / "base.txt"]):
        subprocess.run([str(each) for each in command], env=environment, check=True, timeout=LONGEST_S)
    [packages] = (tmp_path / "env" / "lib").glob("python*/site-packages")
    ours = sum(size_MB((ROOT / "ranger_sim" / name).resolve()) for name in os.listdir(ROOT / "ranger_sim"))
    ours += size_MB(ROOT / "build" / "compiled")
    assert size_MB(packages, without=("pip", "setuptools", "pkg_resources", "_distutils_hack")) + ours < BASE_MB

    def run(*arguments):
        return subprocess.run(
            [str(python), "-m", "ranger_sim", *arguments],
            cwd=tmp_path,
            env={**environment, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST_S,
        )

    walked = run("walk", "--steps", "3", "--out", "first")
    assert walked.returncode == 0 and "report.html needs the library" in walked.stderr, walked.stderr
    for arguments in (["new", "mine"], ["info"], ["slots", "MCH", "--time", "500ms"], ["can-bounds"]):
        assert (done := run(*arguments)).returncode == 0, done.stderr
    refused = run("diagnose", "run.csv", "--experiment", "motor-bench")
    assert (refused.returncode, refused.stdout) == (2, "") and "[diagnose]" in refused.stderr
