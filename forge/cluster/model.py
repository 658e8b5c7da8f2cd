"""Nouns of a cluster: what goes to a worker, and what comes back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.capacity import MemoryLimit
    from forge.model import Task

FINISH, INTERRUPT, KILL = "finish", "interrupt", "kill"
"""Words to what runs steps on a worker: end after this step, end now, end at once."""


LETTERS = 100
"""After how many letters the client tells a worker that it has read them."""

MACHINE = frozenset(
    """HOME USER LOGNAME HOSTNAME SHELL TMPDIR TMP TEMP PWD OLDPWD DISPLAY XDG_RUNTIME_DIR XDG_CACHE_HOME
    SSH_AUTH_SOCK SSH_CONNECTION TERM COLUMNS LINES
    """.split()  # noqa: SIM905  (as in freshness)
)
"""Variables that a worker without our folders has of its own, whatever they are here."""


@frozen
class Traits:
    """What tells a worker, or the client itself, apart from others: what must be the same everywhere.

    `tools` are programs by name, each with its path and size; '' for one that is not there.
    """

    forge: str
    python: str
    tools: tuple[tuple[str, str], ...] = ()


@frozen
class Surveyed:
    """One worker as it was found: where it is, what it has, whether it sees the build folder."""

    address: str
    host: str
    traits: Traits
    sharing: bool
    slots: int = 1
    resources: tuple[tuple[str, float], ...] = ()


@frozen
class Terms:
    """What all errands of a build have in common.

    `jobs` are those of a whole worker; None means as many as its processors. `memory` and `load` are the
    limits of the options of these names. `resources` are what a package takes of the abstract resources
    that workers declare to Dask.
    """

    jobs: int | None = None
    memory: MemoryLimit | None = None
    load: float | None = None
    resources: tuple[tuple[str, float], ...] = ()


@frozen
class Errand:
    """What a worker is to do for one task: run its steps, in an environment that was made here.

    `lock` is held while anything of it runs.
    """

    task: Task
    environment: Mapping[str, str]
    terms: Terms
    lock: Path | None = None
    parcel: Parcel | None = None


@frozen
class Parcel:
    """Sources for a worker without our folders.

    `packages` are archives by their SHA-256, each behind the folder in the workspace where it belongs;
    `texts` are further files there. `workspace` tells workspaces apart. The worker says what its own
    `folder` for all that is, and where its `archives` lie.
    """

    workspace: str
    packages: tuple[tuple[str, str], ...] = ()
    texts: tuple[tuple[str, str], ...] = ()
    folder: Path = Path()
    archives: Path = Path()


@frozen
class Knock:
    """A worker has taken a task up, and asks for its errand; `visit` is this attempt and no other.

    `folder` is where it would lay out sources.
    """

    visit: str
    address: str
    host: str
    folder: str


@frozen
class Lacks:
    """A worker has an errand, and asks for archives that it needs."""

    visit: str
    address: str
    digests: tuple[str, ...]
