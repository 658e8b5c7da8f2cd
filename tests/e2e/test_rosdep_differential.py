"""forge and rosdep make the same of the same rules: random ones, for all systems that both know."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from forge.plugins.system_deps.rosdep import resolve
from forge.plugins.system_deps.system import System

SYSTEMS = (
    System("ubuntu", "jammy", "apt"),
    System("debian", "bookworm", "apt"),
    System("fedora", "40", "dnf"),
    System("rhel", "9", "dnf"),
    System("openeuler", "24.03", "dnf"),
)
CASES = 2000

ASKER = """
import json, sys
from rosdep2 import create_default_installer_context
from rosdep2.core import InvalidData
from rosdep2.lookup import ResolutionError, RosdepDefinition

context = create_default_installer_context()
answers = []
for rules, name, version in json.load(sys.stdin):
    keys = context.get_os_installer_keys(name)
    default = context.get_default_os_installer_key(name)
    default = default(version) if callable(default) else default
    try:
        manager, rule = RosdepDefinition("k", rules).get_rule_for_platform(name, version, keys, default)
        answers.append([manager, list(context.get_installer(manager).resolve(rule))])
    except ResolutionError:
        answers.append(None)
    except (InvalidData, TypeError):
        answers.append("refused")
json.dump(answers, sys.stdout)
"""
"""Asks rosdep what a rule means; it runs where rosdep is installed."""


def names(chance: random.Random) -> Any:
    """Return names as files have them."""
    plain: tuple[Any, ...] = ("a", "a b", ["a"], ["a", "b"], [], None)
    return chance.choice([*plain, {"packages": ["p", "q"]}, {"packages": "p q"}, {"packages": []}])


def rule(chance: random.Random, *, deep: bool = True) -> Any:
    """Return a rule: names, names by package manager, or such rules by version."""
    kind = chance.randrange(3 if deep else 2)
    if kind == 0:
        return names(chance)
    if kind == 1:
        managers = chance.sample(["apt", "pip", "dnf", "yum", "gem", "npm"], chance.randint(1, 3))
        return {manager: names(chance) for manager in managers}
    versions = chance.sample(["noble", "*", *(system.version for system in SYSTEMS)], chance.randint(1, 4))
    return {version: rule(chance, deep=False) for version in versions}


@pytest.mark.needs("rosdep")
def test_forge_and_rosdep_resolve_rules_equally() -> None:
    chance = random.Random(7)
    cases = []
    for _ in range(CASES):
        known = chance.sample(SYSTEMS, chance.randint(1, len(SYSTEMS)))
        rules = {system.name: rule(chance) for system in known}
        if chance.random() < 0.2:
            rules["*"] = rule(chance)
        cases.append((rules, chance.choice(SYSTEMS)))
    asked = [(rules, system.name, system.version) for rules, system in cases]
    python = Path(str(shutil.which("rosdep"))).with_name("python")
    ran = subprocess.run(
        [python, "-c", ASKER], input=json.dumps(asked), capture_output=True, text=True, check=True
    )
    compared = 0
    for (rules, system), theirs in zip(cases, json.loads(ran.stdout), strict=True):
        if theirs == "refused":
            continue
        ours = resolve("k", [{"k": rules}], system)
        said = [ours.manager, list(ours.names)] if ours else None
        wanted = ["dnf" if theirs[0] == "yum" else theirs[0], theirs[1]] if theirs else None
        assert said == wanted, (rules, system)
        compared += wanted is not None
    assert compared > CASES // 4
