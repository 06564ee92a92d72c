"""The completion of a shell is made from the parser, and a shell completes by it as it should."""

import argparse
import shutil
import subprocess

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.command_line.completion import SHELLS, actions, completed, script
from ranger_sim.tools.commands import COMMANDS

ASKED = """
source {script}
COMP_WORDS=({words}) COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 ))
set -- "${{COMP_WORDS[0]}}" "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD-1]}}"
_shtab_ranger_sim "$@"
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def scripts():
    return {shell: script(cli.parser(), shell) for shell in SHELLS}


def test_the_script_of_every_shell_has_every_listed_command_and_its_options(scripts):
    parser = cli.parser()
    [commands] = [each for each in parser._actions if isinstance(each, argparse._SubParsersAction)]
    for each in COMMANDS:
        if each.is_for_developers:
            del commands.choices[each.name]
    options = {each for action in actions(parser) for each in action.option_strings if each.startswith("--")}
    assert len(options) >= 100 and "--floor-roughness" in options
    for shell, text in scripts.items():
        # fish names an option without its dashes: -l floor-roughness
        missing = [each for each in options if each not in text and f"-l {each[2:]}" not in text]
        assert missing == [], shell
        for command in ("walk", "diagnose", "completion"):
            assert command in text


def test_a_value_is_a_file_where_help_calls_it_one():
    kinds = {each: completed(action) for action in actions(cli.parser()) for each in action.option_strings}
    assert (kinds["--out"], kinds["--json"], kinds["--profile"]) == ("DIRECTORY", "FILE", "FILE")
    assert kinds["--steps"] is None and kinds["--seed"] is None


@pytest.mark.parametrize(
    ("words", "answers"),
    [
        ("ranger-sim wa", {"walk"}),
        ("ranger-sim di", {"diagnose"}),
        ("ranger-sim walk --floor", {"--floor-roughness"}),
        ("ranger-sim completion ''", set(SHELLS)),
        ("ranger-sim walk --out ru", {"runs"}),
    ],
)
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes(scripts, words, answers, tmp_path):
    (tmp_path / "completion").write_text(scripts["bash"], encoding="utf-8")
    (tmp_path / "runs").mkdir()
    (tmp_path / "rubbish.txt").write_text("", encoding="utf-8")
    text = ASKED.format(script=tmp_path / "completion", words=words)
    done = subprocess.run(["bash", "-c", text], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert {each.rstrip("/ ") for each in done.stdout.split()} == answers


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_reads_its_script_without_complaint(scripts, shell, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} here")
    (tmp_path / "script").write_text(scripts[shell], encoding="utf-8")
    done = subprocess.run([shell, "-n", str(tmp_path / "script")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_command_prints_it(capsys, scripts):
    assert cli.main(["completion", "fish"]) == 0
    assert capsys.readouterr().out == scripts["fish"] + "\n"
