"""The language server with another plugin."""

from forge.plugins.lsp.diagnostics import diagnose
from tests.conftest import Tree
from tests.packages import manifest_text
from tests.plugins.lsp.editors import index_of


def test_what_strict_rejects_is_a_warning_with_its_hint(tree: Tree) -> None:
    root = tree({"nav/package.xml": manifest_text("nav"), "nav/msg/A.msg": "int8 stdin\n"})
    (warning,) = diagnose(index_of(root), root / "nav/msg/A.msg")
    assert warning.severity == "warning"
    assert warning.message.endswith("in common headers\nhint: rename it, for example to 'stdin_value'")
