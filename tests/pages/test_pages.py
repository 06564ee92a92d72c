"""The tutorial and the how-to pages, walked as a reader walks them: `make docs` runs this, not `make test`.

A page is read from top to bottom in its own folder. A block whose first line is a comment with a file's name
(`# mine.toml`, `/* mine.c */`,
`<!-- mine.xml -->`) is that file; a block `sh` is run line by line, and each line of the block `text` below
it must be in what it printed; a block `python` without a file's name is a program. A block `console` shows what needs
an adapter, a right or a second terminal, and is not run.
"""

import dataclasses
import os
import pathlib
import subprocess
import sys

import pytest

from dev.readme import BLOCK, EXIT_CODE, FILE_KINDS, FILE_NAME

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / "docs" / "tutorial.md", *sorted((ROOT / "docs" / "how-to").glob("*.md"))]
NEEDS = {"mujoco": "mujoco", "fmu-body": "fmpy"}  # pages that need a library which the suite does without
KINDS = {"sh", "text", "python", "toml", "c", "console", "json", "xml"}


@dataclasses.dataclass(frozen=True)
class Block:
    kind: str
    text: str

    @property
    def file(self):
        """Name of the file that the block is, or None."""
        named = FILE_NAME.match(self.text)
        return named[1] or named[2] or named[3] if named and self.kind in FILE_KINDS else None


def blocks(text):
    return [Block(*found) for found in BLOCK.findall(text)]


def commands(folder):
    """A folder for PATH in which `python` and `ranger-sim` are those of this run."""
    (folder / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n', encoding="utf-8")
    (folder / "ranger-sim").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ranger_sim "$@"\n', encoding="utf-8")
    for each in folder.iterdir():
        each.chmod(0o755)
    return folder


def run(line, folder, environment):
    """(what a line printed, on both channels; its exit code)"""
    done = subprocess.run(
        ["sh", "-c", line],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=300,
    )
    return done.stdout, done.returncode


def missing(expected, printed):
    """Lines of `expected` that are not in what was printed; how wide the terminal was does not matter."""
    flat = " ".join(printed.split())
    return [line for line in expected.splitlines() if " ".join(line.split()) not in flat]


def walked(page, folder, environment):
    """Every fault of a page: a command that failed, a line that it did not print."""
    faults, printed = [], None
    for block in blocks(page.read_text(encoding="utf-8")):
        assert block.kind in KINDS, f"{page.name}: a block {block.kind!r}"
        if block.file:
            (folder / block.file).write_text(block.text, encoding="utf-8")
        elif block.kind == "python":
            (folder / "program.py").write_text(block.text, encoding="utf-8")
            printed, code = run("python -W error program.py", folder, environment)
            faults += [f"a program ended with {code}:\n{printed}"] * (code != 0)
        elif block.kind == "sh":
            printed = ""
            for line in filter(None, block.text.splitlines()):
                wanted = EXIT_CODE.search(line)
                more, code = run(line, folder, environment)
                printed += more
                faults += [f"{line}\nended with {code}:\n{more}"] * (code != int(wanted.group(1) if wanted else 0))
        elif block.kind == "text":
            assert printed is not None, f"{page.name}: what is printed comes before a command"
            faults += [f"not printed: {line}\nbut:\n{printed}" for line in missing(block.text, printed)]
    return faults


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_does_what_it_says(page, tmp_path):
    if page.stem in NEEDS:
        pytest.importorskip(NEEDS[page.stem])
    (tmp_path / "bin").mkdir()
    (tmp_path / "here").mkdir()
    path = f"{commands(tmp_path / 'bin')}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "COLUMNS": "120", "PYTHONPATH": str(ROOT)}
    assert walked(page, tmp_path / "here", environment) == []


def test_a_page_that_lies_is_found(tmp_path):
    (tmp_path / "bin").mkdir()
    environment = {**os.environ, "PATH": f"{commands(tmp_path / 'bin')}{os.pathsep}{os.environ['PATH']}"}
    page = tmp_path / "page.md"

    def faults(text):
        page.write_text(text, encoding="utf-8")
        return walked(page, tmp_path, environment)

    program = "```python\n# one.py\nprint(1 + 1)\n```\n"
    assert faults(program + "```sh\npython one.py\n```\n```text\n2\n```\n") == []
    (fault,) = faults(program + "```sh\npython one.py\n```\n```text\n3\n```\n")
    assert fault.startswith("not printed: 3")
    assert faults("```sh\npython -c 'exit(3)'  # exit code 3\n```\n") == []
    assert len(faults("```sh\npython -c 'exit(3)'\npython -c 'exit(0)'  # exit code 1\n```\n")) == 2
    assert len(faults("```python\nimport no_such_module\n```\n")) == 1
    with pytest.raises(AssertionError, match="'bash'"):
        faults("```bash\nls\n```\n")


def test_the_pages_have_commands_to_run():
    kinds = {page.stem: [block.kind for block in blocks(page.read_text(encoding="utf-8"))] for page in PAGES}
    assert kinds["tutorial"].count("sh") >= 6 and kinds["tutorial"].count("text") >= 6
    assert {name for name, found in kinds.items() if "sh" in found} >= {"parameters", "body", "model-term", "adapter"}
