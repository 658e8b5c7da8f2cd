"""forge pkg: output, files, errors."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.snippets import ROOT

INDEX = "share/ament_index/resource_index/packages"
MANIFEST = """<?xml version="1.0"?>
<?xml-model href="somewhere"?>
<package format="3">
  <!-- why it walks -->
  <name>walker</name>
  <version>1.2.3</version>
  <depend>legs</depend>
  <depend>feet</depend>
</package>
"""


@pytest.fixture
def prefix(tree: Tree) -> Path:
    """Give an installed tree with two packages, one of them in two prefixes."""
    root = tree(
        {
            f"one/{INDEX}/walker": "",
            "one/share/walker/package.xml": MANIFEST,
            "one/lib/walker/walk": "#!/bin/sh\n",
            "one/lib/walker/deep/run": "#!/bin/sh\n",
            "one/lib/walker/.hidden/no": "#!/bin/sh\n",
            "one/lib/walker/notes.txt": "not a program\n",
            "one/bin/elsewhere": "#!/bin/sh\n",
            f"two/{INDEX}/walker": "",
            f"two/{INDEX}/arm": "",
            f"two/{INDEX}/.hidden": "",
            "two/lib/arm/wave": "#!/bin/sh\n",
        }
    )
    (root / "one/lib/walker/stroll").symlink_to("walk")
    (root / "one/lib/walker/elsewhere").symlink_to(root / "one/bin")
    (root / "one/lib/walker/nowhere").symlink_to("gone")
    return root


def sourced(root: Path) -> dict[str, str | None]:
    return {"AMENT_PREFIX_PATH": f"{root}/one:{root}/gone:{root}/two"}


def test_create_lists_the_files_it_writes(forge: Forge, tmp_path: Path) -> None:
    argv = ("walker", "--dependencies", "rclcpp", "rclcpp", "--maintainer-email", "a@b.cd")
    ran = forge("pkg", "create", *argv, "--maintainer-name", "Ada", "--license", "MIT", cwd=tmp_path)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.splitlines() == [
        "going to create a new package",
        "package name: walker",
        f"destination directory: {tmp_path}",
        "package format: 3",
        "version: 0.0.0",
        "description: TODO: Package description",
        "maintainer: ['Ada <a@b.cd>']",
        "licenses: ['MIT']",
        "build type: ament_cmake",
        "dependencies: ['rclcpp']",
        "creating folder ./walker",
        "creating ./walker/package.xml",
        "creating source and include folder",
        "creating folder ./walker/src",
        "creating folder ./walker/include/walker",
        "creating ./walker/CMakeLists.txt",
        "creating ./walker/LICENSE",
    ]
    assert (tmp_path / "walker/include/walker").is_dir()


def test_create_creates_the_destination_and_the_python_package(forge: Forge, tmp_path: Path) -> None:
    argv = ("--build-type", "ament_python", "--destination-directory", "new/src/", "--node-name", "walk")
    ran = forge("pkg", "create", "walker", *argv, "--library-name", "gait", cwd=tmp_path)
    assert ran.code == 0
    told = ran.out.splitlines()
    assert [line for line in told if line.startswith(("node", "library"))] == [
        "node_name: walk",
        "library_name: gait",
    ]
    assert told[told.index("creating source folder") + 1] == "creating folder new/src/walker/walker"
    made = {path.relative_to(tmp_path / "new/src/walker").as_posix() for path in tmp_path.rglob("*.py")}
    tests = {f"test/test_{name}.py" for name in ("copyright", "flake8", "pep257")}
    assert made == {"setup.py", "walker/__init__.py", "walker/walk.py", "walker/gait/__init__.py", *tests}


def test_create_succeeds_with_a_closed_stdout(tmp_path: Path) -> None:
    argv = (sys.executable, "-m", "forge", "pkg", "create", "p", "--build-type", "ament_cmake")
    ours, theirs = os.pipe()
    os.close(ours)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    ran = subprocess.run(argv, cwd=tmp_path, stdout=theirs, env=environment, check=False)
    os.close(theirs)
    assert ran.returncode == 0
    assert (tmp_path / "p/CMakeLists.txt").is_file()


def test_create_renames_a_node_with_the_name_of_the_library(forge: Forge, tmp_path: Path) -> None:
    ran = forge("pkg", "create", "walker", "--node-name", "x", "--library-name", "x", cwd=tmp_path)
    assert ran.code == 0
    assert ran.err.splitlines()[:2] == [
        "warning: node and library cannot both be named 'x'",
        "warning: the node is named 'x_node' instead",
    ]
    assert (tmp_path / "walker/src/x_node.cpp").is_file()


def test_create_warns_about_an_unusual_name_and_a_missing_license(forge: Forge, tmp_path: Path) -> None:
    ran = forge("pkg", "create", "walker", cwd=tmp_path)
    assert (ran.code, ran.err) == (
        0,
        "note: no license yet: choose one with --license, such as --license MIT\n",
    )
    assert "<license>TODO: License declaration</license>" in (tmp_path / "walker/package.xml").read_text()
    ran = forge("pkg", "create", "Walker", "--license", "apache-2.0", cwd=tmp_path)
    assert ran.code == 0
    assert ran.err.splitlines() == [
        "warning: 'Walker' is an unusual name: package names start with a letter and are lower case",
        "warning: no LICENSE file created: unknown license 'apache-2.0'",
        "hint: did you mean 'Apache-2.0'?",
    ]


def test_a_created_interface_package_has_an_interface_of_each_kind(forge: Forge, tmp_path: Path) -> None:
    ran = forge("pkg", "create", "walker_msgs", "--interfaces", cwd=tmp_path)
    assert ran.code == 0
    assert "interfaces: ['Example.msg', 'Example.srv', 'Example.action']\n" in ran.out
    assert "creating folders of interfaces\ncreating folder ./walker_msgs/msg\n" in ran.out
    words = ("--package", "walker_msgs", "--output", "out", "--lang", "cpp", "walker_msgs")
    assert forge("interface", "generate", *words, cwd=tmp_path).code == 0
    for kind in ("msg", "srv", "action"):
        assert (tmp_path / f"out/cpp/walker_msgs/{kind}/example.hpp").is_file()


@pytest.mark.parametrize("argv", [("walker", "--license", "?"), ("--license", "?")])
def test_question_mark_lists_the_licenses(argv: tuple[str, ...], forge: Forge, tmp_path: Path) -> None:
    ran = forge("pkg", "create", *argv, cwd=tmp_path)
    assert ran.code == 0
    assert ran.out.splitlines()[:2] == ["Supported licenses:", "Apache-2.0"]
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("there", "destination", "message"),
    [
        ("walker/file", ".", "'walker' already exists\nhint: remove it, or choose another name or "),
        ("walker", ".", "'walker' already exists\nhint: "),
        ("file", "file", "cannot create 'file/walker': not a directory\n"),
    ],
)
def test_create_keeps_existing_files(
    there: str, destination: str, message: str, forge: Forge, tree: Tree
) -> None:
    root = tree({there: "mine\n"})
    ran = forge("pkg", "create", "walker", "--destination-directory", destination, cwd=root)
    assert ran.code == 2
    assert ran.err.startswith(f"error: {message}")
    assert [path.name for path in root.rglob("*") if path.is_file()] == [Path(there).name]


def test_create_validates_before_writing(forge: Forge, tmp_path: Path) -> None:
    ran = forge("pkg", "create", "my walker", cwd=tmp_path)
    assert (ran.code, ran.out, list(tmp_path.iterdir())) == (2, "", [])
    assert ran.err.startswith("error: invalid package name 'my walker'\nhint: ")


@pytest.mark.parametrize(
    ("email", "told"), [("ada@example.org", "ada@example.org"), ("ada@home", "Ada.L@todo.todo")]
)
@pytest.mark.needs("git")
def test_the_email_address_is_taken_from_git(email: str, told: str, forge: Forge, tree: Tree) -> None:
    root = tree({"gitconfig": f"[user]\n\temail = {email}\n"})
    env = {"GIT_CONFIG_GLOBAL": str(root / "gitconfig"), "GIT_CONFIG_SYSTEM": os.devnull}
    ran = forge("pkg", "create", "walker", "--maintainer-name", "Ada L", cwd=root, env=env)
    assert f"maintainer: ['Ada L <{told}>']" in ran.out


def test_without_git_the_login_name_is_used(forge: Forge, tmp_path: Path) -> None:
    ran = forge("pkg", "create", "walker", cwd=tmp_path, env={"PATH": str(tmp_path), "LOGNAME": "ada"})
    assert "maintainer: ['ada <ada@todo.todo>']" in ran.out


@pytest.mark.parametrize(
    ("argv", "out"),
    [
        ("list", "arm\nwalker\n"),
        ("executables", "arm wave\nwalker run\nwalker stroll\nwalker walk\n"),
        ("executables arm --full-path", "{}/two/lib/arm/wave\n"),
        ("prefix walker", "{}/one\n"),
        ("prefix arm --share", "{}/two/share/arm\n"),
        ("xml walker", MANIFEST[MANIFEST.index("<package") :]),
        ("xml walker -t version", "1.2.3\n"),
        ("xml walker --tag depend", "legs\nfeet\n"),
    ],
)
def test_installed_packages_are_queried_in_the_order_of_the_prefixes(
    argv: str, out: str, forge: Forge, prefix: Path
) -> None:
    assert forge("pkg", *argv.split(), env=sourced(prefix)).out == out.replace("{}", str(prefix))


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("prefix", "walkr"), "error: package 'walkr' not found\nhint: did you mean 'walker'?\n"),
        (("executables", "zzz"), "error: package 'zzz' not found\n"),
        (("prefix", "../packages/walker", "--share"), "error: package '../packages/walker' not found\n"),
        (("xml", "walker", "-t", "versoin"), "error: XML tag not found\nhint: did you mean 'version'?\n"),
        (
            ("xml", "arm"),
            "error: package XML manifest not found\nhint: expected '{}/two/share/arm/package.xml'\n",
        ),
    ],
)
def test_missing_packages_give_one_error(
    argv: tuple[str, ...], message: str, forge: Forge, prefix: Path
) -> None:
    ran = forge("pkg", *argv, env=sourced(prefix))
    assert (ran.code, ran.out, ran.err) == (2, "", message.replace("{}", str(prefix)))


@pytest.mark.parametrize("verb", ["list", "executables"])
def test_without_prefix_and_workspace_the_next_step_is_suggested(verb: str, forge: Forge, tree: Tree) -> None:
    ran = forge("pkg", verb, cwd=tree({"ws/src/notes": ""}))
    assert ran.code == 2
    assert ran.err == (
        "error: no package can be found: 'AMENT_PREFIX_PATH' is not set\n"
        "hint: change to a workspace that was built, or source the setup script of an installation\n"
    )


@pytest.mark.parametrize("layout", ["isolated", "merged"])
def test_the_current_workspace_need_not_be_sourced(layout: str, forge: Forge, tree: Tree) -> None:
    """Sourced prefixes come first, then the workspace, then the underlays that it was built on."""
    folder = "" if layout == "merged" else "walker/"
    root = tree(
        {
            "ws/install/.colcon_install_layout": f"{layout}\n",
            f"ws/install/{folder}{INDEX}/walker": "",
            f"ws/install/{folder}lib/walker/walk": "#!/bin/sh\n",
            f"ws/install/{folder}share/walker/package.xml": MANIFEST,
            "ws/src/notes": "",
            f"under/{INDEX}/arm": "",
            f"under/{INDEX}/walker": "",
            "under/lib/arm/wave": "#!/bin/sh\n",
            f"sourced/{INDEX}/leg": "",
        }
    )
    state = {"python": "python3", "underlays": [str(root / "under"), str(root / "gone")]}
    (root / "ws/install/.forge.json").write_text(json.dumps(state))
    cwd, env = root / "ws/src", {"AMENT_PREFIX_PATH": str(root / "sourced")}
    assert forge("pkg", "list", cwd=cwd, env=env).out == "arm\nleg\nwalker\n"
    assert forge("pkg", "executables", cwd=cwd).out == "arm wave\nwalker walk\n"
    assert forge("pkg", "prefix", "walker", cwd=cwd).out == f"{root}/ws/install/{folder}".rstrip("/") + "\n"
    assert forge("pkg", "xml", "walker", "-t", "version", cwd=cwd, env=env).out == "1.2.3\n"
    env = {"AMENT_PREFIX_PATH": str(root / "under")}
    assert forge("pkg", "prefix", "walker", cwd=cwd, env=env).out == f"{root}/under\n"
    assert forge("pkg", "prefix", "wlaker", cwd=root / "ws").err == (
        "error: package 'wlaker' is not installed in 'install'\nhint: did you mean 'walker'?\n"
    )
