"""Repositories of mixins, as of colcon-mixin: an index lists *.mixin files, which an update fetches.

`mixin_repositories.yaml` in the folder of the user's settings contains the URL of each index by name, and
`mixin`/NAME the fetched files. Both are shared with colcon.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from forge.base.env_vars import expand_home, without_passwords
from forge.base.errors import Location, Problem, SelectionError, WorkspaceError
from forge.base.files import read_file, replace_file
from forge.base.formats import read_yaml, yaml_text
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.cli.mixins import MIXIN_FOLDER, REPOSITORIES, mixin_files, parse_mixins

_NAME = re.compile(r"[^\W_][\w.+-]*")
_FILE = re.compile(r"[^./\0][^/\0]*\.mixin")
_OBSOLETE = ".obsolete"
"""Suffix of files that are no longer in an index; they are not read any more."""
_LARGEST = 1_000_000
_SECONDS = 10
_SCHEMES = ("http", "https", "file")
_LEGAL = "%/:=&?~#+!$,;'@()*[]"
"""Characters of URLs that need no quoting."""
_EXAMPLE = "https://raw.githubusercontent.com/colcon/colcon-mixin-repository/master/index.yaml"


@frozen
class Change:
    """What an update did to a file: '+' added, '*' changed, '.' unchanged, '-' renamed to *.obsolete."""

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
        """Add a repository; `url` may also be the path of an index. Raises SelectionError."""
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
        kept = set()
        for entry in _entries(index):
            change = _attempt(index, entry, self._files / name)
            if isinstance(change, Change):
                kept.add(change.path.name)
                yield change
            else:
                kept.add(entry.rpartition("/")[2])
                yield from change
        yield from (_rename(path) for path in self.files(name) if path.name not in kept)

    def _require(self, name: str) -> None:
        if name not in self.urls:
            hint = did_you_mean(name, self.urls) or "'forge mixin list' lists the repositories"
            raise SelectionError(Problem(f"no mixin repository is named '{name}'", hint=hint))

    def _write(self, urls: dict[str, str]) -> None:
        replace_file(self._list, yaml_text(urls).encode())
        self.urls = urls


def _index_url(text: str) -> str:
    """Return the URL of an index, also if it is given as a path; raises SelectionError."""
    scheme, separator, _ = text.partition("://")
    if not separator:
        path = expand_home(text).absolute()
        if not path.is_file():
            hint = f"give the path or URL of an index, such as {_EXAMPLE}"
            raise SelectionError(Problem(f"there is no file '{text}'", hint=hint))
        return path.as_uri()
    if scheme not in _SCHEMES:
        hint = f"use {', '.join(_SCHEMES[:-1])} or {_SCHEMES[-1]}"
        raise SelectionError(Problem(f"cannot fetch mixins by '{scheme}'", hint=hint))
    return text


def _entries(index: str) -> list[str]:
    """Return the paths and URLs that an index lists."""
    shown = without_passwords(index)
    content = read_yaml(_content(index), Path(shown))
    entries = content.get("mixin")
    if not isinstance(entries, list) or not all(isinstance(entry, str) for entry in entries):
        hint = "the format is 'mixin:', below it '- NAME.mixin' for each file"
        raise WorkspaceError(Problem("the index has no list 'mixin' of file names", Location(shown), hint))
    return entries


def _attempt(index: str, entry: str, folder: Path) -> Change | tuple[Problem, ...]:
    """Return what a file of an index changed, or why it cannot be used."""
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
        raise SelectionError(Problem(f"the index names '{entry}', which is no URL")) from None
    if parts.scheme not in _SCHEMES or (parts.scheme == "file" and urlsplit(index).scheme != "file"):
        raise SelectionError(Problem(f"the index names '{entry}', which is not on a server"))
    shown = without_passwords(url)
    name = unquote(PurePosixPath(parts.path).name)
    if not _FILE.fullmatch(name):
        raise SelectionError(Problem(f"the index names '{shown}', which is no '*.mixin'"))
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
    """Return what a URL names; raises SelectionError."""
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
