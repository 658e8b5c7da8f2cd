"""The build steps of packages whose installed files came from the package cache.

Their build folders contain nothing, or the results of other sources. `forge test` runs the steps, except the
installation, before the tests: the installed files remain those from the cache.
"""

from __future__ import annotations

import json
from pathlib import Path

from forge.base.files import replace_file, text_or_nothing
from forge.base.frozen import Pairs, frozen
from forge.base.layout import DEFERRED_BUILD_FILE, SCRATCH_DIR
from forge.build.build_types import build_type_of
from forge.build.tasks import Step, StepKind, Task
from forge.workspace.model import Package


@frozen
class DeferredBuild:
    """The steps of a build except its installation, their files, and variables that differ from the user's.

    There are no steps if the package has no tests. `done` is True after they ran successfully.
    """

    steps: tuple[Step, ...] = ()
    files: tuple[tuple[Path, str], ...] = ()
    variables: Pairs = ()
    done: bool = False


def tests_need_build(package: Package) -> bool:
    return not package.embedded and build_type_of(package).tests_need_build


def defer_build(task: Task, variables: Pairs, *, has_tests: bool) -> None:
    """Record the steps of a task that was restored from the cache."""
    steps = tuple(step for step in task.steps if step.kind is not StepKind.INSTALL) if has_tests else ()
    files = tuple(task.files) if has_tests else ()
    write_deferred(task.build_dir, DeferredBuild(steps, files, variables if has_tests else ()))


def write_deferred(build: Path, deferred: DeferredBuild) -> None:
    value = {
        "steps": [
            (step.kind.name, step.argv, str(step.cwd), step.env, [*map(str, step.record or ())], step.target)
            for step in deferred.steps
        ],
        "files": [[str(path), text] for path, text in deferred.files],
        "variables": deferred.variables,
        "done": deferred.done,
    }
    path = build / SCRATCH_DIR / DEFERRED_BUILD_FILE
    replace_file(path, json.dumps(value).encode(errors="surrogateescape"), mode=0o600)


def read_deferred(build: Path) -> DeferredBuild | None:
    """Return the record of a package that was restored from the cache; None if it is missing or damaged."""
    try:
        value = json.loads(text_or_nothing(build / SCRATCH_DIR / DEFERRED_BUILD_FILE))
        return DeferredBuild(
            tuple(
                Step(
                    StepKind[kind],
                    tuple(argv),
                    Path(cwd),
                    tuple((name, text) for name, text in env),
                    (Path(record[0]), record[1]) if record else None,
                    target=target,
                )
                for kind, argv, cwd, env, record, target in value["steps"]
            ),
            tuple((Path(path), text) for path, text in value["files"]),
            tuple((name, text) for name, text in value["variables"]),
            bool(value["done"]),
        )
    except (ValueError, LookupError, TypeError):
        return None
