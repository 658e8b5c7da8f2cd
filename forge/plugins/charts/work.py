"""Explain the duration of a build: its work by kind and by file, the minimum time, and other builds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import Any

from forge.base.frozen import frozen
from forge.base.text import counted, duration
from forge.plugins.charts.commands import COMPILE, CONFIGURE, GENERATE, LINK, Command
from forge.plugins.charts.graph_formats import longest_chain, printable
from forge.plugins.charts.headers import HeaderTimes
from forge.plugins.charts.timings import Build, PackageRun, kind_of, waited

KINDS = {
    CONFIGURE: "configure",
    COMPILE: "compile",
    LINK: "link",
    GENERATE: "generate",
    "build": "other build work",
    "install": "install",
    "test": "test",
    "waiting": "begin and end",
}
"""Kinds of work, in the order of their display."""
_FILES = 25
_CHANGES = 25
_LEAST_CHANGE = 0.05
_ROUNDED = 0.001
"""The precision of command times in events."""
_LISTED = 3
"""The number of files listed in the terminal."""


@frozen
class Bounds:
    """The seconds of all work, and of the longest chain of dependent work."""

    work: float
    chain: float
    jobs: int

    @property
    def least(self) -> float:
        """The minimum seconds of any schedule with this number of jobs."""
        return max(self.work / self.jobs, self.chain)


def phases(run: PackageRun) -> dict[str, float]:
    """Return the seconds of work by kind: those of commands, which ran in parallel, are added up."""
    seconds = dict.fromkeys(KINDS, 0.0)
    for step, following in zip_longest(run.steps, run.steps[1:]):
        until = following.begun - _ROUNDED if following else step.ended
        ninja = [
            ninja_run
            for ninja_run in run.ninja
            if step.begun - _ROUNDED <= ninja_run.commands[0].begun < until
        ]
        seconds[kind_of(step)] += max(0.0, step.seconds - sum(ninja_run.seconds for ninja_run in ninja))
        for command in (command for ninja_run in ninja for command in ninja_run.commands):
            seconds[command.kind if command.kind in seconds else GENERATE] += command.seconds
    seconds["waiting"] += max(0.0, run.seconds - sum(step.seconds for step in run.steps))
    return seconds


def bounds(build: Build) -> Bounds | None:
    """Return the bounds of a successful build, None if nothing was built or the machine is unknown."""
    if not build.packages or build.use is None or build.code:
        return None
    least = {
        run.name: max(0.0, run.seconds - sum(each.seconds - each.least for each in run.ninja))
        for run in build.packages
    }
    chain = longest_chain({run.name: run.needs for run in build.packages}, least)
    work = sum(sum(phases(run).values()) for run in build.packages)
    return Bounds(work, sum(least[name] for name in chain), build.use.jobs)


def work(build: Build) -> dict[str, Any]:
    """Return the values of the template: sentences, work of packages, files and headers.

    All bars of a table have the same scale.
    """
    numbers = {run.name: number for number, run in enumerate(build.packages)}
    by_package = {run.name: phases(run) for run in build.packages}
    totals = {name: sum(by_kind.values()) for name, by_kind in by_package.items()}
    longest = max(totals.values(), default=0.0)
    files = _slowest(build)
    longest_file = files[0][1].seconds if files else 0.0
    sums = {kind: sum(by_kind[kind] for by_kind in by_package.values()) for kind in KINDS}
    return {
        "remarks": [*_sentences(build)],
        "kinds": [
            (kind, KINDS[kind], duration(seconds)) for kind, seconds in sums.items() if round(seconds, 2)
        ],
        "packages": [
            {
                "number": numbers[name],
                "name": printable(name),
                "took": duration(totals[name]),
                "pieces": [
                    {
                        "kind": kind,
                        "width": _percent(seconds, longest),
                        "title": f"{KINDS[kind]} {duration(seconds)}",
                    }
                    for kind, seconds in by_package[name].items()
                    if seconds > 0
                ],
            }
            for name in sorted(totals, key=lambda name: (-totals[name], name))
        ],
        "files": [
            {
                "number": numbers[run.name],
                "name": printable(run.name),
                "file": printable(command.name),
                "kind": command.kind,
                "took": duration(command.seconds),
                "width": _percent(command.seconds, longest_file),
            }
            for run, command in files
        ],
        "headers": build.headers and _headers(build.headers),
    }


def lines(build: Build) -> Iterator[str]:
    """Yield the most important figures for a terminal."""
    if slowest := _slowest(build)[:_LISTED]:
        yield "slowest: " + ", ".join(
            f"{printable(command.name)} of {printable(run.name)} {duration(command.seconds)}"
            for run, command in slowest
        )
    if sentence := _least(build):
        yield sentence


def comparison(build: Build, earlier: Build, name: str) -> dict[str, Any]:
    """Return the values of the template about the differences from an earlier build."""
    now, then = ({run.name: run.seconds for run in each.packages} for each in (build, earlier))
    numbers = {run.name: number for number, run in enumerate(build.packages)}
    packages = [
        {"number": numbers.get(package), "name": printable(package), "file": "", **change}
        for package, change in _changes(now, then)
    ]
    files = [
        {"number": numbers.get(package), "name": printable(package), "file": printable(file), **change}
        for (package, file), change in _changes(_by_file(build), _by_file(earlier))
    ]
    words = "less" if build.seconds < earlier.seconds else "more"
    change = duration(abs(build.seconds - earlier.seconds))
    return {
        "name": printable(name),
        "sentence": f"This build took {duration(build.seconds)}, {change} {words} than that one "
        f"({duration(earlier.seconds)}).",
        "packages": packages,
        "files": files,
    }


def _changes(now: Mapping[Any, float], then: Mapping[Any, float]) -> Iterator[tuple[Any, dict[str, object]]]:
    """Yield the greatest differences first; entries of only one build come last."""
    common = [key for key in now if key in then and abs(now[key] - then[key]) >= _LEAST_CHANGE]
    common.sort(key=lambda key: -abs(now[key] - then[key]))
    longest = max((abs(now[key] - then[key]) for key in common), default=0.0)
    for key in common[:_CHANGES]:
        change = now[key] - then[key]
        yield (
            key,
            {
                "then": duration(then[key]),
                "now": duration(now[key]),
                "change": ("+" if change > 0 else "\N{MINUS SIGN}") + duration(abs(change)),
                "slower": change > 0,
                "width": _percent(abs(change), longest),
            },
        )
    unmatched = sorted(
        (now.keys() ^ then.keys()), key=lambda key: -max(now.get(key, 0.0), then.get(key, 0.0))
    )
    for key in unmatched[: _CHANGES - len(common)]:
        seconds = duration(now.get(key, then.get(key, 0.0)))
        new = key in now
        change_word = "only now" if new else "only then"
        yield (
            key,
            {
                "then": "" if new else seconds,
                "now": seconds if new else "",
                "change": change_word,
                "slower": False,
                "width": "0%",
            },
        )


def _by_file(build: Build) -> dict[tuple[str, str], float]:
    return {
        (run.name, command.name): command.seconds
        for run in build.packages
        for ninja_run in run.ninja
        for command in ninja_run.commands
        if command.kind != CONFIGURE
    }


def _slowest(build: Build) -> list[tuple[PackageRun, Command]]:
    commands = (
        (run, command) for run in build.packages for ninja_run in run.ninja for command in ninja_run.commands
    )
    return sorted(commands, key=lambda item: -item[1].seconds)[:_FILES]


def _least(build: Build) -> str:
    limits = bounds(build)
    if limits is None or limits.work < 0.1:
        return ""
    with_jobs = f"with {counted(limits.jobs, 'job')}, at best about {duration(limits.least)}"
    reason = f"{duration(limits.work)} of work, and {duration(limits.chain)} for the longest chain of it"
    return f"{with_jobs}: {reason}"


def _sentences(build: Build) -> Iterator[str]:
    if sentence := _least(build):
        limits = bounds(build)
        assert limits is not None
        yield f"{sentence[0].upper()}{sentence[1:]}."
        if limits.chain >= limits.work / limits.jobs:
            yield "More processors would not help: the packages and files of the chain wait for each other."
        else:
            enough = max(1, round(limits.work / limits.chain)) if limits.chain else limits.jobs
            yield f"More processors would help, up to about {enough}."
    runs = {run.name: run for run in build.packages}
    waiting = sum(waited(run, runs) for run in build.packages)
    working = sum(run.seconds for run in build.packages)
    if waiting >= _LEAST_CHANGE:
        yield (
            f"Packages worked for {duration(working)} in total, and waited for {duration(waiting)} "
            "for a free job after their dependencies had finished."
        )
    if not any(run.ninja for run in build.packages):
        yield "File times are not available: only Ninja records them."


def _headers(times: HeaderTimes) -> dict[str, Any]:
    longest = times.headers[0].seconds if times.headers else 0.0
    share = f"{times.in_headers / times.total:.0%}" if times.total else "0%"
    files, in_templates = counted(times.files, "slowest source file"), duration(times.in_templates)
    sentences = [
        f"After the build, clang read the {files} again in {duration(times.total)}: {share} of this time in "
        f"headers, {in_templates} of it to instantiate templates."
    ]
    if times.failed:
        sentences.append(f"It could not compile {counted(times.failed, 'more file')}.")
    return {
        "sentences": sentences,
        "rows": [
            {
                "path": printable(each.path),
                "took": duration(each.seconds),
                "files": each.files,
                "width": _percent(each.seconds, longest),
            }
            for each in times.headers
        ],
    }


def _percent(part: float, total: float) -> str:
    return f"{100 * part / total:.2f}%" if total else "0%"
