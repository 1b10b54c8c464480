"""Every code block of the documentation does what it says: tests/pages.py tells how."""

import logging
import os
import re

import pytest

from pages import Block, Reader, blocks, check_case, check_options, commands, merged, pages, spume_commands

LANGUAGES = {"toml", "sh", "python", "csv", "text", "powershell", "json", "bibtex"}
NOT_RUN = 24
"""Blocks that cannot run in a test; each says why."""

EVERY = [page for page in pages() if blocks(page)]
pytestmark = pytest.mark.skipif(len(EVERY) < 2, reason="no docs folder beside the tests")


def name_of(page):
    return page.stem if page.parent.name == "docs" else f"{page.parent.name}/{page.stem}"


@pytest.fixture
def in_folder(tmp_path, monkeypatch):
    """A folder to work in; what a command of Spume changes for the process is put back."""
    monkeypatch.chdir(tmp_path)
    logger = logging.getLogger("spume")
    kept = logger.handlers[:], logger.level, logger.propagate
    yield tmp_path
    logger.handlers[:], logger.level, logger.propagate = kept


@pytest.mark.parametrize("page", EVERY, ids=name_of)
def test_page_does_what_it_says(page, in_folder):
    reader = Reader(in_folder, as_printed=os.environ.get("SPUME_DOCS_AS_PRINTED") == "1")
    for block in blocks(page):
        reader.follow(block)


def test_every_block_has_a_known_language_and_those_not_run_are_counted():
    found = [block for page in EVERY for block in blocks(page)]
    assert [f"{block}: {block.language!r}" for block in found if block.language not in LANGUAGES] == []
    not_run = [f"{block}: {block.notes['not run']}" for block in found if "not run" in block.notes]
    assert len(not_run) == NOT_RUN, "\n".join(not_run)
    powershell = [block for block in found if block.language == "powershell"]
    assert all("not run" in block.notes for block in powershell)


def test_fences_are_all_found():
    for page in EVERY:
        fences = len(re.findall(r"^ *```", page.read_text("utf-8"), re.MULTILINE))
        assert fences == 2 * len(blocks(page)), page


# -------------------------------------------------------------------------------- the harness itself can fail


def block(text, language="sh", **notes):
    return Block(pages()[0], 1, language, "", {key.replace("_", " "): value for key, value in notes.items()}, text)


def test_a_wrong_option_is_found():
    (arguments,) = spume_commands(block("srun spume run case.toml --resum there && echo done\n"))
    with pytest.raises(Exception, match="No such option"):
        check_options(arguments)
    with pytest.raises(AssertionError, match="no command"):
        check_options(["simulate", "case.toml"])


def test_commands_of_a_block_that_is_not_run():
    text = "if [ -e tank ]; then spume run --resume tank\nelse spume run dam-break --out tank; fi\n"
    assert list(spume_commands(block(text))) == [["run", "--resume", "tank"], ["run", "dam-break", "--out", "tank"]]
    assert list(commands(block("spume run a.toml \\\n    --out b  # a comment\n"))) == ["spume run a.toml --out b"]


def test_a_wrong_key_a_failing_command_and_a_failing_statement_are_found(in_folder):
    with pytest.raises(Exception, match="no such key"):
        check_case(block("[time]\nends = 1.0\n", "toml"), None, in_folder)
    with pytest.raises(AssertionError, match="ended with 2, not 0"):
        Reader(in_folder, as_printed=False).follow(block("spume check no-such-case\n"))
    Reader(in_folder, as_printed=False).follow(block("spume check no-such-case\n", exit_code="2"))
    with pytest.raises(ZeroDivisionError):
        Reader(in_folder, as_printed=False).follow(block("1 / 0\n", "python"))


def test_parts_are_merged_by_name():
    base = {"time": {"end": 1.0}, "body": [{"name": "tank", "kind": "wall"}]}
    part = {"time": {"courant": 0.1}, "body": [{"name": "tank", "kind": "gate"}, {"name": "sill"}]}
    whole = merged(base, part)
    assert whole["time"] == {"end": 1.0, "courant": 0.1}
    assert [(b["name"], b.get("kind")) for b in whole["body"]] == [("tank", "gate"), ("sill", None)]
