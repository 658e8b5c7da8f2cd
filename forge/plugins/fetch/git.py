"""Queries with git: commits of tags, the tree of a commit, and a repository with a single commit.

The user's configuration applies, for credentials, proxies and mirrors (`url.<base>.insteadOf`).
All functions raise OSError if the disk is full.
"""

from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from forge.base.env_vars import without_passwords
from forge.base.errors import ForgeError, HostError, Problem

_BATCH = 100
"""The maximum number of tags in one request, limited by the length of a command line."""

_SETTINGS = (
    "core.hooksPath=/dev/null",
    "core.autocrlf=false",
    "core.fsmonitor=",
    "gc.auto=0",
    "fetch.unpackLimit=1",
)
_PLAIN = tuple(word for setting in _SETTINGS for word in ("-c", setting))
_REFS = (("tags", "^{}"), ("tags", ""), ("heads", ""))
"""Kinds of references and endings, the most specific first.

'NAME^{}' is the commit that an annotated tag refers to.
"""


MARK = "Fetched by forge: "
"""The start of the description of a cached repository."""


_PAUSES = (1, 3)
"""Seconds before a request that failed because of the network is repeated."""
_NETWORK = re.compile(
    r"could not resolve host|connection (?:was )?(?:reset|refused|timed out|closed)|failed to connect"
    r"|timed? ?out|returned error: (?:429|5\d\d)|network is (?:down|unreachable)|no route to host"
    r"|early eof|empty reply|unexpected disconnect|hung up unexpectedly|transfer closed|rpc failed"
    r"|gnutls|openssl|ssl_|http/2 stream",
    re.IGNORECASE,
)
_FULL = re.compile(r"No space left on device|Disk quota exceeded|unable to write file")
"""Signs of a full disk; git does not report why it cannot write a file of a work tree."""


class GitError(ForgeError):
    """git failed, for example because a repository does not exist."""


class NetworkError(GitError):
    """The server could not be reached, or did not answer even after retries."""


def commits_of(url: str, tags: Iterable[str], *, branches: bool = True) -> dict[str, str]:
    """Return the commits of the tags or branches that exist in a remote repository; raises GitError.

    HEAD is the branch that is checked out by default.
    """
    names = sorted(set(tags))
    kinds = [each for each in _REFS if branches or each[0] == "tags"]
    commits: dict[str, str] = {}
    for start in range(0, len(names), _BATCH):
        batch = names[start : start + _BATCH]
        patterns = [f"refs/{kind}/{name}{end}" for name in batch for kind, end in kinds]
        patterns += ["HEAD"] if branches and "HEAD" in batch else []
        answer = _ask("ls-remote", "--", url, *patterns)
        commits_by_ref = dict(line.split("\t")[::-1] for line in answer.splitlines())
        for name in batch:
            refs = [*(f"refs/{kind}/{name}{end}" for kind, end in kinds), *([name] if name == "HEAD" else [])]
            if commit := next((commits_by_ref[ref] for ref in refs if ref in commits_by_ref), None):
                commits[name] = commit
    return commits


def check_out(url: str, ref: str, commit: str, folder: Path) -> int:
    """Write the tree of a commit to a new folder; return how many bytes were received.

    `ref` is the tag to request, since not every server sends single commits. Raises GitError, for example if
    the tag names another commit.
    """
    repository = folder / ".git"
    received = _receive(url, ref, commit, repository)
    tree = (f"--git-dir={repository}", f"--work-tree={folder}")
    _git(*tree, *_PLAIN, "checkout", "--quiet", "--force", commit)
    return received


def mirror(url: str, ref: str, commit: str, folder: Path) -> int:
    """Create a bare repository that contains only this commit, as the tag `ref` and as the branch 'main'.

    Returns how many bytes were received.
    """
    received = _receive(url, ref, commit, folder)
    for name in ("refs/heads/main", f"refs/tags/{ref}"):
        _git(f"--git-dir={folder}", "update-ref", name, commit)
    (folder / "description").write_text(f"{MARK}{without_passwords(url)}\n", encoding="utf-8")
    return received


def combine(mirrors: Mapping[str, Path], folder: Path) -> None:
    """Create a bare repository of several mirrors of one repository; `mirrors` maps tags to them."""
    _git("init", "--quiet", "--bare", "--initial-branch=main", "--template=", os.fspath(folder))
    for tag, path in mirrors.items():
        refs = (f"refs/tags/{tag}:refs/tags/{tag}", "+refs/heads/main:refs/heads/main")
        words = (*_PLAIN, "fetch", "--quiet", "--depth=1", "--no-tags", "--", path.as_uri())
        _git(f"--git-dir={folder}", *words, *refs)


def fault(folder: Path, commit: str) -> str:
    """Return the fault of a repository created by `mirror`, '' if there is none."""
    repository = f"--git-dir={folder}"
    try:
        if _git(repository, "rev-parse", "refs/heads/main").strip() != commit:
            return f"its branch is not the commit {commit}"
        _git(repository, *_PLAIN, "fsck", "--full", "--no-dangling", "--no-progress")
    except GitError as error:
        return error.problems[0].message
    return ""


def _receive(url: str, ref: str, commit: str, repository: Path) -> int:
    _git("init", "--quiet", "--bare", "--initial-branch=main", "--template=", os.fspath(repository))
    # Keep the received data in one file, whose size equals that of the download.
    words = (f"--git-dir={repository}", *_PLAIN, "fetch", "--quiet", "--depth=1", "--no-tags", "--", url)
    if ref == commit:
        _ask(*words, commit)
    else:
        try:
            _ask(*words, f"refs/tags/{ref}")
        except GitError as error:
            if "find remote ref" not in error.problems[0].message:
                raise
            _ask(*words, commit)  # a branch, which may have moved, or a deleted tag
    received = _git(f"--git-dir={repository}", "rev-parse", "--verify", "FETCH_HEAD^{commit}").strip()
    if received != commit:
        message = f"the tag '{ref}' of '{without_passwords(url)}' is {received}, not {commit} as in the lock"
        hint = "the tag was moved, or the lock was edited; to use the current commit: forge fetch --update"
        raise GitError(Problem(message, hint=hint))
    # The data was not unpacked, so the file has the size of the download.
    return sum(path.stat().st_size for path in repository.glob("objects/pack/*.pack"))


def _ask(*words: str) -> str:
    """Run a git command that contacts a server; retry it after network errors."""
    for pause in _PAUSES:
        with suppress(NetworkError):
            return _git(*words)
        time.sleep(pause)
    return _git(*words)


def _git(*words: str) -> str:
    variables = {**os.environ, "GIT_TERMINAL_PROMPT": "0", "LC_ALL": "C"}
    for name in ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY"):
        variables.pop(name, None)
    try:
        result = subprocess.run(
            ("git", *words), env=variables, stdin=subprocess.DEVNULL, capture_output=True, check=False
        )
    except FileNotFoundError:
        hint = "install it, for example with `apt install git`"
        raise HostError(Problem("git is not installed", hint=hint)) from None
    if result.returncode == -signal.SIGINT:
        raise KeyboardInterrupt
    if _FULL.search(os.fsdecode(result.stderr)):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), words[0])
    if result.returncode:
        lines = (
            line.removeprefix("fatal: ").removeprefix("error: ")
            for line in os.fsdecode(result.stderr).splitlines()
        )
        reason = next((line for line in lines if line and not line.startswith(("warning:", "hint:"))), "")
        kind = NetworkError if _NETWORK.search(os.fsdecode(result.stderr)) else GitError
        raise kind(Problem(without_passwords(reason or f"git failed with exit code {result.returncode}")))
    return os.fsdecode(result.stdout)
