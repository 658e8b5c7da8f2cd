"""After an edit of some definitions, only these and their users are generated again."""

import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest

from forge.cli.preparation import BuildMode
from tests.conftest import Forge, Tree
from tests.evolving import look
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja", "gcc")

MANIFEST = manifest_text(
    "shapes",
    "<buildtool_depend>ament_cmake</buildtool_depend>",
    "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
    "<depend>std_msgs</depend>",
    "<exec_depend>rosidl_default_runtime</exec_depend>",
    "<member_of_group>rosidl_interface_packages</member_of_group>",
)
DEFINITIONS = {
    "msg/Point.msg": "float64 x\nfloat64 y  # up\n",
    "msg/Line.msg": "Point start\nPoint end\n",
    "msg/Other.msg": "std_msgs/Header header\n",
    "srv/Move.srv": "Point to\n---\nbool done\n",
}


def cmake_text(names: list[str], dependencies: str = "std_msgs") -> str:
    listed = "\n".join(f'  "{name}"' for name in names)
    return (
        "cmake_minimum_required(VERSION 3.16)\nproject(shapes NONE)\nfind_package(ament_cmake REQUIRED)\n"
        "find_package(rosidl_default_generators REQUIRED)\nfind_package(std_msgs REQUIRED)\n"
        f"rosidl_generate_interfaces(shapes\n{listed}\n  DEPENDENCIES {dependencies})\nament_package()\n"
    )


def workspace(tree: Tree) -> Path:
    files = {"package.xml": MANIFEST, "CMakeLists.txt": cmake_text([*DEFINITIONS]), **DEFINITIONS}
    return tree({f"src/shapes/{name}": text for name, text in files.items()})


def built(forge: Forge, root: Path) -> object:
    assert forge("build", cwd=root).code == 0
    return look(root / "install")


def output(root: Path) -> str:
    """Return what CMake and ninja said of the last build."""
    return (root / "log/latest_build/shapes/stdout.log").read_text()


@pytest.fixture(params=[True, False], ids=["worker", "alone"])
def generator(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the generator in the worker of the build, or in a separate process."""
    if not request.param:
        monkeypatch.setattr(BuildMode, "worker", lambda *_, **__: nullcontext({}))


def is_as_clean(forge: Forge, root: Path) -> bool:
    found = look(root / "install")
    for folder in ("build", "install"):
        shutil.rmtree(root / folder / "shapes")
    return found == built(forge, root)


def generated(root: Path) -> dict[Path, tuple[int, int]]:
    files = (path for path in (root / "build/shapes").glob("rosidl*/**/*.[hi]*") if path.is_file())
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in files}


@pytest.mark.usefixtures("generator")
def test_only_the_changed_definition_and_its_users_are_generated(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    built(forge, root)
    before = generated(root)
    (root / "src/shapes/msg/Line.msg").write_text("Point start\nPoint end\nint32 width\n")
    built(forge, root)
    assert "Generating the interfaces" in output(root)
    assert "Configuring done" not in output(root)
    changed = {path.name for path, when in generated(root).items() if before[path] != when}
    assert "line.hpp" in changed or "line__struct.hpp" in changed
    assert all("line" in name.lower() for name in changed), changed
    assert is_as_clean(forge, root)
    # A failed generation discards no outputs.
    before = generated(root)
    path = root / "src/shapes/msg/Line.msg"
    path.write_text("Pint start\n")
    assert forge("build", cwd=root).code != 0
    path.write_text("# Fixed\n" + DEFINITIONS["msg/Line.msg"])
    built(forge, root)
    assert "Configuring done" not in output(root)
    assert {
        path for path in before if "point" in path.name and before[path] != generated(root)[path]
    } == set()
    assert is_as_clean(forge, root)
    # Without its ledger, the generator starts clean; tests/integration/interfaces/test_edits.py damages it.
    before = generated(root)
    (root / "build/shapes/rosidl/shapes/.forge/shapes.json").unlink()
    (root / "src/shapes/msg/Line.msg").write_text("Point start\n")
    built(forge, root)
    after = generated(root)
    assert all(before[path] != after[path] for path in before if path.suffix != ".in")
    assert is_as_clean(forge, root)
