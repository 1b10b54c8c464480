"""The help reads well: groups, an example for each command, a sentence for each option, units that survive markup."""

import re

import pytest
import typer.main
from typer.testing import CliRunner

from spume.cli import PANELS, app, help_of
from spume.cli.app import complete_case

COMMANDS = typer.main.get_command(app).commands


def shown(*words):
    result = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "300", "TERM": "dumb"})
    assert result.exit_code == 0, result.output
    return result.output


def test_every_command_has_its_place():
    assert sorted(name for names in PANELS.values() for name in names) == sorted(COMMANDS)
    text = shown()
    places = [
        text.index(word) for panel, names in PANELS.items() for word in (f" {panel} ", *(f"│ {n} " for n in names))
    ]
    assert places == sorted(places)
    assert "--install-completion" in text
    assert "Exit codes: 0 done" in text


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_explains_itself(name):
    command = COMMANDS[name]
    text = shown(name)
    assert re.search(rf"Examples?:\s*\n\s+spume {name}\b", text), "no example"
    for parameter in command.params:
        words = parameter.help or ""
        assert words.endswith((".", ")", "…")), f"{parameter.name}: {words!r} is no sentence"
        assert re.sub(r"\\\[", "[", words) in re.sub(r"[│\s]+", " ", text), (
            f"{parameter.name}: markup swallows {words!r}"
        )


def test_examples_keep_their_lines_and_prose_flows():
    text = help_of("First\nsentence.\n\nExamples:\n  spume a\n  spume b [x]\n")
    assert text == "First sentence.\n\nExamples:\n[cyan]  spume a[/cyan]\n[cyan]  spume b \\[x][/cyan]"


def test_the_shell_completes_cases(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dam-of-mine.toml").write_text("")
    found = complete_case("dam-")
    assert {"dam-break", "dam-break-3d", "dam-of-mine.toml"} <= set(found)
    assert "sloshing" not in found
