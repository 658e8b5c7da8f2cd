"""Builds with a compiler launcher have no precompiled headers, which it could not cache."""

import pytest

from tests.conftest import Tree
from tests.plugins.fast_rosidl import test_builds, test_component_nodes
from tests.rosidl import DEBIAN, interface_package

pytestmark = [pytest.mark.slow, pytest.mark.needs(str(DEBIAN), "ccache", "g++")]


def test_interface_packages_have_no_precompiled_headers(tree: Tree) -> None:
    root = tree(interface_package("fast_msgs", test_builds.SMALL))
    assert test_builds.build(root, "--compiler-launcher", "ccache").returncode == 0
    assert not test_builds.precompiled(root)


def test_component_nodes_have_no_precompiled_headers(tree: Tree) -> None:
    root = tree(test_component_nodes.FILES)
    test_component_nodes.build(root, "--compiler-launcher", "ccache")
    assert not test_component_nodes.precompiled(root)
