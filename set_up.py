"""Sets up everything that `make walk` or `make test` needs: environment, packages, compiled library, command.

    python3 set_up.py walk      # the package and the extras of the README's commands
    python3 set_up.py all       # all of pyproject.toml: its extras, and packages for tests, lint and documents
    python3 set_up.py lint      # all packages, and nothing compiled: enough for `make lint`

Packages come from requirements.lock, by hash. The sources are compiled (setup.py) while packages are still being
installed, which takes less time: Cython and setuptools come first. Completed work is not repeated. One line shows the
progress; the output of the tools is in build/setup.log.

Runs before anything is installed: only Python's own library here.
"""

import argparse
import os
import pathlib
import re
import subprocess
import sys
import threading
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
LOG = HERE / "build" / "setup.log"
EXTRAS_OF_A_WALK = ("report", "diagnose", "campaign", "panel")  # what the README's commands need


class SetUpError(Exception):
    """Set-up is impossible; the message gives the reason in a line or two."""


def name_of(requirement):
    """The normalised name of a requirement such as `python-can>=4.6`."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def for_a_walk(project):
    """Names of the packages that the README's commands need, and pytest, for which the package is a plugin.

    project: the content of pyproject.toml.
    """
    extras = project["project"]["optional-dependencies"]

    def names(requirements):
        for each in requirements:
            own = re.match(r"ranger-sim\[(.+)\]", each)
            if own:
                for extra in own[1].split(","):
                    yield from names(extras[extra])
            else:
                yield name_of(each)

    parts = [project["project"]["dependencies"], *(extras[each] for each in EXTRAS_OF_A_WALK)]
    return {name for part in parts for name in names(part)} | {"pytest"}


def part_of_lock(lock, wanted):
    """The entries of a lock file's text that `wanted` (names) need, directly or indirectly; all when it is None.

    The lock lists under each entry the packages that need it ("# via ...").
    """
    entries = re.split(r"^(?=[A-Za-z])", lock, flags=re.MULTILINE)[1:]
    if wanted is None:
        return "".join(entries)
    missing = set(wanted) - set(map(name_of, entries))
    if missing:
        raise SetUpError(f"requirements.lock does not have {', '.join(sorted(missing))}: make lock")
    kept, before = set(wanted), set()
    while kept != before:
        before = set(kept)
        for entry in entries:
            reasons = re.sub(r"\s*#( +via)?", " ", entry.partition("# via")[2]).split()
            if kept & set(reasons):
                kept.add(name_of(entry))
    return "".join(entry for entry in entries if name_of(entry) in kept)


class Line:
    """Progress: one line that is rewritten on a terminal; elsewhere a line at the end of each part."""

    def __init__(self):
        self.terminal = sys.stdout.isatty()
        self.parts = {}
        self.lock = threading.Lock()

    def show(self, part, text, end=False):
        """Show one part's progress; `end`: it has finished."""
        with self.lock:
            self.parts[part] = text
            if self.terminal:
                print("\r\033[K" + ", ".join(filter(None, self.parts.values())), end="", flush=True)
            elif end:
                print(text, flush=True)

    def close(self):
        """Leave the line."""
        if self.terminal:
            print()


class Steps:
    """Runs the tools in the environment, with their output in the log."""

    def __init__(self, venv, line):
        self.venv, self.line = venv, line
        self.python = venv / "bin" / "python"

    def run(self, command, seen=lambda text: None, **environment):
        """Run a tool; `seen` gets each line that it prints. SetUpError when it fails."""
        with LOG.open("a", encoding="utf-8") as log:
            log.write(f"$ {' '.join(map(str, command))}\n")
            log.flush()
            tool = subprocess.Popen(
                [str(part) for part in command],
                cwd=HERE,
                env={**os.environ, **environment},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
            )
            said = []
            for text in tool.stdout:
                log.write(text)
                log.flush()
                said.append(text.rstrip())
                seen(text)
            if tool.wait():
                last = "\n".join(f"    {text}" for text in said[-4:])
                raise SetUpError(f"{pathlib.Path(command[0]).name} {command[-1]} failed:\n{last}")
        return said

    def environment(self):
        """An empty environment with pip."""
        if not (self.venv / "bin" / "pip").exists():
            self.line.show("packages", "environment ...")
            self.run([sys.executable, "-m", "venv", self.venv])

    def packages(self, what, entries):
        """Install the entries of the lock; nothing when exactly these, or all of this lock, were installed before."""
        kept = self.venv / f"installed-{what}.txt"
        whole = self.venv / "installed-all.txt"
        if kept.exists() and kept.read_text(encoding="utf-8") == entries:
            return
        if whole.exists() and set(entries.splitlines()) <= set(whole.read_text(encoding="utf-8").splitlines()):
            return
        wanted = self.venv / f"wanted-{what}.txt"
        wanted.write_text(entries, encoding="utf-8")
        count, of = 0, len(re.findall(r"^[A-Za-z]", entries, re.MULTILINE))

        def seen(text):
            nonlocal count
            if text.startswith(("Collecting", "Requirement already satisfied", "Ignoring")):
                count += 1
                self.line.show("packages", f"packages {count} of {of}")
            elif text.startswith("Installing"):
                self.line.show("packages", f"installing {of} packages")

        # the lock has everything needed: pyproject.toml leaves out unused dependencies of packages
        # bytecode is written when a module is first imported: most of them never are
        options = ["--disable-pip-version-check", "--progress-bar", "off", "--no-compile", "--require-hashes"]
        options += ["--no-deps"]
        self.run([self.python, "-m", "pip", "install", *options, "-r", wanted], seen)
        self.line.show("packages", f"{of} packages ({what})", end=True)
        wanted.replace(kept)

    def bytecode(self):
        """Bytecode of all packages and of ours where Python is set to write none later: tests start many programs."""
        [packages] = (self.venv / "lib").glob("python*/site-packages")
        ours = sorted({each.resolve() for each in (HERE / "ranger_sim").iterdir() if each.is_dir()})
        if sys.dont_write_bytecode:
            self.run([self.python, "-m", "compileall", "-q", "-j", "0", packages, HERE / "ranger_sim", *ours])

    def library(self):
        """Compile what changed. Without a compiler the sources run interpreted, and this is reported."""
        notes = []

        def seen(text):
            if re.match(r"(translated|compiled) \d+", text):
                done, of = map(int, re.findall(r"\d+", text))
                self.line.show("library", text.strip(), end=done == of)
            elif text.startswith("***"):
                notes.append(text)

        self.run([self.python, "setup.py", "-q", "build_ext", "--inplace"], seen, RANGER_SIM_SETUP="1")
        return notes

    def command(self):
        """Link the tree into the environment: this makes the command and python-can's entry point available."""
        linked = self.venv / ".linked"
        project = HERE / "pyproject.toml"
        if linked.exists() and linked.stat().st_mtime_ns >= project.stat().st_mtime_ns:
            return
        options = ["--disable-pip-version-check", "--no-deps", "--no-build-isolation", "--no-compile"]
        # built in place already: an editable install would build everything once more, elsewhere
        self.run([self.python, "-m", "pip", "install", *options, "--editable", "."], RANGER_SIM_BUILT="1")
        linked.touch()


def set_up(what, venv):
    """Everything, in order; packages and library at the same time. For `lint` packages alone."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))
    lock = (HERE / "requirements.lock").read_text(encoding="utf-8")
    builders = {name_of(each) for each in project["build-system"]["requires"]}
    walk = builders | for_a_walk(project)
    LOG.parent.mkdir(exist_ok=True)
    LOG.write_text("", encoding="utf-8")
    line = Line()
    steps = Steps(venv, line)
    failed, notes = [], []

    def library():
        try:
            notes.extend(steps.library())
        except SetUpError as error:
            failed.append(error)

    try:
        steps.environment()
        if what == "lint":
            steps.packages("all", part_of_lock(lock, None))
            return
        steps.packages("builders", part_of_lock(lock, builders))
        beside = threading.Thread(target=library)
        beside.start()
        try:
            steps.packages(what, part_of_lock(lock, None if what == "all" else walk))
            if what == "all":
                steps.bytecode()
        finally:
            beside.join()
        if failed:
            raise failed[0]
        steps.command()
    finally:
        line.close()
    print("".join(notes), end="")


def main():
    """The command."""
    parser = argparse.ArgumentParser(description="Sets up what `make walk` or `make test` needs.")
    parser.add_argument("what", choices=("walk", "all", "lint"))
    parser.add_argument("--venv", type=pathlib.Path, default=HERE / ".venv")
    chosen = parser.parse_args()
    try:
        set_up(chosen.what, chosen.venv.absolute())
    except SetUpError as error:
        print(f"ranger-sim could not be set up: {error}\nThe whole output is in {LOG}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
