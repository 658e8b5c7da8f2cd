"""Options from files: defaults.yaml, forge.toml with its profiles, mixins.

In order of increasing priority: the user's defaults.yaml, colcon_defaults.yaml and forge.toml of the
workspace, a profile, mixins, the command line. A list replaces a list of lower priority, except that lists of
mixins are prepended to those of the command line.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from forge.base.distributions import VARIABLE
from forge.base.env_vars import home, setting
from forge.base.errors import Location, Problem, SelectionError, print_problem
from forge.base.files import read_file
from forge.base.formats import read_yaml
from forge.base.names import did_you_mean
from forge.workspace.forge_toml import FORGE_TOML, read_forge_toml, table_of

_LOCAL_DEFAULTS = "colcon_defaults.yaml"
GENERAL = ("log_base", "log_level")
"""Destinations of global options, which are also allowed before the command."""
_BEFORE_FILES = {"rosdistro": VARIABLE}
"""Environment variables that take precedence over files, by the destination of the option."""
_AGREE_WITH_BUILD = frozenset({"deps", "doctor"})
"""Commands about the next build, which read options shared with `forge build` from its tables."""
_OF_ONE_COMMAND = frozenset({"json", "mixin", "mixin-files", "profile"})
_FLAGS = (argparse._StoreTrueAction, argparse._StoreFalseAction)


OptionFile = tuple[Path, Mapping[str, Any]]
"""A file, and its options of one command by name without leading dashes."""


def configured(
    verb: str,
    actions: Iterable[argparse.Action],
    given: Mapping[str, Any],
    root: Path,
    variables: Mapping[str, str],
) -> dict[str, Any]:
    """Return the values, by destination, that files set for options of a command.

    `given` are the values of the command line; one of them is returned only if mixins add to it. Unknown
    options and invalid values are reported on stderr and ignored. Raises WorkspaceError for malformed files,
    SelectionError for unknown profiles and mixins.
    """
    known = {
        option[2:]: action for action in actions for option in action.option_strings if option[:2] == "--"
    }
    values: dict[str, Any] = {}
    if verb in _AGREE_WITH_BUILD:
        shared = known.keys() - _OF_ONE_COMMAND
        for path, options in _sources("build", given, root, variables):
            agreed = {key: value for key, value in options.items() if key in shared}
            values.update(_checked((path, agreed), known, "build"))
    for source in _sources(verb, given, root, variables):
        values.update(_checked(source, known, verb))
    values = {
        dest: value
        for dest, value in values.items()
        if dest not in given and not variables.get(_BEFORE_FILES.get(dest, ""))
    }
    wanted = {**values, **given}
    if names := wanted.get("mixin"):
        from forge.cli.mixins import combined, mixin_folders, read_mixins

        mixins = read_mixins(mixin_folders(variables), wanted.get("mixin_files") or ())
        source = Path("mixin " + ", ".join(names)), combined(names, verb, mixins)
        for dest, value in _checked(source, known, verb).items():
            typed = given.get(dest)
            if dest not in given:
                values[dest] = value
            elif isinstance(value, list) and isinstance(typed, list):
                values[dest] = [*value, *typed]
    # Either option on the command line overrides both in files.
    if "paths" in given and given["paths"] and "base_paths" not in given:
        values["base_paths"] = []
    elif "base_paths" in given and "paths" not in given:
        values["paths"] = []
    return values


def configured_word(option: str, root: Path, variables: Mapping[str, str]) -> str | None:
    """Return the value that files set for an option of `forge build`, for commands that agree with it."""
    sources = _sources("build", {}, root, variables)
    values = [value for _, options in sources if isinstance(value := options.get(option), str)]
    return values[-1] if values else None


def _sources(
    verb: str, given: Mapping[str, Any], root: Path, variables: Mapping[str, str]
) -> Iterator[OptionFile]:
    """Yield the files with options of the command, in order of increasing priority."""
    defaults = Path(setting("DEFAULTS_FILE", variables) or home(variables) / "defaults.yaml")
    local = root / _LOCAL_DEFAULTS
    is_same = defaults.exists() and local.exists() and defaults.samefile(local)
    for path in (defaults,) if is_same else (defaults, local):
        if path.exists():
            content = read_yaml(read_file(path), path)
            general = {
                key: value
                for key, value in table_of(content, "", path).items()
                if str(key).replace("-", "_") in GENERAL
            }
            yield path, {**general, **table_of(content, verb, path)}
    content, path = read_forge_toml(root), root / FORGE_TOML
    yield path, table_of(content, verb, path)
    profiles = table_of(content, "profiles", path)
    name = given.get("profile") or setting("PROFILE", variables)
    if name is None:
        return
    if name not in profiles:
        hint = did_you_mean(name, profiles) or f"add a table [profiles.{name}.{verb}] to {FORGE_TOML}"
        raise SelectionError(Problem(f"unknown profile '{name}'", Location(path), hint))
    yield path, table_of(table_of(profiles, name, path), verb, path)


def _checked(source: OptionFile, known: Mapping[str, argparse.Action], verb: str) -> dict[str, Any]:
    """Return the values by destination; warn about unknown options and invalid values."""
    (path, options), values = source, {}
    for key, value in options.items():
        action = known.get(str(key))
        if action is None:
            hint = did_you_mean(str(key), known)
            problem = Problem(f"'forge {verb}' has no option '{key}'", Location(path), hint)
            print_problem(problem, "warning")
            continue
        try:
            values[action.dest] = _value(action, value)
        except (TypeError, ValueError, argparse.ArgumentTypeError) as error:
            reason = f": {error}"
            if not isinstance(error, argparse.ArgumentTypeError):
                reason = f" expects {error}, not {value!r}"
            message = f"option '{key}' of 'forge {verb}'{reason}"
            print_problem(Problem(message, Location(path)), "warning")
    return values


def _value(action: argparse.Action, value: object) -> object:
    """Return a value converted for the option; raises TypeError or ValueError with the expected type."""
    if isinstance(action, _FLAGS):
        if not isinstance(value, bool):
            raise TypeError("true or false")
        return value
    if action.nargs == "?" and isinstance(value, bool):
        return action.const if value else action.default
    if action.nargs in {"*", "+"}:
        if not isinstance(value, list):
            raise TypeError("a list")
        return [_single(action, element) for element in value]
    return _single(action, value)


def _single(action: argparse.Action, value: object) -> object:
    if action.type is int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise TypeError("an integer")
        return value
    if not isinstance(value, str) and (action.type is None or not isinstance(value, int | float)):
        raise TypeError("a string")
    if isinstance(value, str) and "\0" in value:
        raise TypeError("a string without NUL characters")
    if action.choices is not None and value not in action.choices:
        raise ValueError(f"one of {', '.join(map(str, action.choices))}")
    try:
        return action.type(str(value)) if callable(action.type) else value
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
