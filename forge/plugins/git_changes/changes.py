"""Compares files with a git revision, without running programs that a repository configures.

git only resolves revisions and lists trees, the index and untracked files. It does not read tracked files,
which would run filters, write the index, which would run a hook, or fetch missing objects, which would run a
transport. forge compares the files itself. A file that git converted at checkout, by a filter or by changing
its line endings, is unchanged only according to the index; otherwise it counts as changed.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cached_property
from pathlib import Path

from forge.base.errors import Location, Problem, SelectionError, raise_if_any
from forge.base.frozen import frozen
from forge.base.text import listed
from forge.workspace.model import Package

_LINK, _PROGRAM, _FILE, _SUBMODULE = "120000", "100755", "100644", "160000"
_INDEX = re.compile(
    rb"(\d{6}) ([0-9a-f]+) \d\t([^\0]+)\0"
    rb"(?:  ctime: (\d+):(\d+)\n  mtime: (\d+):(\d+)\n  dev: \d+\tino: (\d+)\n  uid: \d+\tgid: \d+\n"
    rb"  size: (\d+)\tflags: ([0-9a-f]+)\n)?"
)
"""An entry in the output of 'git ls-files --stage --debug -z'."""
_NOT_IN_SPARSE_CHECKOUT = 1 << 30
_FETCH = "'git fetch --unshallow' or, in a CI job, a checkout with 'fetch-depth: 0'"


@frozen
class _Entry:
    """A file in a tree or in the index: its mode and the hash of its contents."""

    mode: str
    digest: str
    status: tuple[int, ...] = field(default=(), compare=False)
    """In the index: times in nanoseconds, inode and size (modulo 2**32) of the file with these contents."""
    sparse: bool = field(default=False, compare=False)


class GitError(SelectionError):
    """A repository cannot be compared with the revision."""


class Repository:
    """A repository and its state; git is queried once, on demand."""

    def __init__(self, top: Path, revision: str, repositories: Mapping[Path, Repository]) -> None:
        """`repositories` returns the other repositories."""
        self.top = top
        self._revision = revision
        self._repositories = repositories
        self.incomplete: Problem | None = None
        """Why all files count as changed."""

    @cached_property
    def superproject(self) -> Repository | None:
        """The repository of which this one is a submodule, now or at the revision."""
        above = repository_of(self.top.parent)
        if above is None:
            return None
        other, path = self._repositories[above], os.fspath(self.top.relative_to(above))
        try:
            entry = other.index.get(path)
            if entry is None or entry.mode != _SUBMODULE:
                entry = other.tree.get(path)
            return other if entry and entry.mode == _SUBMODULE else None
        except GitError:
            # An unrelated repository, for example of a home folder.
            return None

    @cached_property
    def tree(self) -> Mapping[str, _Entry]:
        """The files at the revision.

        A submodule is compared with the commit that its superproject records at the revision, even if the
        submodule has a revision of the same name.
        """
        if self.superproject is None:
            commit = self._resolved()
        else:
            recorded = self.superproject.tree.get(os.fspath(self.top.relative_to(self.superproject.top)))
            if recorded is None or recorded.mode != _SUBMODULE:
                return {}
            commit = recorded.digest
        try:
            output = self._git("ls-tree", "-r", "-z", commit)
        except GitError:
            message = f"commit {commit[:12]} is missing: all packages in this repository count as changed"
            self.incomplete = Problem(message, Location(self.top), f"fetch it, for example with {_FETCH}")
            return {}
        entries = {}
        for line in output.split(b"\0")[:-1]:
            what, _, name = line.partition(b"\t")
            mode, _, digest = what.decode().split(" ")
            entries[os.fsdecode(name)] = _Entry(mode, digest)
        return entries

    @cached_property
    def index(self) -> Mapping[str, _Entry]:
        entries = {}
        for match in _INDEX.finditer(self._git("ls-files", "--stage", "--debug", "-z")):
            mode, digest = match[1].decode(), match[2].decode()
            status: tuple[int, ...] = ()
            sparse = False
            if match[4] is not None:
                changed, changed_ns, modified, modified_ns, inode, size = map(int, match.groups()[3:9])
                status = (changed * 10**9 + changed_ns, modified * 10**9 + modified_ns, inode, size)
                sparse = bool(int(match[10], 16) & _NOT_IN_SPARSE_CHECKOUT)
            entries[os.fsdecode(match[3])] = _Entry(mode, digest, status, sparse)
        return entries

    @cached_property
    def untracked(self) -> tuple[str, ...]:
        """The files that git neither tracks nor ignores."""
        output = self._git("ls-files", "--others", "--exclude-standard", "-z")
        return tuple(os.fsdecode(name) for name in output.split(b"\0") if name)

    @cached_property
    def files(self) -> frozenset[Path]:
        """All files that git tracks or does not ignore, and the folders that contain them."""
        return _with_folders(self.top / name for name in (*self.tree, *self.index, *self.untracked))

    @cached_property
    def changes(self) -> frozenset[Path]:
        """The files that differ from the revision, also in submodules, and the folders that contain them."""
        return _with_folders(self._changed())

    def _changed(self) -> Iterator[Path]:
        yield from (self.top / name for name in self.untracked)
        for name in self.tree.keys() | self.index.keys():
            path, base, indexed = self.top / name, self.tree.get(name), self.index.get(name)
            if (base and base.mode == _SUBMODULE) or (indexed and indexed.mode == _SUBMODULE):
                if is_repository(path):
                    yield from self._repositories[path].changes
                elif base != indexed:
                    yield path
            elif (base is None and os.path.lexists(path)) or (base and self._differs(path, base, indexed)):
                yield path

    def _differs(self, path: Path, base: _Entry, indexed: _Entry | None) -> bool:
        try:
            status = path.lstat()
            size, inode = status.st_size % 2**32, status.st_ino % 2**32
            recorded = (status.st_ctime_ns, status.st_mtime_ns, inode, size)
            if indexed and indexed.status == recorded and status.st_mtime_ns < self._index_time:
                return base != indexed
            return base != self._contents(path, status, base, indexed)
        except (FileNotFoundError, NotADirectoryError):
            return not (indexed and indexed.sparse and indexed == base)
        except OSError:
            return True

    def _contents(self, path: Path, status: os.stat_result, base: _Entry, indexed: _Entry | None) -> _Entry:
        """Return the mode and the hash that git computes for this file, unless it converts the contents."""
        digest = hashlib.new("sha256" if len(base.digest) == 64 else "sha1", usedforsecurity=False)
        if stat.S_ISLNK(status.st_mode):
            target = os.fsencode(path.readlink())
            digest.update(b"blob %d\0%s" % (len(target), target))
            return _Entry(_LINK, digest.hexdigest())
        if not stat.S_ISREG(status.st_mode):
            return _Entry("", "")
        with path.open("rb") as stream:
            digest.update(b"blob %d\0" % os.fstat(stream.fileno()).st_size)
            while chunk := stream.read(1 << 20):
                digest.update(chunk)
        mode = _PROGRAM if status.st_mode & stat.S_IXUSR else _FILE
        return _Entry(mode if self._tracks_modes else (indexed or base).mode, digest.hexdigest())

    @cached_property
    def _tracks_modes(self) -> bool:
        return self._git("config", "--type=bool", "--default=true", "core.fileMode").strip() == b"true"

    @cached_property
    def _index_time(self) -> int:
        """The time before which files with a recorded status have the recorded contents."""
        path = self._git("rev-parse", "--git-path", "index").removesuffix(b"\n")
        return (self.top / os.fsdecode(path)).stat().st_mtime_ns

    def _resolved(self) -> str:
        """Return the commit of the revision in this repository; 'REV...' is the merge base with HEAD."""
        revision = self._revision
        inside = self._git("rev-parse", "--show-cdup")
        if inside.strip():
            raise self._error("not a git repository", "remove its .git folder, or clone it again")
        try:
            if revision.endswith("..."):
                words = ("merge-base", "--", revision.removesuffix("..."), "HEAD")
            else:
                words = ("rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}")
            commit = os.fsdecode(self._git(*words)).strip()
        except GitError:
            commit = ""
        if re.fullmatch("[0-9a-f]{40,64}", commit):
            return commit
        if self._git("rev-parse", "--is-shallow-repository").strip() == b"true":
            raise self._error("unknown revision", f"this is a shallow clone: get its history with {_FETCH}")
        hint = "use '--since REV' with a revision that exists in all repositories of the workspace"
        raise self._error("unknown revision", hint)

    def _error(self, reason: str, hint: str) -> GitError:
        message = f"git cannot determine changes since '{self._revision}': {reason}"
        return GitError(Problem(message, Location(self.top), hint))

    def _git(self, *words: str) -> bytes:
        # Variables may point to another repository, for example in a hook. An empty fsmonitor disables it.
        variables = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith("GIT_") or name.startswith("GIT_CONFIG_")
        }
        variables |= {"GIT_ALLOW_PROTOCOL": "none", "GIT_NO_LAZY_FETCH": "1", "GIT_OPTIONAL_LOCKS": "0"}
        try:
            return subprocess.run(
                ("git", "-C", os.fspath(self.top), "-c", "core.fsmonitor=", *words),
                capture_output=True,
                check=True,
                stdin=subprocess.DEVNULL,
                env=variables | {"LC_ALL": "C"},
            ).stdout
        except FileNotFoundError:
            message = "cannot determine changed files: git is not installed"
            raise SelectionError(Problem(message)) from None
        except subprocess.CalledProcessError as error:
            reason = os.fsdecode(error.stderr).strip().partition("\n")[0]
            if "dubious ownership" in reason or "unsafe repository" in reason:
                hint = f"if you trust it, run 'git config --global --add safe.directory {self.top}'"
                raise self._error("another user owns the repository", hint) from None
            raise self._error(reason, "check the repository with 'git fsck'") from None


class Repositories(dict[Path, Repository]):
    """All repositories by their top folders, created on demand."""

    def __init__(self, revision: str) -> None:
        """`revision` is resolved in each repository that is not a submodule."""
        super().__init__()
        self._revision = revision

    def __missing__(self, top: Path) -> Repository:
        self[top] = Repository(top, self._revision, self)
        return self[top]


def changed_packages(
    root: Path, packages: Mapping[str, Package], revision: str
) -> tuple[frozenset[str], tuple[Problem, ...]]:
    """Return the names of packages with files that differ from a git revision, and warnings.

    Untracked files count unless ignored. A package outside all repositories counts as changed. Raises
    SelectionError for an unknown revision, and if there is no repository.
    """
    repositories = Repositories(revision)

    def is_moved(path: Path) -> bool:
        for ancestor in (root / path, *(root / path).parents):
            if ancestor == root:
                break
            link = ancestor.parent.resolve() / ancestor.name
            if (
                ancestor.is_symlink()
                and (top := repository_of(link.parent))
                and link in repositories[top].changes
            ):
                return True
        return False

    used_repositories: set[Path] = set()
    changed_names: set[str] = set()
    outside: list[str] = []
    problems: list[Problem] = []
    for name, package in packages.items():
        folder = (root / package.path).resolve()
        top = repository_of(folder)
        if top is None:
            outside.append(name)
            continue
        try:
            used_repositories.add(top)
            if folder not in repositories[top].files:
                outside.append(name)
            elif folder in repositories[top].changes or is_moved(package.path):
                changed_names.add(name)
        except GitError as error:
            problems += error.problems
    raise_if_any(dict.fromkeys(problems), SelectionError)
    if outside and len(outside) == len(packages):
        hint = "select packages by name, for example with '--packages-select', or run 'git init'"
        message = "cannot determine changed packages: none of them is in a git repository"
        raise SelectionError(Problem(message, hint=hint))
    warnings = []
    if outside:
        are, count = ("is", "counts") if len(outside) == 1 else ("are", "count")
        text = f"{listed(outside)} {are} in no git repository and always {count} as changed"
        warnings.append(Problem(text))
    warnings += (problem for _, other in sorted(repositories.items()) if (problem := other.incomplete))
    independent = [str(top) for top in sorted(used_repositories) if repositories[top].superproject is None]
    if len(independent) > 1 and revision != "HEAD":
        count = f"{len(independent)} repositories: {listed(independent)}"
        warnings.append(Problem(f"'{revision}' is resolved separately in {count}"))
    return frozenset(changed_names).union(outside), tuple(warnings)


def is_repository(folder: Path) -> bool:
    """Return whether a folder is the top of a work tree."""
    mark = folder / ".git"
    return mark.is_file() or os.path.lexists(mark / "HEAD")


def repository_of(folder: Path) -> Path | None:
    """Return the top folder of the repository that contains `folder`, which has no links in its path."""
    return next((path for path in (folder, *folder.parents) if is_repository(path)), None)


def _with_folders(paths: Iterator[Path]) -> frozenset[Path]:
    all_paths: set[Path] = set()
    for path in paths:
        for folder in (path, *path.parents):
            if folder in all_paths:
                break
            all_paths.add(folder)
    return frozenset(all_paths)
