"""`forge mixin`: named sets of options, used with `--mixin NAME`, and their repositories."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any

from forge.base.env_vars import expand_home, home, without_passwords
from forge.base.errors import Location, Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.files import read_file, replace_file
from forge.base.formats import read_yaml, yaml_text
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import option
from forge.cli.options import add_verb
from forge.plugins.mixins.mixins import (
    MIXIN_FOLDER,
    REPOSITORIES,
    Mixin,
    mixin_files,
    mixin_folders,
    parse_mixins,
    read_mixins,
)

_SIGNS = "+ new, * changed, . unchanged, - renamed to *.obsolete"


def _files() -> Any:
    return option("additional mixin files", default=(), metavar="FILE")


@frozen
class _AddOptions:
    name: str = option("name for the repository", positional=True, metavar="NAME")
    url: str = option("URL or path of its index, such as '.../index.yaml'", positional=True, metavar="URL")


@frozen
class _UpdateOptions:
    name: str | None = option(
        "only this repository (default: all)", positional=True, nargs="?", metavar="REPOSITORY"
    )


@frozen
class _RemoveOptions:
    name: str = option("name of the repository", positional=True, metavar="REPOSITORY")


@frozen
class _ListOptions(_UpdateOptions):
    mixin_files: tuple[str, ...] = _files()


@frozen
class _ShowOptions:
    of: str | None = option(
        "only mixins of this command, or with this name", positional=True, nargs="?", metavar="COMMAND"
    )
    name: str | None = option("only this mixin", positional=True, nargs="?", metavar="MIXIN")
    mixin_files: tuple[str, ...] = _files()


def register(parser: argparse.ArgumentParser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    add_verb(verbs, "add", "add a repository of mixins", _AddOptions, _add)
    summary = "fetch the mixins of repositories"
    add_verb(verbs, "update", summary, _UpdateOptions, _update, description=f"{summary}: {_SIGNS}")
    add_verb(verbs, "remove", "remove a repository and its mixins", _RemoveOptions, _remove)
    summary = "list repositories, mixin files, and the names of all mixins"
    add_verb(verbs, "list", summary, _ListOptions, _list)
    add_verb(verbs, "show", "print the options of mixins", _ShowOptions, _show)


def _add(options: _AddOptions) -> None:
    MixinRepositories(home(os.environ)).add(options.name, options.url)
    if sys.stderr.isatty():
        print(f"hint: 'forge mixin update {options.name}' fetches its mixins", file=sys.stderr)


def _update(options: _UpdateOptions) -> None:
    """Fetch all repositories; raise the problems at the end."""
    repositories = MixinRepositories(home(os.environ))
    problems: list[Problem] = []
    for name in repositories.selected(options.name):
        print(f"fetching {name}: {without_passwords(repositories.urls[name])} ...", flush=True)
        try:
            for change in repositories.update(name):
                if isinstance(change, Problem):
                    problems.append(change)
                else:
                    _print_change(change)
        except (SelectionError, WorkspaceError) as error:
            problems += error.problems
    raise_if_any(problems, SelectionError)


def _remove(options: _RemoveOptions) -> None:
    for change in MixinRepositories(home(os.environ)).remove(options.name):
        _print_change(change)


def _print_change(change: Change) -> None:
    print(f"  {change.sign} {change.path}{' -> *.obsolete' if change.sign == '-' else ''}", flush=True)


def _list(options: _ListOptions) -> None:
    """Print colcon's lines, and below each file the names of its mixins."""
    repositories = MixinRepositories(home(os.environ))
    mixins = _all_mixins(options)
    for name in repositories.selected(options.name):
        print(f"{name}: {without_passwords(repositories.urls[name])}")
        _print_files(repositories.files(name), mixins)
    if options.name is not None:
        return
    fetched = {path for name in repositories.urls for path in repositories.files(name)}
    others = dict.fromkeys(mixin.place for mixin in mixins if mixin.place and mixin.place not in fetched)
    if others:
        print("mixin files not associated with a repository")
        _print_files(others, mixins)
    print("built into forge")
    _print_names(mixin for mixin in mixins if mixin.place is None)


def _print_files(paths: Iterable[Path], mixins: Iterable[Mixin]) -> None:
    for path in paths:
        print(f"- {path}")
        _print_names(mixin for mixin in mixins if mixin.place == path)


def _print_names(mixins: Iterable[Mixin]) -> None:
    names: dict[str, list[str]] = {}
    for mixin in mixins:
        names.setdefault(mixin.verb, []).append(mixin.name)
    for verb, own in names.items():
        print(f"    {verb}: {', '.join(own)}")


def _show(options: _ShowOptions) -> None:
    mixins = _all_mixins(options)
    chosen = [
        mixin for mixin in mixins if options.of in {None, mixin.verb} and options.name in {None, mixin.name}
    ]
    # A single word is a command, else a mixin of any command.
    chosen = chosen or [mixin for mixin in mixins if options.name is None and mixin.name == options.of]
    if not chosen:
        wanted = f"'{options.name}' for '{options.of}'" if options.name else f"'{options.of}'"
        verbs = () if options.name else (mixin.verb for mixin in mixins)
        names = (*verbs, *(mixin.name for mixin in mixins))
        raise SelectionError(
            Problem(f"unknown mixin {wanted}", hint=did_you_mean(options.name or options.of or "", names))
        )
    verb = None
    for mixin in chosen:
        if mixin.verb != verb:
            print(f"{mixin.verb}:")
        verb = mixin.verb
        print(f"- {mixin.name}")
        for key, value in sorted(mixin.options.items()):
            print(f"  {key}: {value}")


def _all_mixins(options: _ListOptions | _ShowOptions) -> list[Mixin]:
    mixins = read_mixins(mixin_folders(os.environ), options.mixin_files)
    return [mixins[key] for key in sorted(mixins)]


_NAME = re.compile(r"[^\W_][\w.+-]*")
_FILE = re.compile(r"[^./\0][^/\0]*\.mixin")
_OBSOLETE = ".obsolete"
"""Suffix of files that are no longer in an index; they are not read."""
_LARGEST = 1_000_000
_SECONDS = 10
_SCHEMES = ("http", "https", "file")
_LEGAL = "%/:=&?~#+!$,;'@()*[]"
"""Characters of URLs that need no quoting."""
_EXAMPLE = "https://raw.githubusercontent.com/colcon/colcon-mixin-repository/master/index.yaml"


@frozen
class Change:
    """The change of a file by an update: '+' added, '*' changed, '.' unchanged, '-' renamed to *.obsolete."""

    sign: str
    path: Path


class MixinRepositories:
    """The repositories in the folder of a user's settings."""

    def __init__(self, home: Path) -> None:
        """Read the list; raises WorkspaceError if it is malformed."""
        self._list = home / REPOSITORIES
        self._files = home / MIXIN_FOLDER
        try:
            self.urls = read_yaml(read_file(self._list), self._list)
        except FileNotFoundError:
            self.urls = {}
        if not all(isinstance(text, str) for pair in self.urls.items() for text in pair):
            raise WorkspaceError(Problem("the file is not a mapping of names to URLs", Location(self._list)))

    def add(self, name: str, url: str) -> None:
        if not _NAME.fullmatch(name):
            hint = "use letters, digits, '_', '-', '+' and '.', and start with a letter or digit"
            raise SelectionError(Problem(f"invalid repository name '{name}'", hint=hint))
        if name in self.urls:
            hint = f"to replace it: forge mixin remove {name}"
            raise SelectionError(Problem(f"a repository named '{name}' already exists", hint=hint))
        self._write({**self.urls, name: _index_url(url)})

    def remove(self, name: str) -> Iterator[Change]:
        """Remove a repository and yield its files, which are renamed; raises SelectionError."""
        self._require(name)
        self._write({other: url for other, url in self.urls.items() if other != name})
        yield from map(_rename, self.files(name))

    def files(self, name: str) -> list[Path]:
        """Return the fetched files of a repository."""
        return list(mixin_files(self._files / name))

    def selected(self, name: str | None) -> list[str]:
        """Return the name, or all names, sorted; raises SelectionError for an unknown name."""
        if name is None:
            return sorted(self.urls)
        self._require(name)
        return [name]

    def update(self, name: str) -> Iterator[Change | Problem]:
        """Fetch all files of a repository; yield changes, and problems with single files.

        Raises SelectionError if the index cannot be fetched, WorkspaceError if it is malformed.
        """
        index = self.urls[name]
        file_names = set()
        shown = without_passwords(index)
        content = read_yaml(_content(index), Path(shown))
        entries = content.get("mixin")
        if not isinstance(entries, list) or not all(isinstance(entry, str) for entry in entries):
            hint = "the format is 'mixin:', below it '- NAME.mixin' for each file"
            raise WorkspaceError(
                Problem("the index has no list 'mixin' of file names", Location(shown), hint)
            )
        for entry in entries:
            change = _attempt(index, entry, self._files / name)
            if isinstance(change, Change):
                file_names.add(change.path.name)
                yield change
            else:
                file_names.add(entry.rpartition("/")[2])
                yield from change
        yield from (_rename(path) for path in self.files(name) if path.name not in file_names)

    def _require(self, name: str) -> None:
        if name not in self.urls:
            hint = did_you_mean(name, self.urls) or "'forge mixin list' lists the repositories"
            raise SelectionError(Problem(f"no mixin repository is named '{name}'", hint=hint))

    def _write(self, urls: dict[str, str]) -> None:
        replace_file(self._list, yaml_text(urls).encode())
        self.urls = urls


def _index_url(text: str) -> str:
    """Return the URL of an index, which may be given as a path; raises SelectionError."""
    scheme, separator, _ = text.partition("://")
    if not separator:
        path = expand_home(text).absolute()
        if not path.is_file():
            hint = f"give the path or URL of an index, such as {_EXAMPLE}"
            raise SelectionError(Problem(f"file '{text}' not found", hint=hint))
        return path.as_uri()
    if scheme not in _SCHEMES:
        hint = f"use {', '.join(_SCHEMES[:-1])} or {_SCHEMES[-1]}"
        raise SelectionError(Problem(f"cannot fetch mixins over '{scheme}'", hint=hint))
    return text


def _attempt(index: str, entry: str, folder: Path) -> Change | tuple[Problem, ...]:
    """Return the change by a file of an index, or the reason why it cannot be used."""
    try:
        return _fetch(index, entry, folder)
    except (SelectionError, WorkspaceError) as error:
        return error.problems


def _fetch(index: str, entry: str, folder: Path) -> Change:
    """Write a file of an index below the folder if it is well-formed; return the change.

    An index on a server cannot name files of this machine.
    """
    from urllib.parse import quote, unquote, urljoin, urlsplit

    try:
        url = urljoin(index, quote(entry, safe=_LEGAL))
        parts = urlsplit(url)
    except ValueError:
        raise SelectionError(Problem(f"the index names '{entry}', which is not a URL")) from None
    if parts.scheme not in _SCHEMES or (parts.scheme == "file" and urlsplit(index).scheme != "file"):
        raise SelectionError(Problem(f"the index names '{entry}', which is not on a server"))
    shown = without_passwords(url)
    name = unquote(PurePosixPath(parts.path).name)
    if not _FILE.fullmatch(name):
        raise SelectionError(Problem(f"the index names '{shown}', which is not a '*.mixin' file"))
    content = _content(url)
    list(parse_mixins(content, Path(shown)))
    path, before = folder / name, None
    with suppress(FileNotFoundError):
        before = read_file(path)
    if before == content:
        return Change(".", path)
    replace_file(path, content)
    return Change("+" if before is None else "*", path)


def _content(url: str) -> bytes:
    """Return the content of a URL; raises SelectionError."""
    from http.client import HTTPException
    from urllib.error import HTTPError, URLError
    from urllib.request import urlopen

    shown = without_passwords(url)
    try:
        with urlopen(url, timeout=_SECONDS) as response:  # noqa: S310  (the user named the index)
            content: bytes = response.read(_LARGEST + 1)
    except HTTPError as error:
        raise SelectionError(Problem(f"cannot fetch '{shown}': {error.code} {error.reason}")) from None
    except (OSError, HTTPException, ValueError) as error:
        reason = error.reason if isinstance(error, URLError) else error
        text = (isinstance(reason, OSError) and reason.strerror) or str(reason)
        raise SelectionError(Problem(f"cannot fetch '{shown}': {text.lower()}")) from None
    if len(content) > _LARGEST:
        raise SelectionError(Problem(f"cannot fetch '{shown}': it is larger than {_LARGEST} bytes"))
    return content


def _rename(path: Path) -> Change:
    os.replace(path, f"{path}{_OBSOLETE}")  # noqa: PTH105  (a suffix beside that of the name)
    return Change("-", path)
