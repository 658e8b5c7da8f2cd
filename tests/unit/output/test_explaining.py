"""The explanation of a plan begins with the packages of the user."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.build.tasks import BuildPlan, Task
from forge.output.explaining import explain
from tests.packages import package

OWN = {name: package(name) for name in ("a", "b")}
EMBEDDED = {name: replace(package(name), embedded=True) for name in ("e", "f", "g")}
PACKAGES = {**EMBEDDED, **OWN}


def plan(*built: str, fresh: tuple[str, ...]) -> BuildPlan:
    """Return a plan that builds packages in this order."""
    tasks = {n: Task(n, PACKAGES[n], Path(), Path(), (), (), f"{n} changed") for n in built}
    return BuildPlan(tasks, fresh)


def test_packages_that_are_built_come_first_and_others_are_only_counted() -> None:
    assert list(explain(plan("g", "b", fresh=("e", "f", "a")), PACKAGES)) == [
        "b: build, b changed",
        "g: build, g changed",
        "1 package: up to date",
        "2 embedded packages: up to date",
    ]
    assert list(explain(plan("b", fresh=("e", "f")), PACKAGES, frozenset({"f"}))) == [
        "b: build, b changed",
        "f: up to date",
        "1 embedded package: up to date",
    ]
