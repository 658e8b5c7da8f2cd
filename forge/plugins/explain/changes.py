"""Name the inputs and installed files that changed since the last build of a package.

The digests of the journal show that something changed. The names of the changed files come from the records
of the build folders, since the file table only covers changes since the last run of forge.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path

from forge.base.cmake_syntax import cmake_arguments
from forge.build.inputs.fingerprints import (
    DIR_LISTING_SUFFIX,
    Changes,
    FileTable,
    Manifest,
    compare,
    content_differs,
    contents_of,
)
from forge.build.model import BuildRecord
from forge.build.records import FolderRecord
from forge.build.up_to_date import (
    COMMON_OPTIONS,
    FAST_ROSIDL,
    ROSDISTRO,
    UNKNOWN_EXTERNAL,
    UNKNOWN_INSTALLED,
    UNKNOWN_SOURCES,
    InputChange,
    InputKind,
)
from forge.engine.world import KIND, LIBRARY, MODULES, OUTPUT, PACKAGE_FOUND, PROCESSOR, PROGRAM, VARIABLE

_MISSING = "missing"
_DIGESTED = "the "
"""The beginning of recorded options that end with a digest, such as toolchains of build types."""
_QUESTIONS = (
    (InputKind.VARIABLE, "environment variable", VARIABLE),
    (InputKind.TOOL, "tool", PROGRAM),
    (InputKind.OUTSIDE, "position in LD_LIBRARY_PATH of the library", LIBRARY),
    (InputKind.OTHER, "location of the package", PACKAGE_FOUND),
    (InputKind.OTHER, "processor", PROCESSOR),
    (InputKind.OUTSIDE, "kind, mode or size of", KIND),
    (InputKind.OUTSIDE, "existence of the output", OUTPUT),
    (InputKind.OTHER, "location of a Python module", MODULES),
)


def changed_sources(home: str, now: Manifest, last: FolderRecord | None, table: FileTable) -> str:
    """Return which sources of a package below `home` changed since its last build, if that is known."""
    if last is None:
        recent = frozenset(path for path in recently_changed(table) if path.startswith(f"{home}/"))
        changes = Changes(modified=recent)
    else:
        changes = compare(last.sources, now, content_differs)
    return described(changes, lambda path: path.removeprefix(f"{home}/")) or UNKNOWN_SOURCES


def recently_changed(table: FileTable) -> tuple[str, ...]:
    """Return the files with a new digest, except those that were not in the table."""
    return tuple(path for path, before in table.changed_files.items() if before is not None)


def changed_installed_files(
    record: BuildRecord, then: Mapping[str, str] | None, table: FileTable, root: Path, sources: str
) -> str:
    """Return which installed files differ from those of the last build, whose contents were `then`.

    A changed source also changes links to it: then `sources`, the change of the package's sources, is the
    reason.
    """
    paths = (*record.files, *record.folders)
    now = contents_of(paths, table)
    if then is None or not all(path in then for path in paths):
        gone = frozenset(path for path in paths if not os.path.lexists(path))
        return described(Changes(removed=gone), _from(root)) or UNKNOWN_INSTALLED
    changed = {path for path in paths if then[path] != now[path]}
    linked = {path for path in changed if _leads_as_before(path, then[path])}
    if linked == changed and sources:
        return sources
    changed = {os.path.realpath(path) if path in linked else path for path in changed}
    gone = frozenset(path for path in changed if not os.path.lexists(path))
    return described(Changes(removed=gone, modified=frozenset(changed) - gone), _from(root))


def changed_external_files(
    last: FolderRecord | None, record: BuildRecord, table: FileTable, root: Path, recent: Iterable[str]
) -> InputChange:
    """Return which files outside the package changed; `recent` are files that are known to have changed."""
    now = contents_of(record.externals, table)
    then = last.externals if last else None
    if then is not None:
        before = {path: then[path] for path in record.externals if path in then}
        changed = {path for path in before if before[path] != now[path]}
    else:
        before = {}
        gone = {path for path in record.externals if now[path] == _MISSING}
        changed = gone or {*record.externals}.intersection(recent)
    if questions := [each for each in changed if not each.startswith("/")]:
        return _changed_answers(questions, before)
    inside = bool(changed) and all(path.startswith(f"{root}/") for path in changed)
    kind = InputKind.OWN if inside else InputKind.OUTSIDE
    files = sorted(path for path in changed if not path.endswith(DIR_LISTING_SUFFIX))
    if not files:
        shown = _from(root)
        folders = [shown(path.removesuffix(DIR_LISTING_SUFFIX)) for path in sorted(changed)]
        if not folders:
            return InputChange(kind, UNKNOWN_EXTERNAL)
        if before and all(
            before[path].rpartition(" ")[2] == now[path].rpartition(" ")[2] for path in changed
        ):
            return InputChange(kind, f"the permissions of {_named(folders)} changed")
        return InputChange(kind, f"files were added to or removed from {_named(folders)}")
    added = frozenset(path for path in files if before.get(path) == _MISSING)
    removed = frozenset(path for path in files if now[path] == _MISSING)
    text = described(Changes(added, removed, frozenset(files) - added - removed), _from(root))
    return InputChange(kind, text if inside else f"the external input {text}")


def _changed_answers(questions: Collection[str], before: Mapping[str, str]) -> InputChange:
    """Return how answers about the environment changed; `before` contains the previous ones."""
    kind, what, start = next(
        row for row in _QUESTIONS if any(question.startswith(row[-1]) for question in questions)
    )
    if start == MODULES:
        return InputChange(kind, "Python finds different modules than in the last build")
    names = {each.removeprefix(start): each for each in sorted(questions) if each.startswith(start)}
    added = frozenset(name for name, question in names.items() if before.get(question) == "")
    first = "".join(f" '{name}'" for name in [*names][:1] if name)
    return InputChange(kind, f"the {what}{first} changed", tuple(names), added)


def described(changes: Changes, shown: Callable[[str], str]) -> str:
    """Return the changes as a sentence, '' for none; folders are only named without files."""
    parts = []
    for paths, verb in ((changes.modified, ""), (changes.added, "added"), (changes.removed, "removed")):
        files = sorted(path for path in paths if not path.endswith("/")) or sorted(paths)
        if files:
            were = f"{'was' if len(files) == 1 else 'were'} {verb}" if verb else "changed"
            parts.append(f"{_named([shown(path) for path in files])} {were}")
    return ", ".join(parts)


def _named(names: list[str]) -> str:
    rest = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return f"'{names[0]}'{rest}"


def _from(root: Path) -> Callable[[str], str]:
    """Return a function that shows paths in the workspace relative to its root."""
    return lambda path: path.removeprefix(f"{root}/")


def _leads_as_before(path: str, content: str) -> bool:
    """Return whether a path was and is a link to the same file, so that the target must have changed."""
    try:
        return content.startswith(f"link {os.readlink(path)} ")  # noqa: PTH115
    except OSError:
        return False


def forge_change(now: str, then: str) -> str:
    """Describe how forge changed; stamps have the parts of `forge.cli.preparation.forge_stamp`."""
    match then.split("\n"), now.split("\n"):
        case [old, _, _, _], [new, _, _, _] if old != new:
            return f"forge changed from version {old} to {new}"
        case [_, _, old, old_folder], [_, _, new, folder] if (old, old_folder) != (new, folder):
            return f"forge now runs in '{folder}' with Python {new}, not in '{old_folder}' with Python {old}"
        case _:
            return "forge itself changed"


def changed_options(now: Sequence[str], then: Sequence[str]) -> InputChange:
    """Describe the differences between options in the user's terms."""
    before, after = (
        [" ".join(argument.words) for argument in cmake_arguments(options[len(COMMON_OPTIONS) :])]
        for options in (then, now)
    )
    added = [option for option in after if option not in before]
    removed = [option for option in before if option not in after]
    digested = next((option for option in (*added, *removed) if option.startswith(_DIGESTED)), None)
    added, removed = (
        [option for option in options if not option.startswith(_DIGESTED)] for options in (added, removed)
    )
    for one, other in ((added, removed), (removed, added)):
        if FAST_ROSIDL in one:  # recorded if the user gave no option
            one.remove(FAST_ROSIDL)
            other.append("--no-fast-rosidl")
            break
    if not (added or removed):
        text = f"{digested.rpartition(' ')[0]} changed" if digested else "the order of its options changed"
        return InputChange(InputKind.OTHER if digested else InputKind.OPTION, text)
    if added and removed and added[0].startswith(ROSDISTRO) and removed[0].startswith(ROSDISTRO):
        old, new = removed[0].removeprefix(ROSDISTRO), added[0].removeprefix(ROSDISTRO)
        return InputChange(InputKind.OTHER, f"the ROS distribution changed from '{old}' to '{new}'")
    replaced = {option.partition("=")[0] for option in added}
    names = (*added, *(f"{each} (removed)" for each in removed if each.partition("=")[0] not in replaced))
    first = (added or removed)[0]
    values = {option.partition("=")[0]: option for option in removed if "=" in option}
    if old_value := values.get(first.partition("=")[0]) if added else None:
        return InputChange(InputKind.OPTION, f"the option '{old_value}' changed to '{first}'", names)
    verb = "added" if added else "removed"
    return InputChange(InputKind.OPTION, f"the option '{first}' was {verb}", names)
