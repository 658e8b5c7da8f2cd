"""Options from files: defaults.yaml, forge.toml with its profiles, mixins.

In order of increasing priority: the user's defaults.yaml, colcon_defaults.yaml and forge.toml of the
workspace, a profile, mixins, the command line. A list replaces a list of lower priority, except that lists of
mixins are prepended to those of the command line, and arguments for other programs appended to those of
files.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from forge.base.distributions import VARIABLE
from forge.base.env_vars import home, setting
from forge.base.errors import Location, Problem, print_problem
from forge.base.extensions import OPTIONS, find
from forge.base.files import read_file
from forge.base.formats import read_yaml
from forge.base.names import did_you_mean
from forge.cli.colcon_options import PASSED_ON
from forge.workspace.forge_toml import (
    FORGE_TOML,
    folder_of_profile,
    profile_of,
    read_forge_toml,
    table_of,
)

_LOCAL_DEFAULTS = "colcon_defaults.yaml"
GENERAL = ("log_base", "log_level")
"""Destinations of global options, which are also allowed before the command."""
_BEFORE_FILES = {"rosdistro": VARIABLE}
"""Environment variables that take precedence over files, by the destination of the option."""
_AGREE_WITH_BUILD = frozenset({"deps", "doctor", "ignore"})
"""Commands that report on the next build; they read options shared with `forge build` from its tables."""
_OF_ONE_COMMAND = frozenset({"json", "mixin", "mixin-files"})
_FOLDERS = {"build-base": "build", "install-base": "install", "log-base": "log"}
"""Options that name folders which are separate for each profile, and their defaults."""
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
    """Return the values, by destination, that files set for options of a command, besides those `given`.

    A given value is returned only if mixins add to it. Warns of unknown options and invalid values. Raises
    WorkspaceError for malformed files, SelectionError for unknown profiles and mixins.
    """
    by_name = {
        option[2:]: action for action in actions for option in action.option_strings if option[:2] == "--"
    }
    has_profiles = by_name.pop("profile", None) is not None
    values: dict[str, Any] = {}
    if verb in _AGREE_WITH_BUILD:
        shared = by_name.keys() - _OF_ONE_COMMAND
        for path, options in option_files("build", given, root, variables, shared):
            agreed = {key: value for key, value in options.items() if key in shared}
            values.update(_checked((path, agreed), by_name, "build"))
    of_profile: Mapping[str, Any] = {}
    # Those commands take the folders of the profile from the tables of `forge build`.
    folders = () if verb in _AGREE_WITH_BUILD else by_name.keys()
    for source in option_files(verb, given, root, variables, folders):
        of_profile = _checked(source, by_name, verb)
        values.update(of_profile)
    if has_profiles and (name := setting("PROFILE", variables)):
        values["profile"] = name
    values = {
        dest: value
        for dest, value in values.items()
        if dest not in given and not variables.get(_BEFORE_FILES.get(dest, ""))
    }
    wanted = {**values, **given}
    has_profile = wanted.get("profile") is not None
    named = of_profile.get("mixin", ()) if has_profile and "mixin" in given else ()
    if names := [*named, *(wanted.get("mixin") or ())]:
        plugin = find(OPTIONS, "mixin", "option")
        mixins = plugin.read_mixins(plugin.mixin_folders(variables), wanted.get("mixin_files") or ())
        source = Path("mixin " + ", ".join(names)), plugin.combined(names, verb, mixins)
        for dest, value in _checked(source, by_name, verb).items():
            typed, in_files = given.get(dest), values.get(dest)
            if dest in given:
                if isinstance(value, list) and isinstance(typed, list):
                    values[dest] = [*value, *typed]
            elif f"--{dest.replace('_', '-')}" in PASSED_ON and isinstance(in_files, list):
                # Arguments for other programs follow those of files.
                values[dest] = plugin.with_joined_flags([*in_files, *value])
            else:
                values[dest] = value
    # Either option on the command line overrides both in files.
    if "paths" in given and given["paths"] and "base_paths" not in given:
        values["base_paths"] = []
    elif "base_paths" in given and "paths" not in given:
        values["paths"] = []
    return values


def misspelt_tables(root: Path, commands: Iterable[str]) -> Iterator[Problem]:
    """Yield the tables of forge.toml that no command reads because a command's name is misspelled."""
    content, path = read_forge_toml(root), root / FORGE_TOML
    tables = {*commands, "packages", "profiles"}
    profiles = table_of(content, "profiles", path)
    for name, table in (("", content), *((f"profiles.{name}.", each) for name, each in profiles.items())):
        for key, value in table.items() if isinstance(table, dict) else ():
            near = did_you_mean(key, tables) if isinstance(value, dict) and key not in tables else None
            if near:
                yield Problem(f"no command reads the table [{name}{key}]", Location(path), near)


def configured_word(option: str, root: Path, variables: Mapping[str, str]) -> str | None:
    """Return the value of an option of `forge build` in files, for commands that must agree with it."""
    sources = option_files("build", {}, root, variables)
    values = [value for _, options in sources if isinstance(value := options.get(option), str)]
    return values[-1] if values else None


def option_files(
    verb: str,
    given: Mapping[str, Any],
    root: Path,
    variables: Mapping[str, str],
    known: Collection[str] = (),
) -> Iterator[OptionFile]:
    """Yield the files with options of the command, in order of increasing priority.

    The last one represents the profile, if any, and contains its folders that are `known` options.
    """
    lower: dict[str, Any] = {}
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
            options = {**general, **table_of(content, verb, path)}
            lower |= options
            yield path, options
    content, path = read_forge_toml(root), root / FORGE_TOML
    options = table_of(content, verb, path)
    yield path, options
    name = given.get("profile") or setting("PROFILE", variables)
    if name is None:
        return
    profile, lower = profile_of(content, name, path), {**lower, **options}
    of_build = table_of(profile, "build", path)
    folders = {}
    for key in _FOLDERS.keys() & known:
        base = value if isinstance(value := lower.get(key), str) else _FOLDERS[key]
        if isinstance(own := of_build.get(key), str):
            folders[key] = own
        elif key == "log-base" and key not in lower and setting("LOG_PATH", variables):
            pass  # runs of all profiles have different names in it
        elif base != os.devnull:
            folders[key] = folder_of_profile(base, name)
    options = table_of(profile, verb, path)
    invalid = {key: options[key] for key in folders.keys() & options if not isinstance(options[key], str)}
    if invalid:  # it causes a warning, but must not lead to the folders of other builds
        yield path, invalid
    yield path, {**folders, **{key: options[key] for key in options if key not in invalid}}


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
        try:
            return [_single(action, element) for element in value]
        except TypeError as error:
            raise TypeError(f"a list in which each element is {error}") from None
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
