"""`forge bundle` of a cross build."""

import tarfile

from tests.conftest import Forge, Tree


def test_each_platform_has_its_own_archive(tree: Tree, forge: Forge) -> None:
    root = tree(
        {
            "install/.colcon_install_layout": "isolated\n",
            "install/a/lib/a/here": "",
            "install/aarch64-linux-gnu/.colcon_install_layout": "isolated\n",
            "install/aarch64-linux-gnu/a/lib/a/there": "",
        }
    )
    assert forge("bundle", "--output", "here.tar.gz", cwd=root).code == 0
    assert forge("bundle", "--target", "arm64", "--output", "there.tar.gz", cwd=root).code == 0
    found = {}
    for name in ("here", "there"):
        with tarfile.open(root / f"{name}.tar.gz") as archive:
            found[name] = [path for path in archive.getnames() if path.startswith("install/a")]
    assert found == {"here": ["install/a/lib/a/here"], "there": ["install/a/lib/a/there"]}
