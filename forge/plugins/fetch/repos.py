"""Repositories in files of vcs: `--export`, and `--import`, whose packages replace those of the index."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from forge.base.env_vars import without_passwords
from forge.base.errors import (
    ForgeError,
    HostError,
    Location,
    Problem,
    WorkspaceError,
    print_warnings,
    raise_if_any,
)
from forge.base.files import DRAFT, read_file, read_text
from forge.base.formats import read_yaml, yaml_text
from forge.base.frozen import frozen
from forge.plugins.fetch import git
from forge.plugins.fetch.index import Release, Snapshot
from forge.plugins.fetch.lock import LockedPackage
from forge.plugins.fetch.sources import in_parallel, place_package
from forge.workspace.discovery import discover

_COMMIT = re.compile(r"[0-9a-f]{40}")


@frozen
class _Repository:
    url: str
    version: str
    """A tag, branch or commit, or HEAD."""


@frozen
class Imports:
    """The packages in repositories, by name, with their manifests."""

    packages: Mapping[str, LockedPackage]
    releases: Mapping[str, Release]


def import_packages(path: Path, snapshot: Snapshot, cache: Path) -> Imports:
    """Return the packages in the repositories that a file names, at their current commits.

    For a tag of the index, the packages of the index are used; other repositories are downloaded and
    searched. Raises WorkspaceError for a malformed file, HostError if a repository cannot be read.
    """
    of_index = {(each.repository, each.tag): each for each in snapshot.releases.values()}

    def read(repository: _Repository) -> list[tuple[LockedPackage, Release]]:
        tag, commit = _commit(repository)
        release = of_index.get((repository.url, tag))
        if release:
            return [(LockedPackage(release.name, release.version, repository.url, tag, commit), release)]
        return _packages(repository.url, tag, commit, snapshot.distribution, cache)

    packages: dict[str, LockedPackage] = {}
    releases: dict[str, Release] = {}
    problems: list[Problem] = []
    for repository, result in in_parallel(read, _repositories(path)):
        url = without_passwords(repository.url)
        if isinstance(result, ForgeError):
            problems += (
                Problem(f"cannot import '{url}': {each.message}", each.location, each.hint)
                for each in result.problems
            )
            continue
        if not result:
            print_warnings([Problem(f"'{url}' has no packages at '{repository.version}'", Location(path))])
        for package, release in result:
            if package.name in packages:
                others = f"'{without_passwords(packages[package.name].repository)}' and '{url}'"
                problems.append(Problem(f"the package '{package.name}' is in {others}", Location(path)))
            packages[package.name], releases[package.name] = package, release
    raise_if_any(problems, HostError)
    return Imports(packages, releases)


def repos_text(packages: Iterable[LockedPackage]) -> str:
    """Return the text of a repositories file that lists each repository once, for import."""
    entries: dict[tuple[str, str], str] = {}
    for each in packages:
        name = each.name if not each.path else each.repository.rpartition("/")[2].removesuffix(".git")
        entries.setdefault((each.repository, each.tag), name)
    rows = {name: {"type": "git", "url": url, "version": tag} for (url, tag), name in entries.items()}
    return yaml_text({"repositories": rows})


def _repositories(path: Path) -> list[_Repository]:
    if not path.is_file():
        raise WorkspaceError(Problem(f"--import: '{path}' is not a file"))
    content = read_yaml(read_file(path), path)
    entries = content.get("repositories") if isinstance(content, dict) else None
    if not isinstance(entries, dict):
        hint = "it needs the key 'repositories', as in 'forge fetch --export FILE'"
        raise WorkspaceError(Problem("not a list of repositories", Location(path), hint))
    repositories: dict[_Repository, None] = {}
    problems = []
    for name, entry in entries.items():
        fields = entry if isinstance(entry, dict) else {}
        url, kind = fields.get("url"), fields.get("type", "git")
        if kind != "git":
            problems.append(Problem(f"'{name}' is of type '{kind}': forge imports only git", Location(path)))
        elif not isinstance(url, str) or url.startswith("-"):
            problems.append(Problem(f"'{name}' has no valid 'url'", Location(path)))
        else:
            repository = _Repository(url, str(fields.get("version") or "HEAD"))
            repositories[repository] = None
    raise_if_any(problems, WorkspaceError)
    return list(repositories)


def _commit(repository: _Repository) -> tuple[str, str]:
    """Return a tag and its commit; for a branch or a commit, return the commit twice."""
    url, version = repository.url, repository.version
    if _COMMIT.fullmatch(version):
        return version, version
    if commit := git.commits_of(url, [version], branches=False).get(version):
        return version, commit
    if commit := git.commits_of(url, [version]).get(version):
        return commit, commit
    hint = "write commits with all 40 digits"
    raise git.GitError(Problem(f"it has no tag or branch '{version}'", hint=hint))


def _packages(
    url: str, tag: str, commit: str, distribution: str, cache: Path
) -> list[tuple[LockedPackage, Release]]:
    """Download a repository, and store each package in it as if it had been downloaded separately."""
    packages = []
    (cache / "sources").mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(DRAFT, ".", cache / "sources") as folder:
        tree = Path(folder, "tree")
        tree.mkdir()
        git.check_out(url, tag, commit, tree)
        workspace = discover(tree, ["."], {"ROS_DISTRO": distribution})
        raise_if_any(workspace.problems, WorkspaceError)
        for name, package in sorted(workspace.packages.items()):
            manifest = tree / package.path / "package.xml"
            if not manifest.is_file():
                continue  # no package can depend on it
            path = package.path.as_posix()
            locked = LockedPackage(
                name, package.manifest.version, url, tag, commit, "" if path == "." else path
            )
            place_package(tree, locked, cache)
            text = read_text(manifest)
            packages.append((locked, Release(name, locked.version, url, tag, text)))
    return packages
