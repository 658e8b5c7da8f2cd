"""What files say instead of the command line: defaults.yaml, forge.toml with its profiles, mixins.

Lowest first: the user's defaults.yaml, colcon_defaults.yaml here, forge.toml here, a profile of it, mixins,
the command line. A list replaces that of a lower one, but mixins add to what the command line says.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, SelectionError, WorkspaceError
from forge.files import read_file
from forge.formats import read_toml, read_yaml
from forge.frozen import frozen
from forge.names import did_you_mean
from forge.settings import home, setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

FORGE_TOML = "forge.toml"
_LOCAL_DEFAULTS = "colcon_defaults.yaml"
GENERAL = ("log_base", "log_level")
"""Destinations of options that stand before the command as well."""
_FLAGS = (argparse._StoreTrueAction, argparse._StoreFalseAction)  # noqa: SLF001  (argparse has no other word)


@frozen
class Source:
    """What one file says about the options of one command, by their name without dashes."""

    path: Path
    options: Mapping[str, Any]


def configured(
    verb: str,
    actions: Iterable[argparse.Action],
    given: Mapping[str, Any],
    root: Path,
    variables: Mapping[str, str],
) -> dict[str, Any]:
    """Return the values, by destination, that files have for options of a command.

    `given` are those of the command line; one of them is returned only where mixins add to it. What a
    file says wrongly is told on stderr and does not count. Raises WorkspaceError for files that are
    malformed, SelectionError for profiles and mixins that are not there.
    """
    known = {
        option[2:]: action for action in actions for option in action.option_strings if option[:2] == "--"
    }
    values: dict[str, Any] = {}
    for source in _sources(verb, given, root, variables):
        values.update(_checked(source, known, verb))
    values = {dest: value for dest, value in values.items() if dest not in given}
    if given.get("mixin") or values.get("mixin"):
        values.update(_mixed(verb, {**values, **given}, known, given, variables))
    return values


def package_options(root: Path) -> dict[str, dict[str, Any]]:
    """Return the options of single packages in forge.toml; raises WorkspaceError when it is malformed."""
    packages = _table(_forge_toml(root), "packages", root / FORGE_TOML)
    return {name: _table(packages, name, root / FORGE_TOML) for name in packages}


def _sources(
    verb: str, given: Mapping[str, Any], root: Path, variables: Mapping[str, str]
) -> Iterator[Source]:
    """Yield the files that say something about the command, lowest first."""
    defaults = Path(setting("DEFAULTS_FILE", variables) or home(variables) / "defaults.yaml")
    for path in (defaults, root / _LOCAL_DEFAULTS):
        if path.exists():
            said = read_yaml(read_file(path), path)
            general = {
                key: value
                for key, value in _table(said, "", path).items()
                if str(key).replace("-", "_") in GENERAL
            }
            yield Source(path, {**general, **_table(said, verb, path)})
    said, path = _forge_toml(root), root / FORGE_TOML
    yield Source(path, _table(said, verb, path))
    profiles = _table(said, "profiles", path)
    name = given.get("profile") or setting("PROFILE", variables)
    if name is None:
        return
    if name not in profiles:
        hint = did_you_mean(name, profiles) or f"begin a table [profiles.{name}.{verb}] in {FORGE_TOML}"
        raise SelectionError(Problem(f"there is no profile '{name}'", Place(path), hint))
    yield Source(path, _table(_table(profiles, name, path), verb, path))


def _forge_toml(root: Path) -> dict[str, Any]:
    path = root / FORGE_TOML
    return read_toml(read_file(path), path) if path.exists() else {}


def _table(said: Mapping[str, Any], key: str, path: Path) -> dict[str, Any]:
    table = said.get(key)
    if table is None:
        return {}
    if not isinstance(table, dict):
        raise WorkspaceError(
            Problem(f"'{key}' holds no options", Place(path), f"write 'option: value' below '{key}'")
        )
    return table


def _checked(source: Source, known: Mapping[str, argparse.Action], verb: str) -> dict[str, Any]:
    """Return the values by destination; tell of those that no option takes."""
    values = {}
    for key, value in source.options.items():
        action = known.get(str(key))
        if action is None:
            hint = did_you_mean(str(key), known)
            _warn(Problem(f"'forge {verb}' has no option '{key}'", Place(source.path), hint))
            continue
        try:
            values[action.dest] = _value(action, value)
        except (TypeError, ValueError, argparse.ArgumentTypeError) as error:
            _warn(Problem(f"'{key}' of 'forge {verb}' takes {error}, not {value!r}", Place(source.path)))
    return values


def _value(action: argparse.Action, value: object) -> object:
    """Return a value as the option takes it; raises TypeError or ValueError that says what it takes."""
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
            raise TypeError("a whole number")
        return value
    if not isinstance(value, str) and (action.type is None or not isinstance(value, int | float)):
        raise TypeError("a text")
    if isinstance(value, str) and "\0" in value:
        raise TypeError("a text without NUL")
    if action.choices is not None and value not in action.choices:
        raise ValueError(f"one of {', '.join(map(str, action.choices))}")
    return action.type(str(value)) if callable(action.type) else value


def _mixed(
    verb: str,
    wanted: Mapping[str, Any],
    known: Mapping[str, argparse.Action],
    given: Mapping[str, Any],
    variables: Mapping[str, str],
) -> dict[str, Any]:
    """Return what the mixins change: lists come before those of the command line, anything else gives way."""
    from forge.mixins import combined, read_mixins  # noqa: PLC0415  (only who names one pays for reading them)

    names = wanted["mixin"]
    said = combined(names, verb, read_mixins(home(variables), wanted.get("mixin_files") or ()))
    values = _checked(Source(Path("mixin " + ", ".join(names)), said), known, verb)
    for dest, value in list(values.items()):
        if dest in given:
            mine = given[dest]
            if isinstance(value, list) and isinstance(mine, list):
                values[dest] = [*value, *mine]
            else:
                del values[dest]
    return values


def _warn(problem: Problem) -> None:
    print(problem.render("warning"), file=sys.stderr)  # noqa: T201  (stderr is talk)
