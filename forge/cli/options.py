"""Options of dataclasses as arguments of a parser, and the options that several commands share."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import Field, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from forge.base.env_vars import expand_home, setting
from forge.base.errors import Problem, SelectionError
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.base.options import NESTED, OPTION, Option, default_of, flag, option
from forge.cli.colcon_options import PASSED_ON

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from forge.toolchain.targets import Target

_Options = TypeVar("_Options")

LOG_LEVELS = {"debug": 10, "info": 20, "warning": 30, "error": 40, "critical": 50}
"""Log levels: info explains why packages are built, debug also prints every command."""


def add_options(parser: argparse.ArgumentParser, cls: Any) -> None:
    """Add an argument for each option of a dataclass, in groups with their titles."""
    exclusive: dict[str, Any] = {}
    for declared in fields(cls):
        if nested := declared.metadata.get(NESTED):
            add_options(parser, nested)
        if each := declared.metadata.get(OPTION):
            heading = each.group or getattr(cls, "GROUP", "options")
            if each.positional:
                heading = "positional arguments"
            group: Any = next((group for group in parser._action_groups if group.title == heading), None)
            group = group or parser.add_argument_group(heading)
            if each.conflicts:
                group = exclusive.setdefault(each.conflicts, None) or group.add_mutually_exclusive_group()
                exclusive[each.conflicts] = group
            default = argparse.SUPPRESS if each.inherited else default_of(declared)
            keywords: dict[str, Any] = {"action": "store_true"}
            if default is not False:
                is_list = isinstance(default, tuple)
                if isinstance(default, tuple):
                    default = list(default) if each.combine is tuple else []
                keywords = {
                    "default": default,
                    "action": _Accumulate if each.accumulates else "append" if each.repeats else None,
                    "nargs": each.nargs or ("*" if is_list and not each.repeats else None),
                    "required": each.required or None,
                    "const": each.const,
                    "choices": each.choices,
                    "type": _argument_type(each.parse) if each.parse else None,
                    "metavar": each.metavar,
                }
            group.add_argument(
                *filter(None, (each.short, _flag(cls, declared, each))),
                help=argparse.SUPPRESS if each.help is None else each.help,
                **{name: value for name, value in keywords.items() if value is not None},
            )


def read_options(cls: Callable[..., _Options], namespace: argparse.Namespace) -> _Options:
    """Return the dataclass with the values of the parser's arguments."""
    values: dict[str, object] = {}
    declared: Field[Any]
    for declared in fields(cls):  # type: ignore[arg-type]
        name = declared.name
        if nested := declared.metadata.get(NESTED):
            values[name] = read_options(nested, namespace)
        elif each := declared.metadata.get(OPTION):
            flag = _flag(cls, declared, each)
            value = getattr(namespace, flag.removeprefix("--").replace("-", "_"))
            if isinstance(value, list):
                # A leading space protects values that start with a dash.
                value = each.combine([word.lstrip() for word in value] if flag in PASSED_ON else value)
            values[name] = value
        elif hasattr(namespace, name):
            values[name] = getattr(namespace, name)
    return cls(**values)


def set_command(
    parser: argparse.ArgumentParser, cls: Callable[..., _Options], run: Callable[[_Options], int | None]
) -> None:
    """Add the options of a command or verb, which calls `run` with them."""
    add_options(parser, cls)
    parser.usage, parser.epilog = getattr(cls, "USAGE", None), getattr(cls, "EPILOG", None)
    parser.set_defaults(run=lambda namespace: run(read_options(cls, namespace)) or 0)


def add_verb(
    verbs: Any,
    word: str,
    summary: str,
    cls: Callable[..., _Options],
    run: Callable[[_Options], int | None],
    **more: Any,
) -> None:
    """Add a verb of a command; `more` are arguments for its parser."""
    set_command(verbs.add_parser(word, **{"help": summary, "description": summary, **more}), cls, run)


def _flag(cls: Any, declared: Field[Any], each: Option) -> str:
    word = f"{getattr(cls, 'PREFIX', '--')}{declared.name.replace('_', '-')}"
    return each.flag or (declared.name if each.positional else word)


class _Accumulate(argparse.Action):
    """Adds the values of each use of the option; a value may contain several words, as in rosdep."""

    def __call__(
        self,
        _parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        _option: str | None = None,
    ) -> None:
        earlier = getattr(namespace, self.dest)  # not a list before the first use
        words = (word for value in values or () for word in value.split())
        setattr(namespace, self.dest, [*(earlier if isinstance(earlier, list) else ()), *words])


def _argument_type(parse: Callable[[str], object]) -> Callable[[str], object]:
    """Return a converter for argparse, which shows only messages of its own exception type to users."""
    if isinstance(parse, type):
        return parse

    @wraps(parse)
    def convert(text: str) -> object:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return convert


def confirmed(question: str) -> bool:
    """Ask for confirmation; the end of input counts as no."""
    print(question, end="", flush=True)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def _target(word: str) -> Target:
    from forge.toolchain.targets import find_target

    return find_target(word)


def target_option(group: str = "") -> Any:
    return option(
        "platform, such as 'arm64', or 'aarch64-linux-gnu.2.35' for glibc 2.35 and newer; its files are in "
        "folders of its name in the build and install folders (default: this machine)",
        parse=_target,
        metavar="TARGET",
        group=group,
    )


def install_base_option() -> Any:
    return option("install folder (default: install)", default="install", metavar="DIR")


def build_base_option() -> Any:
    return option("build folder (default: build)", default="build", metavar="DIR")


def profile_option() -> Any:
    """Return the option --profile for commands that read no other options from files."""
    return option(
        "use the folders of this profile: install-NAME and so on", metavar="NAME", group="options from files"
    )


@frozen
class NoOptions:
    """The options of a command without options."""


@frozen
class FolderOptions:
    GROUP = "output folders"

    build_base: str = build_base_option()
    install_base: str = install_base_option()
    merge_install: bool = flag("install all packages into one prefix instead of one prefix per package")
    log_base: str | None = option(
        "log folder; /dev/null disables logs (default: log)", metavar="DIR", inherited=True
    )
    target: Target | None = target_option()
    no_wait: bool = flag(
        "exit with code 2 instead of waiting if the build folder is locked by another process"
    )
    log_level: str | None = option(None, metavar="LEVEL", inherited=True)
    profile: str | None = None
    """The value of --profile; forge.cli.config sets its folders."""

    def layout(self, root: Path, *, symlink: bool = False) -> Layout:
        """Return the absolute folders with links unresolved; the null device disables logs."""

        def absolute(path: str) -> Path:
            return Path(os.path.normpath(root / expand_home(path)))

        logs = self.log_base or setting("LOG_PATH", os.environ) or "log"
        target = self.target.name if self.target else ""
        return Layout(
            build=absolute(self.build_base) / target,
            install=absolute(self.install_base) / target,
            logs=None if logs == os.devnull else absolute(logs),
            merged=self.merge_install,
            symlink=symlink,
            target=target,
            profile=self.profile or "",
            root=root,
        )

    def require_logs(self) -> None:
        """Raise SelectionError if there is no log folder for the report of --timings."""
        if self.layout(Path.cwd()).logs is None:
            hint = "remove '--timings', or choose a log folder with '--log-base'"
            raise SelectionError(Problem("--timings needs a log folder, but logs are disabled", hint=hint))

    @property
    def level(self) -> int:
        """Return --log-level as a level of Python's logging module: 10 debug, 20 info, 30 warning and so on.

        Raises SelectionError for an unknown level.
        """
        level = (self.log_level or setting("LOG_LEVEL", os.environ) or "warning").lower()
        if level.isdigit():
            return int(level)
        if level not in LOG_LEVELS:
            hint = f"use {', '.join(LOG_LEVELS)}, or a number"
            raise SelectionError(Problem(f"unknown log level '{level}'", hint=hint))
        return LOG_LEVELS[level]


@frozen
class OptionSources:
    """The sources of options besides the command line; forge.cli.config reads them."""

    GROUP = "options from files"

    profile: str | None = option(
        "use the options of this profile in forge.toml, and separate folders: build-NAME, install-NAME, "
        "log-NAME; every workspace has debug, release, asan, tsan and ubsan",
        metavar="NAME",
    )
    mixin: tuple[str, ...] | None = option(
        "use the options of these mixins; 'forge mixin show' shows them", nargs="*", metavar="NAME"
    )
    mixin_files: tuple[str, ...] | None = option("additional mixin files", nargs="*", metavar="FILE")


def displayed(path: Path | str, origin: str) -> str:
    """Return a path of the workspace relative to `origin`, the folder in which the command was typed."""
    if origin == os.curdir or Path(path).is_absolute():
        return str(path)
    return os.path.relpath(path, origin)
