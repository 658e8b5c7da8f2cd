"""Extensions by other distributions, which announce them as entry points.

Finding them reads the metadata of all installed distributions. So this is done only if something is requested
by a name that forge itself does not know, and importlib.metadata is imported only then.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from forge.base.errors import ForgeError, Location, Problem

if TYPE_CHECKING:
    from collections.abc import Callable
    from importlib.metadata import EntryPoint

_Result = TypeVar("_Result")


def entry_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name; of several with the same name, the first on sys.path."""
    from importlib.metadata import entry_points as find

    found: dict[str, EntryPoint] = {}
    for entry in find(group=group):
        found.setdefault(entry.name, entry)
    return dict(sorted(found.items()))


def load(entry: EntryPoint, kind: str, functions: tuple[str, ...]) -> Any:
    """Return what an entry point refers to; raises ForgeError if it lacks one of `functions`.

    `kind` names it in messages, for example 'build type'.
    """
    try:
        found = entry.load()
    except Exception as error:
        raise ForgeError(_unusable(entry, kind, f"{type(error).__name__}: {error}")) from error
    missing = next((name for name in functions if not callable(getattr(found, name, None))), None)
    if missing is not None:
        raise ForgeError(_unusable(entry, kind, f"it has no function '{missing}'"))
    return found


def call(what: str, function: Callable[..., _Result], *arguments: object) -> _Result:
    """Call a function of an extension; raises ForgeError, with `what` failed and where, if it raises."""
    try:
        return function(*arguments)
    except ForgeError:
        raise
    except Exception as error:
        import traceback

        frame = traceback.extract_tb(error.__traceback__)[-1]
        message = f"{what} failed: {type(error).__name__}: {error}"
        hint = "this is an error in the extension: report it to its authors"
        raise ForgeError(Problem(message, Location(frame.filename, frame.lineno), hint)) from error


def distribution_of(entry: EntryPoint) -> str:
    """Return name and version of the distribution that announces an entry point."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown distribution"


def _unusable(entry: EntryPoint, kind: str, reason: str) -> Problem:
    hint = (
        f"fix or remove '{distribution_of(entry)}', which has this entry point of the group '{entry.group}'"
    )
    return Problem(f"the {kind} '{entry.name}' cannot be loaded from '{entry.value}': {reason}", hint=hint)
