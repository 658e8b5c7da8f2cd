"""Settings of compiler launchers for a build, and the numbers of saved or distributed compilations."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import subprocess
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from forge.base.errors import Problem
from forge.base.layout import COMPILATIONS_FILE
from forge.toolchain.compiler_launchers import LauncherStats, LauncherSummary

_TIMEOUT_SECONDS = 10
_SETTING = re.compile(r"^\(.*?\) (\w+) = (.*)$", re.MULTILINE)
_HITS = frozenset({"direct_cache_hit", "preprocessed_cache_hit"})
_NO_COMPILATIONS = frozenset({"called_for_link", "called_for_preprocessing", "no_input_file"})
_DEFAULT_LIMIT = 4
"""distcc's default number of jobs per host."""
_LOCALHOST = re.compile(r"localhost(/\d+)?$")


def open_launcher_stats(
    launcher: Path, root: Path, build: Path, variables: Mapping[str, str]
) -> LauncherStats:
    """Return the statistics for a build of the workspace at `root` into the folder `build`.

    `variables` must not contain jobserver variables, because a server started here outlives the build.
    """
    match launcher.name:
        case "ccache":
            return _ccache_stats(launcher, root, build / COMPILATIONS_FILE, variables)
        case "sccache":
            before = _sccache_counts(launcher, variables)
            return LauncherStats(finish=partial(_finish_sccache, launcher, variables, before))
        case "distcc":
            return _distcc_stats(launcher, variables)
        case _:
            return LauncherStats()


def remote_slots(hosts: str) -> list[int]:
    """Return the job slots of each remote host in the output of `distcc --show-hosts`, one entry per line.

    Entries are HOST[:PORT][/LIMIT], HOST[/LIMIT][:PORT] or [USER]@HOST[/LIMIT][:COMMAND], and options after a
    comma. The word localhost means this machine, whose processors are counted elsewhere; 127.0.0.1 is a
    remote host.
    """
    slots = []
    for entry in hosts.split():
        address = entry.partition(",")[0]
        if "@" in address:
            address = re.sub(r"(\[[^]]*\]|[^]:]*):.*", r"\1", address)
        if not _LOCALHOST.match(entry):
            limit = re.search(r"/(\d+)", address)
            slots.append(int(limit[1]) if limit else _DEFAULT_LIMIT)
    return slots


def _distcc_stats(program: Path, variables: Mapping[str, str]) -> LauncherStats:
    """Return the hosts that distcc would use according to its files, variables and zeroconf."""
    slots = remote_slots(_output([program, "--show-hosts"], variables))
    if not slots:
        hint = "list hosts in DISTCC_HOSTS or ~/.distcc/hosts; `distcc --show-hosts` shows the result"
        message = "distcc reports no remote hosts, so all compilations run on this machine"
        return LauncherStats(problem=Problem(message, hint=hint))
    summary = LauncherSummary("distcc", hosts=len(slots), slots=sum(slots))
    return LauncherStats(slots=sum(slots), finish=lambda: (summary,))


def _ccache_stats(launcher: Path, root: Path, log: Path, variables: Mapping[str, str]) -> LauncherStats:
    """Return the statistics of ccache, and of distcc if ccache runs compilers through it."""
    settings = dict(_SETTING.findall(_output([launcher, "--show-config"], variables)))
    added: dict[str, str] = {}
    if not settings.get("base_dir") and "CCACHE_BASEDIR" not in variables:
        # Relative paths in compiler messages would not be found by users or editors.
        added = {"CCACHE_BASEDIR": str(root), "CCACHE_ABSSTDERR": "1"}
    word = next(iter(settings.get("prefix_command", "").split()), "")
    program = shutil.which(word, path=variables.get("PATH")) if Path(word).name == "distcc" else None
    distcc = _distcc_stats(Path(program), variables) if program else LauncherStats()
    finish = distcc.finish
    if not settings.get("stats_log"):  # the user's own log also contains other builds
        log.unlink(missing_ok=True)
        added["CCACHE_STATSLOG"] = str(log)
        finish = partial(_finish_ccache, log, distcc)
    return LauncherStats(added, distcc.slots, distcc.problem, finish)


def _finish_ccache(log: Path, distcc: LauncherStats) -> tuple[LauncherSummary, ...]:
    """Parse and remove ccache's log, in which compilations start with '#'."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
        log.unlink()
    except OSError:  # nothing was compiled, or this ccache is too old to write a log
        return distcc.finish()
    compilations = sum(line.startswith("# ") for line in lines)
    compilations -= sum(line in _NO_COMPILATIONS for line in lines)
    return (*_cache_summary("ccache", compilations, sum(line in _HITS for line in lines)), *distcc.finish())


def _finish_sccache(
    launcher: Path, variables: Mapping[str, str], before: tuple[int, int] | None
) -> tuple[LauncherSummary, ...]:
    """Return the increase of the server's counters, which may include other builds."""
    after = _sccache_counts(launcher, variables)
    if before is None or after is None or after < before:
        return ()
    return _cache_summary("sccache", after[0] - before[0], after[1] - before[1])


def _cache_summary(launcher: str, compilations: int, hits: int) -> tuple[LauncherSummary, ...]:
    return (LauncherSummary(launcher, compilations, hits),) if compilations > 0 else ()


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
        result = subprocess.run(
            argv,
            env=dict(variables),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_TIMEOUT_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return result.stdout.decode(errors="replace")
