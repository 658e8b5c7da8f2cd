"""Statistics of a compiler launcher in one build, and the variables it needs."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import subprocess
from dataclasses import field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.toolchain.compiler_launchers.farms import HostPool, distcc_farm
from forge.toolchain.compiler_launchers.outcome import LauncherSummary

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.base.errors import Problem

LOG = ".forge_compilations"
"""File in the build folder in which ccache logs the compilations of a build."""

_PATIENCE_SECONDS = 10
_SETTING = re.compile(r"^\(.*?\) (\w+) = (.*)$", re.MULTILINE)
_HITS = frozenset({"direct_cache_hit", "preprocessed_cache_hit"})
_NO_COMPILATIONS = frozenset({"called_for_link", "called_for_preprocessing", "no_input_file"})


@frozen
class LauncherStats:
    """The launcher of one build: `variables` for its programs, its farm, and problems.

    `unsure` tells why the size of the farm is unknown, which only matters without an explicit number of jobs.
    `finish` returns the statistics at the end of the build.
    """

    variables: Mapping[str, str] = field(default_factory=dict)
    host_pool: HostPool = HostPool()
    problem: Problem | None = None
    unsure: Problem | None = None
    finish: Callable[[], tuple[LauncherSummary, ...]] = tuple


def open_launcher_stats(
    launcher: Path, root: Path, build: Path, variables: Mapping[str, str]
) -> LauncherStats:
    """Return the statistics for a build of the workspace at `root` into the folder `build`.

    `variables` must not contain jobserver variables, because a server started here outlives the build.
    """
    match launcher.name:
        case "ccache":
            return _of_ccache(launcher, root, build / LOG, variables)
        case "sccache":
            before = _sccache_counts(launcher, variables)
            return LauncherStats(finish=partial(_finish_sccache, launcher, variables, before))
        case _:
            return _of_farm(launcher, variables)


def _of_farm(launcher: Path, variables: Mapping[str, str]) -> LauncherStats:
    """Return the statistics of a launcher that may use a farm and does not count compilations."""
    problem = unsure = None
    match launcher.name:
        case "distcc":
            host_pool, problem = distcc_farm(launcher, variables)
        case "icecc":
            from forge.toolchain.compiler_launchers.icecream import icecc_farm  # noqa: PLC0415  (only for icecc)

            host_pool, unsure = icecc_farm(variables)
        case _:
            return LauncherStats()
    outcomes = (
        (LauncherSummary(launcher.name, hosts=host_pool.hosts, slots=host_pool.slots),)
        if host_pool.hosts
        else ()
    )
    return LauncherStats({}, host_pool, problem, unsure, lambda: outcomes)


def _of_ccache(launcher: Path, root: Path, log: Path, variables: Mapping[str, str]) -> LauncherStats:
    """Return the statistics of ccache and of the farm behind it."""
    settings = dict(_SETTING.findall(_output([launcher, "--show-config"], variables)))
    added: dict[str, str] = {}
    if not settings.get("base_dir") and "CCACHE_BASEDIR" not in variables:
        # Relative paths in compiler messages would not be found by users or editors.
        added = {"CCACHE_BASEDIR": str(root), "CCACHE_ABSSTDERR": "1"}
    own_log = settings.get("stats_log")
    if own_log:
        log = Path(own_log)
    elif own_log is not None:
        log.unlink(missing_ok=True)
        added["CCACHE_STATSLOG"] = str(log)
    beyond = _farm_behind(settings.get("prefix_command", ""), variables)
    finish = partial(_finish_ccache, log, _size(log), beyond, keep=bool(own_log))
    return LauncherStats(added, beyond.host_pool, beyond.problem, beyond.unsure, finish)


def _farm_behind(prefix: str, variables: Mapping[str, str]) -> LauncherStats:
    """Return the statistics of the program that ccache runs compilers through, if it has a farm."""
    word = next(iter(prefix.split()), "")
    found = shutil.which(word, path=variables.get("PATH")) if word else None
    return _of_farm(Path(found), variables) if found else LauncherStats()


def _finish_ccache(
    log: Path, begun: int, beyond: LauncherStats, *, keep: bool
) -> tuple[LauncherSummary, ...]:
    """Parse ccache's log after offset `begun`: compilations start with '#'."""
    with contextlib.suppress(OSError):
        with log.open("rb") as notes:
            notes.seek(begun)
            lines = notes.read().decode(errors="replace").splitlines()
        if not keep:
            log.unlink()
        compilations = sum(line.startswith("# ") for line in lines)
        compilations -= sum(line in _NO_COMPILATIONS for line in lines)
        return (*_from_cache("ccache", compilations, sum(line in _HITS for line in lines)), *beyond.finish())
    return beyond.finish()


def _finish_sccache(
    launcher: Path, variables: Mapping[str, str], before: tuple[int, int] | None
) -> tuple[LauncherSummary, ...]:
    """Return the increase of the server's counters, which may include other builds."""
    after = _sccache_counts(launcher, variables)
    if before is None or after is None or after < before:
        return ()
    return _from_cache("sccache", after[0] - before[0], after[1] - before[1])


def _from_cache(launcher: str, compilations: int, hits: int) -> tuple[LauncherSummary, ...]:
    return (
        (LauncherSummary(launcher, compilations=compilations, from_cache=hits),) if compilations > 0 else ()
    )


def _sccache_counts(launcher: Path, variables: Mapping[str, str]) -> tuple[int, int] | None:
    """Return the number of compilations and hits of sccache's server, starting it if necessary."""
    text = _output([launcher, "--show-stats", "--stats-format", "json"], variables)
    with contextlib.suppress(ValueError, LookupError, TypeError, AttributeError):
        stats = json.loads(text)["stats"]
        compilations = stats["compile_requests"] - stats["requests_not_compile"]
        return compilations, sum(stats["cache_hits"]["counts"].values())
    return None


def _output(argv: list[Path | str], variables: Mapping[str, str]) -> str:
    """Return the output of a program; '' on failure, because statistics must not fail a build."""
    try:
        done = subprocess.run(
            argv,
            env=dict(variables),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_PATIENCE_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.decode(errors="replace")


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
