"""The table of commands: the list of `--help`, and examples that the command line takes."""

import argparse
import shlex

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.commands import COMMANDS

FOR_DEVELOPERS = ["bench", "twins"]


@pytest.fixture(scope="module")
def whole():
    return cli.parser()


def help_of(words, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main([*words, "--help"])
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", [each for each in COMMANDS if each.module], ids=lambda each: each.name)
def test_help_of_every_command_has_examples_that_its_parser_takes(command, whole, capsys):
    text = help_of([command.name], capsys)
    examples = [line.strip() for line in text.partition("\nexamples:\n")[2].splitlines()]
    assert examples == list(command.examples) and examples
    for example in examples:
        words = shlex.split(example.partition(" > ")[0])
        assert words[0] == "ranger-sim"
        whole.parse_args(words[1:])


def test_commands_of_developers_are_not_in_the_list_of_commands_and_are_named_below_it(capsys):
    listed, _, below = help_of([], capsys).partition("\noptions:\n")
    names = [line.split()[0] for line in listed.splitlines() if line.startswith("    ") and line[4] != " "]
    assert names == [each.name for each in COMMANDS if not each.is_for_developers]
    assert not set(FOR_DEVELOPERS) & set(names)
    assert f"For developers: {', '.join(FOR_DEVELOPERS)}." in below


def test_the_whole_parser_and_the_one_of_a_command_give_the_same_help(whole, capsys):
    [commands] = [each for each in whole._actions if isinstance(each, argparse._SubParsersAction)]
    for name in ("walk", "campaign", "table"):
        assert help_of([name], capsys) == commands.choices[name].format_help()
