"""The reference says what the code says: tables made from it, and names that both have."""

import argparse
import ast
import dataclasses
import re
from pathlib import Path

import pytest

from forge.base.errors import EXIT_INTERRUPTED
from forge.build.events import Event
from forge.cli.main import COMMANDS, EXIT_BUG, EXIT_USER
from forge.output.console import Tally
from forge.workspace.overrides import NO_SETTINGS
from tests import reference
from tests.snippets import ROOT

REFERENCE = ROOT / "docs/reference"
COMMANDS_PAGE = REFERENCE / "commands.md"
CODE = "".join(
    path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "forge").rglob("*.py"))
    if "embedded" not in path.parts and "_templates" not in path.parts
)
PARSERS = dict(reference.all_parsers())
LONGEST_HELP = 200

ENTAILED = {
    *(
        "AMENT_PREFIX_PATH",
        "COLUMNS",
        "LD_LIBRARY_PATH",
        "PYTHONPATH",
        "PATH",
        "HOME",
        "XDG_CACHE_HOME",
        "TERM",
        "ZDOTDIR",
    ),  # as everybody reads them
    *("LD_PRELOAD", "ASAN_OPTIONS", "GIT_CONFIG_COUNT"),  # to which forge adds
    *("CONDA_PREFIX", "PYTHONHOME"),  # of which forge doctor warns
    *(
        "FORGE_WORKER",
        "FORGE_BUILD_FOLDER",
        "FORGE_TEMPLATES",
        "FORGE_OBSERVER_LOG",
    ),  # between forge and what it starts
}


@pytest.mark.parametrize("page", sorted(REFERENCE.glob("*.md")), ids=lambda page: page.stem)
def test_tables_match_the_code(page: Path, request: pytest.FixtureRequest) -> None:
    text = page.read_text(encoding="utf-8")
    if request.config.getoption("--accept"):
        page.write_text(reference.updated(text), encoding="utf-8")
    else:
        assert reference.updated(text) == text, "if this is intended: pytest tests/test_reference.py --accept"


def test_every_option_is_documented_once() -> None:
    told = reference.regions(COMMANDS_PAGE.read_text(encoding="utf-8"))
    assert len(told) == len(set(told))
    for group, command in reference.SHARED.items():
        assert f"{command} / {group}" in told
    own = {
        command
        for command in COMMANDS
        if any(o.group not in reference.SHARED for o in reference.options(command))
    }
    alone = {subject for subject in told if " / " not in subject} - {"before the command"}
    parts = {
        subject.partition(" / ")[0] for subject in told if subject.partition(" / ")[2] not in reference.SHARED
    }
    assert alone | parts - {"before the command"} == own


@pytest.mark.parametrize("words", PARSERS)
def test_every_argument_has_a_help_text(words: str) -> None:
    """Lower case, no full stop, a default wherever there is one that matters, not a paragraph."""
    parser = PARSERS[words]
    assert parser.description
    for action in parser._actions:
        if action.help == argparse.SUPPRESS or isinstance(action, argparse._HelpAction):
            continue
        if isinstance(action, argparse._SubParsersAction):
            continue
        name = action.option_strings or action.dest
        text = parser._get_formatter()._expand_help(action) if action.help else ""
        assert text, f"{words}: {name} says nothing"
        assert not text.endswith("."), f"{words}: {name}"
        assert not re.match(r"[A-Z][a-z]", text), f"{words}: {name}"
        assert len(text) <= LONGEST_HELP, f"{words}: {name}"
        if action.option_strings and action.nargs != 0 and _matters(action.default):
            assert "(default: " in text, f"{words}: {name} has the default {action.default!r}"


def _matters(default: object) -> bool:
    return default not in (None, 0, "", argparse.SUPPRESS) and default not in ([], ())


def test_every_exit_code_is_documented() -> None:
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", _page("exit-codes"), re.MULTILINE)}
    assert codes == {0, 1, EXIT_USER, EXIT_BUG, EXIT_INTERRUPTED}


def test_every_environment_variable_is_documented() -> None:
    told = set(re.findall(r"`([A-Z][A-Z_]+)`", _page("configuration")))
    settings = set(re.findall(r'\bsetting\(\s*"([A-Z_]+)"', CODE))
    plain = set(re.findall(r'\b(?:environ|variables)\.get\("([A-Z_]+)"', CODE))
    plain |= set(re.findall(r'"([A-Z_]+)" in os\.environ', CODE))
    both = {f"{tool}_{name}" for tool in ("FORGE", "COLCON") for name in settings}
    assert settings
    assert plain
    assert both - told - {"COLCON_PROFILE"} == set()
    assert plain - ENTAILED - told == set()


def test_every_package_setting_is_documented() -> None:
    part = _page("configuration").split("## Options for single packages")[1].split("\n## ")[0]
    told = set(re.findall(r"`([a-z-]+)`", "\n".join(re.findall(r"^\| (`.*?) \|", part, re.MULTILINE))))
    read = set(re.findall(r'\b(?:option_)?values\("([a-z-]+)"\)', CODE))
    read |= set(re.findall(r'package\.settings\.get\("([a-z-]+)"\)', CODE))
    assert told == read | NO_SETTINGS


def test_every_event_is_documented_with_all_fields() -> None:
    """json_events.py and plugins say them; the page has a row for each, and in it each key."""
    rows = dict(re.findall(r"^\| `([A-Z]\w+)` \|.*?\|(.*)\|$", _page("events"), re.MULTILINE))
    of_plugins = {
        "Coverage": {"lines", "covered", "report"},
        "FlakyTest": {"test", "passed_at", "message"},
        "TestFailure": {"file", "line", "test", "message", "repeat"},
        "Usage": {"processors", "jobs", "memory", "samples"},
        "Commands": {"commands", "chain"},
        "Headers": {"compiler", "files", "failed", "total", "in_headers", "in_templates", "headers"},
    }
    said = _events() | of_plugins
    assert said.keys() >= {each.__name__ for each in Event.__args__}
    assert rows.keys() == said.keys()
    for event, keys in said.items():
        assert [key for key in sorted(keys) if f"`{key}`" not in rows[event]] == []


def _events() -> dict[str, set[str]]:
    """Return the events that json_events.py writes and their keys; those of a whole dictionary included."""
    tree = ast.parse((ROOT / "forge/output/json_events.py").read_text(encoding="utf-8"))
    functions = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    cases = [node for node in ast.walk(tree) if isinstance(node, ast.match_case)]
    more = {
        "StepStarted": _keys(functions["_step"]),
        "Finished": _keys(next(case for case in cases if "Finished(name, code" in ast.unparse(case.pattern))),
        "Summary": {field.name for field in dataclasses.fields(Tally)},
    }
    found: dict[str, set[str]] = {}
    for node in ast.walk(tree):
        match node:
            case ast.Call(ast.Attribute(attr="emit" | "_members"), [ast.Constant(str(event)), *_], keywords):
                keys = {keyword.arg for keyword in keywords if keyword.arg}
                found.setdefault(event, set()).update(keys | more.get(event, set()))
    return found


def _keys(function: ast.AST) -> set[str]:
    tables = [node for node in ast.walk(function) if isinstance(node, ast.Dict)]
    return {str(key.value) for table in tables for key in table.keys if isinstance(key, ast.Constant)}


def _page(name: str) -> str:
    return (REFERENCE / f"{name}.md").read_text(encoding="utf-8")
