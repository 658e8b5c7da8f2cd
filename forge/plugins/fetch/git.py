"""What git is asked for: the commits of tags, the tree of a commit, and a repository with one commit.

The user's configuration applies, for credentials, proxies and mirrors (`url.<base>.insteadOf`).
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterable
from pathlib import Path

from forge.base.env_vars import without_passwords
from forge.base.errors import ForgeError, HostError, Problem

_BATCH = 100
"""Tags in one request, for the length of a command line."""

_SETTINGS = ("core.hooksPath=/dev/null", "core.autocrlf=false", "core.fsmonitor=", "gc.auto=0")
_PLAIN = tuple(word for setting in _SETTINGS for word in ("-c", setting))
_REFS = (("tags", "^{}"), ("tags", ""), ("heads", ""))
"""Kinds of references and endings, the most specific first: 'NAME^{}' is what an annotated tag refers to."""


MARK = "Fetched by forge: "
"""How the description of a repository in the cache begins."""


class GitError(ForgeError):
    """git failed, for example because a repository does not exist."""


def commits_of(url: str, tags: Iterable[str]) -> dict[str, str]:
    """Return the commits of those tags, or branches, that a remote repository has; raises GitError."""
    names = sorted(set(tags))
    commits: dict[str, str] = {}
    for start in range(0, len(names), _BATCH):
        batch = names[start : start + _BATCH]
        patterns = [f"refs/{kind}/{name}{end}" for name in batch for kind, end in _REFS]
        found = dict(line.split("\t")[::-1] for line in _git("ls-remote", "--", url, *patterns).splitlines())
        for name in batch:
            refs = [f"refs/{kind}/{name}{end}" for kind, end in _REFS]
            if commit := next((found[ref] for ref in refs if ref in found), None):
                commits[name] = commit
    return commits


def check_out(url: str, ref: str, commit: str, folder: Path) -> None:
    """Write the tree of a commit to a new folder, without the repository.

    `ref` is the tag to ask for, since not every server sends single commits. Raises GitError, also if the tag
    names another commit.
    """
    repository = folder / ".git"
    _receive(url, ref, commit, repository)
    tree = (f"--git-dir={repository}", f"--work-tree={folder}")
    _git(*tree, *_PLAIN, "checkout", "--quiet", "--force", commit)


def mirror(url: str, ref: str, commit: str, folder: Path) -> None:
    """Make a bare repository that has only this commit, as the tag `ref` and as the branch 'main'."""
    _receive(url, ref, commit, folder)
    for name in ("refs/heads/main", f"refs/tags/{ref}"):
        _git(f"--git-dir={folder}", "update-ref", name, commit)
    (folder / "description").write_text(f"{MARK}{without_passwords(url)}\n", encoding="utf-8")


def fault(folder: Path, commit: str) -> str:
    """Return what is wrong with a repository that `mirror` has made, '' if nothing is."""
    repository = f"--git-dir={folder}"
    try:
        if _git(repository, "rev-parse", "refs/heads/main").strip() != commit:
            return f"its branch is not the commit {commit}"
        _git(repository, *_PLAIN, "fsck", "--full", "--no-dangling", "--no-progress")
    except GitError as error:
        return error.problems[0].message
    return ""


def _receive(url: str, ref: str, commit: str, repository: Path) -> None:
    _git("init", "--quiet", "--bare", "--initial-branch=main", "--template=", os.fspath(repository))
    _git(f"--git-dir={repository}", *_PLAIN, "fetch", "--quiet", "--depth=1", "--no-tags", "--", url, ref)
    received = _git(f"--git-dir={repository}", "rev-parse", "--verify", "FETCH_HEAD^{commit}").strip()
    if received != commit:
        message = f"the tag '{ref}' of '{without_passwords(url)}' was moved: it is {received}, not {commit}"
        raise GitError(Problem(message, hint="if that is right: forge fetch --update"))


def _git(*words: str) -> str:
    variables = {**os.environ, "GIT_TERMINAL_PROMPT": "0", "LC_ALL": "C"}
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY"):
        variables.pop(name, None)
    try:
        done = subprocess.run(
            ("git", *words), env=variables, stdin=subprocess.DEVNULL, capture_output=True, check=False
        )
    except FileNotFoundError:
        hint = "install it, for example with `apt install git`"
        raise HostError(Problem("git is not installed", hint=hint)) from None
    if done.returncode:
        lines = (line.removeprefix("fatal: ") for line in os.fsdecode(done.stderr).splitlines())
        reason = next((line for line in lines if line and not line.startswith(("warning:", "hint:"))), "")
        raise GitError(Problem(without_passwords(reason or "git failed")))
    return os.fsdecode(done.stdout)
