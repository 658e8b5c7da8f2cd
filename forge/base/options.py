"""Command-line options as fields of frozen dataclasses.

    @frozen
    class JobOptions:
        jobs: int = option("maximum number of jobs", default=0, parse=positive_number, metavar="N")

forge.cli.options adds an argument for each such field, and fills the dataclass. Other packages see only the
dataclass. A field without an option gets the parser's value of that name, if there is one. GROUP is the title
of the options in the help; PREFIX replaces '--' in their names. USAGE and EPILOG replace argparse's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, field
from typing import Any

from forge.base.frozen import frozen

OPTION, NESTED = "option", "options"
"""The keys in the metadata of a field: its Option, or a dataclass with further options."""


@frozen
class Option:
    """The command-line part of a field; a tuple as default takes a list."""

    help: str | None
    """None hides the option."""
    flag: str = ""
    """The option, if its name differs from the field's."""
    positional: bool = False
    metavar: str | tuple[str, ...] | None = None
    short: str = ""
    """A spelling with one dash, such as '-j'."""
    nargs: str | None = None
    const: object = None
    """The value of an option with nargs='?' that is used without one."""
    choices: tuple[object, ...] | None = None
    parse: Callable[[str], object] | None = None
    """Converts a value; raises ValueError with the message for users."""
    combine: Callable[[Sequence[Any]], object] = tuple
    """Converts the list of values."""
    group: str = ""
    """The title of the group in the help, if it differs from that of the other fields."""
    conflicts: str = ""
    """Options with the same text cannot be combined."""
    required: bool = False
    repeats: bool = False
    """Each use of the option adds its value."""
    accumulates: bool = False
    """Each use of the option adds to its values, and a value may contain several words."""
    inherited: bool = False
    """Also accepted before the command; a value after the command takes precedence."""


def option(
    help: str | None,
    *,
    default: Any = None,
    default_factory: Callable[[], Any] | None = None,
    **more: Any,
) -> Any:
    """Return a dataclass field with an Option; `more` are its attributes."""
    metadata = {OPTION: Option(help, **more)}
    if default_factory is not None:
        return field(default_factory=default_factory, metadata=metadata)
    return field(default=default, metadata=metadata)


def flag(help: str, **more: Any) -> Any:
    """Return the field of an option without a value."""
    return option(help, default=False, **more)


def options_of(cls: Callable[[], Any]) -> Any:
    """Return a field with the options of another dataclass."""
    return field(default_factory=cls, metadata={NESTED: cls})


def default_of(declared: Field[Any]) -> object:
    return declared.default if declared.default_factory is MISSING else declared.default_factory()
