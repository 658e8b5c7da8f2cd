"""Installed packages and resources, read by ament_index_python and rosidl_runtime_py."""

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from forge.base.distributions import EMBEDDED
from tests.conftest import Tree
from tests.generated import RUNTIME

INDEX = "share/ament_index/resource_index"
LISTED = (
    "action/Go.action\naction/Go.idl\nmsg/Pose.idl\nmsg/Pose.msg\nsrv/Do.idl\nsrv/Do.srv\nsrv/Do_Request.msg"
)


@pytest.fixture(scope="module", autouse=True)
def _path() -> Iterator[None]:
    added = [str(EMBEDDED / "ament_index_python"), str(RUNTIME)]
    sys.path[:0] = added
    yield
    for path in added:
        sys.path.remove(path)


@pytest.fixture
def index() -> ModuleType:
    return import_module("ament_index_python")


@pytest.fixture
def runtime() -> ModuleType:
    return import_module("rosidl_runtime_py")


@pytest.fixture
def prefixes(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make two prefixes, of which the first wins, and name them in the environment."""
    root = tree(
        {
            f"over/{INDEX}/packages/both": "",
            f"over/{INDEX}/packages/.hidden": "",
            f"over/{INDEX}/packages/robot": "",
            f"over/{INDEX}/rosidl_interfaces/robot": LISTED,
            "over/share/robot/msg/Pose.msg": "int8 a",
            "over/share/robot/msg/Pose.idl": "",
            "over/share/robot/srv/Do.idl": "",
            f"under/{INDEX}/packages/both": "",
            f"under/{INDEX}/packages/plain": "",
            "under/share/plain/package.xml": "",
        }
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{root}/over:{root}/gone::{root}/under")
    return root


def test_prefixes_are_searched_in_order_if_they_exist(index: ModuleType, prefixes: Path) -> None:
    assert index.get_search_paths() == [f"{prefixes}/over", f"{prefixes}/under"]


@pytest.mark.parametrize("value", [None, ""])
def test_missing_prefixes_are_reported_with_the_variable(
    index: ModuleType, monkeypatch: pytest.MonkeyPatch, value: str | None
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", value or "")
    if value is None:
        monkeypatch.delenv("AMENT_PREFIX_PATH")
    with pytest.raises(OSError, match="'AMENT_PREFIX_PATH' is not set or empty"):
        index.get_search_paths()


def test_a_package_is_found_in_the_first_prefix_that_has_it(index: ModuleType, prefixes: Path) -> None:
    assert index.get_package_prefix("both") == f"{prefixes}/over"
    assert index.get_package_share_directory("plain") == f"{prefixes}/under/share/plain"
    assert index.get_package_share_path("plain") == prefixes / "under/share/plain"
    over, under = f"{prefixes}/over", f"{prefixes}/under"
    assert index.get_packages_with_prefixes() == {"both": over, "robot": over, "plain": under}


def test_a_missing_package_is_reported(index: ModuleType, prefixes: Path) -> None:
    with pytest.raises(KeyError) as caught:
        index.get_package_prefix("nowhere")
    assert isinstance(caught.value, index.PackageNotFoundError)
    assert str(caught.value) == f"package 'nowhere' not found, searching: {index.get_search_paths()}"
    assert str(prefixes) in str(caught.value)
    assert str(index.PackageNotFoundError()) == ""


@pytest.mark.usefixtures("prefixes")
def test_a_missing_share_folder_is_a_warning(index: ModuleType) -> None:
    with pytest.warns(UserWarning, match="share directory of 'both'"):
        index.get_package_share_directory("both")
    assert index.get_package_share_directory("both", print_warning=False).endswith("share/both")


@pytest.mark.usefixtures("prefixes")
@pytest.mark.parametrize("name", ["", "a/b", "..\\a"])
def test_names_that_escape_the_index_are_rejected(index: ModuleType, name: str) -> None:
    with pytest.raises(ValueError, match=r"empty|not a valid package name"):
        index.get_package_prefix(name)
    with pytest.raises(ValueError, match=r"empty|invalid name"):
        index.get_resource("packages", name)
    with pytest.raises(ValueError, match=r"empty|invalid name"):
        index.get_resources(name)


def test_resources_have_content_and_a_prefix(index: ModuleType, prefixes: Path) -> None:
    assert index.get_resource("rosidl_interfaces", "robot") == (LISTED, f"{prefixes}/over")
    assert index.has_resource("rosidl_interfaces", "robot") == f"{prefixes}/over"
    assert index.has_resource("rosidl_interfaces", "plain") is False
    assert index.get_resource_types() == {"packages", "rosidl_interfaces"}
    with pytest.raises(LookupError, match=r"'plain' of type 'rosidl_interfaces'"):
        index.get_resource("rosidl_interfaces", "plain")


@pytest.mark.usefixtures("prefixes")
def test_interfaces_are_listed_without_requests_and_responses(runtime: ModuleType) -> None:
    assert runtime.get_interfaces() == {"robot": ["action/Go", "msg/Pose", "srv/Do"]}
    assert list(runtime.get_interfaces(["robot", "plain"])) == ["robot"]
    assert list(runtime.get_interface_packages()) == ["robot"]
    assert runtime.get_message_interfaces() == {"robot": ["msg/Pose"]}
    assert runtime.get_service_interfaces(["robot", "plain"]) == {"robot": ["srv/Do"]}
    assert runtime.get_action_interfaces() == {"robot": ["action/Go"]}
    with pytest.raises(LookupError, match=r"^Unknown package 'nowhere'$"):
        runtime.get_interfaces(["nowhere"])


PATHS = [
    ("robot/msg/Pose", "msg/Pose.msg"),
    ("robot/msg/Pose.idl", "msg/Pose.idl"),
    ("robot/srv/Do", "srv/Do.idl"),
]


@pytest.mark.parametrize(("name", "path"), PATHS)
def test_a_definition_is_found(runtime: ModuleType, prefixes: Path, name: str, path: str) -> None:
    assert runtime.get_interface_path(name) == f"{prefixes}/over/share/robot/{path}"


NOT_THERE = [
    (
        "std_msgs/String",
        ValueError,
        r"Invalid name 'std_msgs/String'\. Expected three parts separated by '/'",
    ),
    ("a//b", ValueError, r"Invalid name 'a//b'\. Must not contain empty parts"),
    ("a/../b", ValueError, r"Invalid name 'a/\.\./b'\. Must not contain '\.\.'"),
    ("nowhere/msg/A", LookupError, "Unknown package 'nowhere'"),
    ("robot/msg/A", LookupError, r"Could not find the interface '.*/over/share/robot/msg/A\.idl'"),
]


@pytest.mark.usefixtures("prefixes")
@pytest.mark.parametrize(("name", "error", "words"), NOT_THERE)
def test_a_missing_definition_is_reported(
    runtime: ModuleType, name: str, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=f"^{words}$"):
        runtime.get_interface_path(name)
