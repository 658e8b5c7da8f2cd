"""`forge ignore`: ignore packages of the workspace with COLCON_IGNORE files, and list ignored ones."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from forge.base.errors import Problem, SelectionError, print_warnings
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import IGNORE_MARK
from forge.base.names import did_you_mean
from forge.base.options import flag, option, options_of
from forge.base.text import counted, listed
from forge.build.folder_marks import is_own_ignore_mark
from forge.cli.config import option_files
from forge.cli.options import displayed
from forge.plugins.ignore.ignoring import IgnoredPackage, ignored_packages
from forge.workspace.load import find_packages
from forge.workspace.model import Workspace
from forge.workspace.selection import Query, SearchPaths
from forge.workspace.selection import ignored as ignored_by

_TO_LIST = "'forge ignore --list' lists what is ignored"


@frozen
class Options:
    names: tuple[str, ...] = option(
        "packages or folders to ignore (default: list the ignored packages)",
        default=(),
        positional=True,
        metavar="PKG",
    )
    list: bool = flag("list the ignored packages, each with the file that hides it")
    undo: bool = flag("no longer ignore these packages or folders")
    json: bool = flag("print the list as JSON")
    search: SearchPaths = options_of(SearchPaths)
    origin: str = os.curdir


def run(options: Options) -> int:
    """Create or remove the marks of the named packages, or list the ignored packages."""
    root = Path.cwd()
    workspace = find_packages(root, options.search, os.environ)
    hidden = list(ignored_packages(root, options.search.base_paths, os.environ))
    if options.undo and not options.names:
        raise SelectionError(Problem("'--undo' needs the name of a package or a folder", hint=_TO_LIST))
    if options.names and not options.list:
        for word in options.names:
            (_unmark if options.undo else _mark)(word, workspace, hidden, options)
        return 0
    _list(workspace, hidden, options)
    return 0


def _mark(word: str, workspace: Workspace, hidden: Iterable[IgnoredPackage], options: Options) -> None:
    packages = [each for each in workspace.all_packages if each.name == word]
    ignored_package = next((each for each in hidden if each.name == word and not packages), None)
    if ignored_package:
        print(f"'{word}' is ignored already, because of '{displayed(ignored_package.file, options.origin)}'")
        return
    folders = [each.path for each in packages] or _folders_of(word, workspace, hidden, options)
    if len(folders) > 1:
        paths = listed([displayed(path, options.origin) for path in folders])
        hint = "give the path of the one to ignore"
        raise SelectionError(Problem(f"several packages are named '{word}': {paths}", hint=hint))
    mark = folders[0] / IGNORE_MARK
    shown = displayed(mark, options.origin)
    if os.path.lexists(mark):
        print(f"'{word}' is ignored already, because of '{shown}'")
        return
    newly_ignored = [each.name for each in workspace.all_packages if each.path.is_relative_to(folders[0])]
    write_if_changed(mark, "")
    print(f"ignored {listed(newly_ignored) if newly_ignored else repr(word)}: created '{shown}'")
    needed: dict[str, list[str]] = {}
    for each in workspace.all_packages:
        for dependency in () if each.name in newly_ignored else each.manifest.dependencies:
            if dependency.name in newly_ignored:
                needed.setdefault(dependency.name, []).append(each.name)
    print_warnings(
        Problem(f"'{name}' must be installed elsewhere for {listed(sorted(users))}")
        for name, users in sorted(needed.items())
    )


def _unmark(word: str, workspace: Workspace, hidden: Iterable[IgnoredPackage], options: Options) -> None:
    matches = [each for each in hidden if each.name == word]
    if not matches and word in workspace.packages:
        raise SelectionError(Problem(f"'{word}' is not ignored", hint=_TO_LIST))
    if len(matches) > 1:
        paths = listed([displayed(each.path, options.origin) for each in matches])
        hint = "give the path of the package to include again"
        raise SelectionError(Problem(f"several ignored packages are named '{word}': {paths}", hint=hint))
    folder = matches[0].path if matches else _folders_of(word, workspace, hidden, options)[0]
    mark = folder / IGNORE_MARK
    shown = displayed(mark, options.origin)
    if not os.path.lexists(mark):
        if not matches:
            message = f"'{word}' is not ignored: there is no '{shown}'"
            raise SelectionError(Problem(message, hint=_TO_LIST))
        raise SelectionError(_hidden_elsewhere(matches[0], hidden, options))
    if not is_own_ignore_mark(mark):
        hint = "remove it yourself if nobody needs it"
        raise SelectionError(Problem(f"'{shown}' is not empty, so forge did not write it", hint=hint))
    mark.unlink()
    print(f"no longer ignored: '{word}' (removed '{shown}')")


def _hidden_elsewhere(package: IgnoredPackage, hidden: Iterable[IgnoredPackage], options: Options) -> Problem:
    file = displayed(package.file, options.origin)
    message = f"'{package.name}' is ignored because of '{file}'"
    if not package.is_marked:
        return Problem(f"{message}: packages are not searched below another package", hint="move one of them")
    others = sum(each.file == package.file for each in hidden) - 1
    also = f", like {counted(others, 'other package')}" if others else ""
    hint = package.remedy or "forge did not write this file: remove it yourself if nobody needs it"
    return Problem(message + also, hint=hint)


def _folders_of(
    word: str, workspace: Workspace, hidden: Iterable[IgnoredPackage], options: Options
) -> list[Path]:
    """Return the folder that a word refers to, relative to the root; raises SelectionError."""
    path = Path(os.path.normpath(workspace.root / options.origin / word))
    if not path.is_dir():
        hint = did_you_mean(word, {*workspace.packages, *(each.name for each in hidden)})
        raise SelectionError(Problem(f"there is no package or folder '{word}'", hint=hint))
    inside = next((each for each in hidden if workspace.root / each.path == path), None)
    if inside and not options.undo:
        return [inside.file.parent]
    if path == workspace.root or not path.is_relative_to(workspace.root):
        what = "is the workspace itself" if path == workspace.root else "is not in the workspace"
        raise SelectionError(Problem(f"'{word}' {what}", hint="give the name of a package, or its folder"))
    return [path.relative_to(workspace.root)]


def _list(workspace: Workspace, hidden: Iterable[IgnoredPackage], options: Options) -> None:
    """Print the packages that files hide, then those that options in files ignore for `forge build`."""
    entries: list[tuple[str, Path, Path, str]]
    entries = [(each.name, each.path, each.file, _reason(each)) for each in hidden]
    for file, values in option_files("build", {}, workspace.root, os.environ):
        names, patterns = (
            tuple(map(str, given)) if isinstance(given := values.get(f"packages-{key}", ()), list) else ()
            for key in ("ignore", "ignore-regex")
        )
        ignored = ignored_by(Query(ignore=names, ignore_regex=patterns), workspace.packages)
        reason = "named by '--packages-ignore' of 'forge build'"
        shown = file.relative_to(workspace.root) if file.is_relative_to(workspace.root) else file
        entries += ((name, workspace.packages[name].path, shown, reason) for name in sorted(ignored))
    rows = [
        (name, displayed(path, options.origin), displayed(file, options.origin), reason)
        for name, path, file, reason in sorted(entries, key=lambda each: (each[1], each[0]))
    ]
    if options.json:
        keys = ("name", "path", "file", "reason")
        print(json.dumps([dict(zip(keys, row, strict=True)) for row in rows], indent=2))
        return
    for row in rows:
        print("{}\t{}\t{}: {}".format(*row))
    if not rows:
        print("no package is ignored")


def _reason(package: IgnoredPackage) -> str:
    if not package.is_marked:
        return "packages are not searched below another package"
    return "this file" if package.file.parent == package.path else "this file in a folder around it"
