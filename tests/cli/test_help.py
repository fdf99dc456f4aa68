"""`--help` is one screen of the options that matter, `--help-all` all of them, and errors lead to the right one."""

import argparse
import re

import pytest

from heatertune.cli import parser
from heatertune.cli.command_table import FIRST_OPTIONS, current_options

#: a terminal as it opens
LINES, COLUMNS = 24, 80
#: from so many options on a command's help has two layers
MANY = 16

(_COMMANDS,) = [action.choices for action in parser()._actions if isinstance(action, argparse._SubParsersAction)]


def flags_of(command, needed=(True, False)):
    """Return the flags of a command's shown options, the help's own apart; where asked to, of those that must be given."""
    actions = [action for action in command._actions if action.help != argparse.SUPPRESS and action.required in needed]
    return {flag for action in actions for flag in action.option_strings if flag.startswith("--")} - {"--help", "--help-all"}


def printed(run, capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        run(*arguments)
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_every_command_of_many_options_has_a_first_layer():
    assert {name for name, command in _COMMANDS.items() if len(flags_of(command)) >= MANY} <= set(FIRST_OPTIONS) <= set(_COMMANDS)


@pytest.mark.parametrize("name", FIRST_OPTIONS)
def test_the_first_layer_is_one_screen_with_an_example_and_the_way_to_the_rest(name, run, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    said = printed(run, capsys, name, "--help").splitlines()
    assert len(said) <= LINES
    assert max(map(len, said)) <= COLUMNS
    assert said[0].startswith(f"usage: heatertune {name} ")
    assert any(line.startswith(f"example: heatertune {name} ") for line in said)
    assert said[-1] == f"all options: heatertune {name} --help-all"


@pytest.mark.parametrize("name", FIRST_OPTIONS)
def test_the_first_layer_has_what_must_be_given_and_says_what_each_option_is(name, run, capsys):
    command = _COMMANDS[name]
    assert flags_of(command, [True]) <= set(FIRST_OPTIONS[name]) <= flags_of(command)
    said = printed(run, capsys, name, "-h")
    for flag in FIRST_OPTIONS[name]:
        assert re.search(rf"^  (-\w( [\w|]+)?, )?{flag}\b.*\s{{2,}}\S", said, re.MULTILINE), flag


@pytest.mark.parametrize("name", _COMMANDS)
def test_all_options_stand_in_the_second_layer(name, run, capsys):
    said = printed(run, capsys, name, "--help-all")
    assert all(re.search(rf"^  .*{flag}\b", said, re.MULTILINE) for flag in flags_of(_COMMANDS[name]))
    assert said == _COMMANDS[name].format_help()


@pytest.mark.parametrize(("arguments", "error"), [
    ("design table4 --taget weg -o out", "unknown option --taget: did you mean --target? (see: heatertune design --help-all)"),
    ("design table4 --mins 5", "unknown option --mins: did you mean --mains? (see: heatertune design --help-all)"),
    ("design table4", "the following arguments are required: --target (see: heatertune design --help)"),
    ("design table4 --ms x", "argument --ms: 'x' is not a number (see: heatertune design --help)"),
    ("design table4 --jitter x", "argument --jitter: 'x' is not a number (see: heatertune design --help-all)"),
    ("terms --xyz", "unknown option --xyz (see: heatertune terms --help)"),
])
def test_an_error_of_an_option_leads_to_the_help_that_shows_it(arguments, error, run, capsys):
    status, out, err = run(*arguments.split())
    assert (status, out, err) == (2, "", f"error: {error}\n")
    command, layer = re.search(r"heatertune (\w+) (--help[-a-z]*)\)", error).groups()
    said = printed(run, capsys, command, layer)
    assert all(flag in said for flag in re.findall(r"(?:mean |argument |/)(--[a-z-]+)", error))


@pytest.mark.parametrize(("given", "now"), [
    (["design", "a.csv", "--switch", "calls=late", "--as-is"], ["design", "a.csv", "--assume", "calls=late", "--no-redesign"]),
    (["decode", "x", "--faithful", "--switch=a=b"], ["decode", "x", "--as-printed", "--assume=a=b"]),
    (["supervise", "--broken", "9"], ["supervise", "--faults-per-kind", "9"]),
    (["write", "out", "--yes", "12345678", "--most-writes=5"], ["write", "out", "--confirm", "12345678", "--max-writes=5"]),
    (["rollback", "r.jsonl", "--yes=1234"], ["rollback", "r.jsonl", "--confirm=1234"]),
    (["record", "--for", "9", "--every", "2"], ["record", "--duration", "9", "--interval", "2"]),
    (["experiment", "--yes"], ["experiment", "--yes"]), ([], [])])
def test_options_of_earlier_releases_are_understood_and_not_listed(given, now):
    """The names are those of release 0.8.0."""
    assert current_options(given) == now
    renamed = {each.partition("=")[0] for each in given} - {each.partition("=")[0] for each in now}
    assert not any(renamed & flags_of(_COMMANDS[name]) for name in given[:1])
