"""rosdep itself, where it is installed, makes the same of rules as forge's own reader of its data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.plugins.system_deps import rosdep_library
from forge.plugins.system_deps.rosdep import resolve
from forge.plugins.system_deps.system import System

if TYPE_CHECKING:
    from forge.plugins.system_deps.rosdep import Database

JAMMY = System("ubuntu", "jammy", "apt")
RULES: tuple[object, ...] = (
    *("a b", ["a", "b"], [], None, 7, {"packages": ["a"]}),
    *({"pip": ["a"], "apt": ["b"]}, {"apt": {"packages": "a b"}}, {"jammy": ["a"]}, {"focal": ["b"]}),
    *({"focal": ["b"], "*": ["c"]}, {"*": ["c"], "jammy": None}, {"source": {"uri": "x"}}),
)


@pytest.mark.skipif(not rosdep_library.is_installed(), reason="needs rosdep: pip install rosdep")
def test_rosdep_itself_reads_rules_alike() -> None:
    for rule in RULES:
        own: Database = {"k": {"ubuntu": rule}}
        for databases in ([own], [{"k": {"fedora": ["f"]}}, own, {"k": {"ubuntu": ["late"]}}]):
            assert rosdep_library.resolver(databases, JAMMY)("k") == resolve("k", databases, JAMMY), rule
    assert rosdep_library.resolver([{"k": {"ubuntu": ["a"]}}], JAMMY)("other") is None
    void = System("void", "", "void")
    assert rosdep_library.resolver([{"k": {"void": ["v"]}}], void)("k") is None
