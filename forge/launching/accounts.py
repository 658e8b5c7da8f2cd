"""What a launcher does in one build: what it is told beforehand, and what it says of it afterwards."""

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

from forge.frozen import frozen
from forge.launching.farms import Farm, distcc_farm
from forge.launching.outcome import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.errors import Problem

LOG = ".forge_compilations"
"""The file in the build folder in which ccache notes each compilation of a build."""

_PATIENCE_SECONDS = 10
_SETTING = re.compile(r"^\(.*?\) (\w+) = (.*)$", re.MULTILINE)
_HITS = frozenset({"direct_cache_hit", "preprocessed_cache_hit"})
_NO_COMPILATIONS = frozenset({"called_for_link", "called_for_preprocessing", "no_input_file"})


@frozen
class Account:
    """The account of one build: `variables` for its programs, the farm that takes part, what is wrong there.

    `unsure` is why the size of the farm is not known, which is wrong only if nobody says how many jobs there
    may be. `settle`, called once all has ended, tells what the launcher did.
    """

    variables: Mapping[str, str] = field(default_factory=dict)
    farm: Farm = Farm()
    problem: Problem | None = None
    unsure: Problem | None = None
    settle: Callable[[], tuple[Outcome, ...]] = tuple


def open_account(launcher: Path, root: Path, build: Path, variables: Mapping[str, str]) -> Account:
    """Return the account of a build of the workspace at `root` into the folder `build`.

    `variables` is the environment without what it says of jobs: a server that is started here outlives us.
    """
    match launcher.name:
        case "ccache":
            return _of_ccache(launcher, root, build / LOG, variables)
        case "sccache":
            before = _sccache_counts(launcher, variables)
            return Account(settle=partial(_settle_sccache, launcher, variables, before))
        case _:
            return _of_farm(launcher, variables)


def _of_farm(launcher: Path, variables: Mapping[str, str]) -> Account:
    """Return the account of a program that may have a farm, and counts nothing itself."""
    problem = unsure = None
    match launcher.name:
        case "distcc":
            farm, problem = distcc_farm(launcher, variables)
        case "icecc":
            from forge.launching.icecream import icecc_farm  # noqa: PLC0415  (others ask no server)

            farm, unsure = icecc_farm(variables)
        case _:
            return Account()
    outcomes = (Outcome(launcher.name, hosts=farm.hosts, slots=farm.slots),) if farm.hosts else ()
    return Account({}, farm, problem, unsure, lambda: outcomes)


def _of_ccache(launcher: Path, root: Path, log: Path, variables: Mapping[str, str]) -> Account:
    """Return ccache's account, and that of the farm to which it gives what is not in the cache."""
    settings = dict(_SETTING.findall(_said([launcher, "--show-config"], variables)))
    told: dict[str, str] = {}
    if not settings.get("base_dir") and "CCACHE_BASEDIR" not in variables:
        # What compilers then say of relative paths would not be where people, or editors, look for it.
        told = {"CCACHE_BASEDIR": str(root), "CCACHE_ABSSTDERR": "1"}
    theirs = settings.get("stats_log")
    if theirs:
        log = Path(theirs)
    elif theirs is not None:
        log.unlink(missing_ok=True)
        told["CCACHE_STATSLOG"] = str(log)
    beyond = _farm_behind(settings.get("prefix_command", ""), variables)
    settle = partial(_settle_ccache, log, _size(log), beyond, keep=bool(theirs))
    return Account(told, beyond.farm, beyond.problem, beyond.unsure, settle)


def _farm_behind(prefix: str, variables: Mapping[str, str]) -> Account:
    """Return the account of the program by which ccache starts compilers, if that is one with a farm."""
    word = next(iter(prefix.split()), "")
    found = shutil.which(word, path=variables.get("PATH")) if word else None
    return _of_farm(Path(found), variables) if found else Account()


def _settle_ccache(log: Path, begun: int, beyond: Account, *, keep: bool) -> tuple[Outcome, ...]:
    """Read what ccache noted since the log was `begun` bytes long: a line with '#' for each compilation."""
    with contextlib.suppress(OSError):
        with log.open("rb") as notes:
            notes.seek(begun)
            lines = notes.read().decode(errors="replace").splitlines()
        if not keep:
            log.unlink()
        compilations = sum(line.startswith("# ") for line in lines)
        compilations -= sum(line in _NO_COMPILATIONS for line in lines)
        return (*_from_cache("ccache", compilations, sum(line in _HITS for line in lines)), *beyond.settle())
    return beyond.settle()


def _settle_sccache(
    launcher: Path, variables: Mapping[str, str], before: tuple[int, int] | None
) -> tuple[Outcome, ...]:
    """Tell by how much the counts of sccache's server grew, in which others may have had a part."""
    after = _sccache_counts(launcher, variables)
    if before is None or after is None or after < before:
        return ()
    return _from_cache("sccache", after[0] - before[0], after[1] - before[1])


def _from_cache(launcher: str, compilations: int, hits: int) -> tuple[Outcome, ...]:
    return (Outcome(launcher, compilations=compilations, from_cache=hits),) if compilations > 0 else ()


def _sccache_counts(launcher: Path, variables: Mapping[str, str]) -> tuple[int, int] | None:
    """Return how many compilations sccache's server saw and how many were in its cache; it is started."""
    text = _said([launcher, "--show-stats", "--stats-format", "json"], variables)
    with contextlib.suppress(ValueError, LookupError, TypeError, AttributeError):
        stats = json.loads(text)["stats"]
        compilations = stats["compile_requests"] - stats["requests_not_compile"]
        return compilations, sum(stats["cache_hits"]["counts"].values())
    return None


def _said(argv: list[Path | str], variables: Mapping[str, str]) -> str:
    """Return what a program prints; '' if it cannot, for a build does not fail over numbers."""
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
