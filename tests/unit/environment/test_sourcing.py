from __future__ import annotations

import pytest

from forge.base.errors import WorkspaceError
from forge.environment.sourcing import build_environment
from tests.conftest import Tree


def test_missing_scripts_and_those_of_other_shells_are_skipped(tree: Tree) -> None:
    root = tree({"share/p/package.dsv": "source;gone.sh\nsource;other.bash\n", "other.bash": "exit 1\n"})
    assert build_environment([("p", root)], {"A": "1"}) == {"A": "1"}


def test_an_invalid_dsv_file_is_reported_with_its_path(tree: Tree) -> None:
    root = tree({"share/p/package.dsv": "source;share/p/x.dsv\n", "share/p/x.dsv": "prepend;A\n"})
    with pytest.raises(WorkspaceError, match=r"share/p/x\.dsv:1: error: invalid environment hook"):
        build_environment([("p", root)], {})
