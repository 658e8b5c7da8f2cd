"""What a build will do, and why: the changed file, option, variable, tool or dependency of each package."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping

from forge.base.errors import Problem, print_problem
from forge.base.files import text_or_nothing
from forge.base.layout import Layout
from forge.base.text import counted
from forge.build.model import Snapshot
from forge.build.tasks import BuildPlan, step_line
from forge.build.up_to_date import InputChange, InputKind
from forge.cli.options import LOG_LEVELS
from forge.cli.preparation import PreparedBuild
from forge.workspace.cmake_text import calls, cmake_files
from forge.workspace.model import CMAKE_TYPES, Package


def print_plan(plan: BuildPlan, snapshot: Snapshot, build: PreparedBuild) -> None:
    """Print the plan for --explain and --dry-run on stdout, or for --log-level info on stderr.

    Before it, print announcements of packages whose sources did not change.
    """
    options, mode, packages = build.options, build.mode, build.loaded.packages
    if plan.tasks and not mode.quiet:
        for line in announcements(plan, snapshot):
            print(line, file=sys.stderr, flush=True)
    if not plan.tasks and mode.silent_if_up_to_date:
        return
    # With --json the events contain the reasons.
    requested = (options.explain or options.dry_run) and not options.report.json
    level = options.folders.level
    if not requested and (level > LOG_LEVELS["info"] or options.dry_run):
        return
    with_commands = options.dry_run if requested else level <= LOG_LEVELS["debug"]
    lines = (*explain(plan, packages, options.query.named), *(commands(plan) if with_commands else ()))
    print(*lines, sep="\n", file=sys.stdout if requested else sys.stderr)


def explain(
    plan: BuildPlan, packages: Mapping[str, Package], named: frozenset[str] = frozenset()
) -> Iterator[str]:
    """Yield a line with the reason for each package that is built, packages of the workspace first.

    Packages that are up to date are only counted, except those that the user `named`.
    """
    for name, task in sorted(plan.tasks.items(), key=lambda item: item[1].embedded):
        yield f"{name}: {'maybe build' if task.conditional else 'build'}, {task.reason}"
    yield from (f"{name}: up to date" for name in plan.fresh if name in named)
    for kind, embedded in (("", False), ("embedded ", True)):
        count = sum(packages[name].embedded is embedded and name not in named for name in plan.fresh)
        if count:
            yield f"{counted(count, f'{kind}package')}: up to date"


def commands(plan: BuildPlan) -> Iterator[str]:
    """Yield all commands of the plan in order, as shell command lines."""
    for name, task in plan.tasks.items():
        yield f"# {name}"
        yield from (step_line(step) for step in task.steps)


_SHOWN = 5
"""The maximum number of lines."""


def announcements(plan: BuildPlan, snapshot: Snapshot) -> Iterator[str]:
    """Yield a line for each changed option, variable, tool or external file with the number of packages.

    Embedded packages, and packages that are only rebuilt if a dependency changes, are not counted.
    """
    groups: dict[object, list[InputChange]] = {}
    for task in plan.tasks.values():
        record, change = snapshot.records.get(task.name), task.change
        if task.embedded or record is None or record.inputs.sources != task.inputs.sources:
            continue
        if change is not None and change.kind is not InputKind.OWN:
            is_option = change.kind is InputKind.OPTION
            groups.setdefault(is_option or change.names or change.text, []).append(change)
    most_first = sorted(groups.values(), key=len, reverse=True)
    for changes in most_first[:_SHOWN]:
        first, names = changes[0], dict.fromkeys(name for change in changes for name in change.names)
        text = first.text
        if first.kind is InputKind.OPTION:
            listed_names = f": {', '.join(names)}" if names else ""
            text = f"options changed since the last build{listed_names}"
        elif first.kind is InputKind.VARIABLE and len(names) > 1:
            text = f"the environment variables {', '.join(map(repr, names))} changed"
        line = f"{text}; {_rebuilt(len(changes))}"
        # Variables that sourcing sets cannot simply be unset.
        if first.kind is InputKind.VARIABLE and not any(name.endswith("PATH") for name in names):
            it = "it" if len(names) == 1 else "them"
            remedy = f"unset {it}" if first.added >= names.keys() else f"set {it} as before"
            line += f"; {remedy} to keep {'it' if len(changes) == 1 else 'them'}"
        yield line
    if rest := sum(map(len, most_first[_SHOWN:])):
        yield f"{_rebuilt(rest)} for other reasons, which '--explain' shows"


def _rebuilt(count: int) -> str:
    return "1 package is rebuilt" if count == 1 else f"{count} packages are rebuilt"


_DOWNLOADING = frozenset(
    {"ament_vendor", "cpmaddpackage", "externalproject_add", "fetchcontent_declare", "fetchcontent_populate"}
)
_REMOTE = re.compile(r"(?:https?|ftp|git|ssh)://\S+|[\w.-]+@[\w.-]+:\S+")
_URLS_SHOWN = 10


def announce_downloads(plan: BuildPlan, layout: Layout) -> None:
    """Print a note with the URLs in CMake commands that may download, for packages without a build folder.

    Some of the commands may be in branches that are not taken.
    """
    packages = (
        task.package
        for name, task in plan.tasks.items()
        if task.package.build_type in CMAKE_TYPES
        and not task.embedded
        and not (layout.build_dir(name) / "CMakeCache.txt").exists()
    )
    urls: dict[tuple[str, str], None] = {}
    for package in packages:
        for text in map(text_or_nothing, cmake_files(package.path)):
            if "://" not in text and "@" not in text:
                continue  # parsing large files completely takes time
            for call in calls(text):
                if call.command in _DOWNLOADING or (
                    call.command == "file" and call.words[:1] == ("DOWNLOAD",)
                ):
                    addresses = (word for word in call.words if _REMOTE.fullmatch(word))
                    urls.update(((package.name, url), None) for url in addresses)
    if not urls:
        return
    shown = ", ".join(f"{url} ('{name}')" for name, url in list(urls)[:_URLS_SHOWN])
    rest = f" and {len(urls) - _URLS_SHOWN} more" if len(urls) > _URLS_SHOWN else ""
    message = f"this build may download from {counted(len(urls), 'URL')}: {shown}{rest}"
    print_problem(Problem(message), "note")
