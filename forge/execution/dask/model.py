"""The data model of cluster builds: messages to and from workers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.build.tasks import Task
    from forge.toolchain.resources import MemoryLimit

FINISH, INTERRUPT, KILL = "finish", "interrupt", "kill"
"""Commands to the step runner on a worker: stop after this step, terminate, kill."""


ACK_INTERVAL = 100
"""The number of messages after which the client acknowledges them to the worker."""

MACHINE = frozenset(
    """HOME USER LOGNAME HOSTNAME SHELL TMPDIR TMP TEMP PWD OLDPWD DISPLAY XDG_RUNTIME_DIR XDG_CACHE_HOME
    SSH_AUTH_SOCK SSH_CONNECTION TERM COLUMNS LINES
    """.split()  # noqa: SIM905
)
"""Variables for which a worker without shared folders uses its own values."""


@frozen
class Traits:
    """The properties that must be the same on all workers and the client.

    `tools` maps program names to path and digest, or '' if the program does not exist.
    """

    forge: str
    python: str
    tools: tuple[tuple[str, str], ...] = ()


@frozen
class Surveyed:
    """A surveyed worker: its address, its properties, and whether it shares the build folder."""

    address: str
    host: str
    traits: Traits
    sharing: bool
    slots: int = 1
    resources: tuple[tuple[str, float], ...] = ()


@frozen
class Terms:
    """The settings shared by all remote tasks of a build.

    `jobs` is the number of jobs per worker, None for its number of processors. `memory` and `load` are the
    limits of the options with these names. `resources` are the Dask worker resources that a package requires.
    """

    jobs: int | None = None
    memory: MemoryLimit | None = None
    load: float | None = None
    resources: tuple[tuple[str, float], ...] = ()


@frozen
class RemoteTask:
    """A task for a worker: steps to run in an environment prepared by the client.

    `lock` is held while any of its programs runs.
    """

    task: Task
    environment: Mapping[str, str]
    terms: Terms
    lock: Path | None = None
    bundle: SourceBundle | None = None


@frozen
class SourceBundle:
    """Sources for a worker without shared folders.

    `packages` are pairs of a folder in the workspace and the SHA-256 of its archive; `texts` are further
    files. `workspace` is an id of the workspace. The worker sets its own `folder` for the sources and for
    `archives`.
    """

    workspace: str
    packages: tuple[tuple[str, str], ...] = ()
    texts: tuple[tuple[str, str], ...] = ()
    folder: Path = Path()
    archives: Path = Path()


@frozen
class TaskRequest:
    """A worker has accepted a task and requests its RemoteTask; `attempt` is the id of this attempt.

    `folder` is the worker's folder for sources.
    """

    attempt: str
    address: str
    host: str
    folder: str


@frozen
class MissingSources:
    """A worker has received a task and requests the archives that it lacks."""

    attempt: str
    address: str
    digests: tuple[str, ...]
