"""The headers of a package are compiled as strictly as the page on compatibility says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.upstream.repositories import header_faults

if TYPE_CHECKING:
    from tests.conftest import Tree


def test_a_warning_in_a_header_is_a_fault(tree: Tree) -> None:
    """Headers of other packages are found, but not compiled for themselves."""
    include = "#include <b_msgs/msg/b.hpp>\n"
    workspace = tree(
        {
            "install/a_msgs/include/a_msgs/a_msgs/msg/a.hpp": f"{include}inline int a(int) {{ return b; }}\n",
            "install/b_msgs/include/b_msgs/b_msgs/msg/b.hpp": "constexpr int b = 1;\n",
            "install/c_msgs/include/c_msgs/c_msgs/srv/c.hpp": "inline int c(int x) { return 1; }\n",
        }
    )
    assert list(header_faults(workspace, "a_msgs")) == []
    (fault,) = header_faults(workspace, "c_msgs")
    assert "unused parameter" in fault
