"""The Python modules of a workspace: pinned by `forge fetch`, from wheels in a folder, by pip and by uv."""

import json
import shutil
import subprocess
import sys
import threading
import venv
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from uv import find_uv_bin

from forge.plugins.fetch.python import missing_programs
from tests.conftest import Forge
from tests.packages import manifest_text, write_files
from tests.plugins.fetch.ros import Ros, depends
from tests.plugins.fetch.test_fetch import locked
from tests.plugins.fetch.wheels import INSTALLERS, Index

pytestmark = pytest.mark.needs("cmake", "git")

Environment = dict[str, str | None]

SETUP = """\
from setuptools import setup
setup(
    name="talker",
    version="1",
    packages=["talker"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/talker"]),
        ("share/talker", ["package.xml"]),
    ],
    install_requires=["setuptools", "rclmini", {requires}],
    entry_points={{"console_scripts": ["talk = talker:main"]}},
)
"""
MAIN = "import sys, tiny, lark\ndef main():\n    print(tiny.version, lark.version, sys.prefix)\n"


@pytest.fixture
def ros(ros: Ros) -> Ros:
    """Let the client library need a Python module."""
    ros.release("rclmini", *depends("rmw_implementation", "lib_vendor", "python3-dev", "python3-lark-parser"))
    return ros


@pytest.fixture(params=INSTALLERS)
def index(request: pytest.FixtureRequest, tmp_path: Path) -> Index:
    return filled(Index(tmp_path / "index", request.param))


@pytest.fixture
def uv(tmp_path: Path) -> Index:
    """Return the index for a test of what does not depend on the installer: uv is the faster one."""
    return filled(Index(tmp_path / "index", "uv"))


def filled(index: Index) -> Index:
    index.add("lark", "1.1")
    index.add("tiny", "1.0", "below<2")
    index.add("below", "1.0")
    index.add("below", "2.0")
    return index


def new_workspace(root: Path, requires: str = "'tiny>=1'", *lines: str) -> Path:
    """Write a workspace with a Python package that needs rclmini and modules."""
    files = {
        "package.xml": manifest_text("talker", *depends("rclmini"), *lines, build_type="ament_python"),
        "setup.py": SETUP.format(requires=requires),
        "setup.cfg": "[install]\ninstall_scripts=$base/lib/talker\n",
        "resource/talker": "",
        "talker/__init__.py": MAIN,
    }
    return write_files(root, {f"src/talker/{name}": text for name, text in files.items()})


def modules(workspace: Path) -> dict[str, str]:
    return {each["name"]: each["version"] for each in locked(workspace)["module"]}


def version_in(environment: Path, module: str) -> str:
    """Return the version of a module that an environment's Python imports, '' if it has none."""
    code = f"try:\n import {module}\n print({module}.version)\nexcept ImportError: pass"
    argv = [str(environment / "bin/python3"), "-c", code]
    return subprocess.run(argv, capture_output=True, text=True, check=True).stdout.strip()


def test_python_modules_are_pinned_and_used_by_programs(
    ros: Ros, index: Index, forge: Forge, tmp_path: Path
) -> None:
    tiny = index.add("tiny", "1.5", "below<2")
    workspace, env = new_workspace(tmp_path / "my ws"), {**ros.variables(), **index.variables()}
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    lock = locked(workspace)
    assert lock["python"] == ["lark", "tiny>=1"]
    assert modules(workspace) == {"below": "1.0", "lark": "1.1", "tiny": "1.5"}
    assert {each["name"]: each["ros"] for each in lock["module"]} == {
        "below": False,
        "lark": True,
        "tiny": False,
    }
    assert next(each for each in lock["module"] if each["name"] == "tiny")["hashes"] == [tiny]
    settings = (workspace / ".venv/pyvenv.cfg").read_text()
    assert "include-system-site-packages = false" in settings
    if index.installer == "pip":  # uv keeps no files of a folder in its cache
        index.remove()
    ran = forge("build", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    ran = forge("run", "talker", "talk", cwd=workspace, env=env)
    assert ran.out == f"1.5 1.1 {workspace / '.venv'}\n"
    (of_ros,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("*/venv")
    assert (version_in(of_ros, "lark"), version_in(of_ros, "tiny")) == ("1.1", "")
    settings = (of_ros / "pyvenv.cfg").read_text()
    assert "include-system-site-packages = true" in settings  # as other locks may need
    assert str(tmp_path) not in settings, "or no package that runs Python would come from the package cache"
    again = forge("fetch", "--locked", "--offline", cwd=workspace, env=env)
    assert (again.code, again.err) == (0, "")
    # Another file of the same version is not installed.
    filled(index)
    index.add("tiny", "1.5", "below<2", text="# another file\n")
    shutil.rmtree(tmp_path / "ros/user cache/forge/ros/modules", ignore_errors=True)
    (workspace / ".venv/forge-modules.txt").write_text("# forge installs modules\n")  # as after a kill
    ran = forge("fetch", cwd=workspace, env={**env, "UV_CACHE_DIR": str(tmp_path / "new cache")})
    assert ran.code == 2
    assert f"cannot install Python modules for '{workspace / '.venv/bin/python3'}': " in ran.err
    assert "hash" in ran.err.lower()


def test_modules_have_versions_that_packages_of_ros_support(
    ros: Ros, uv: Index, forge: Forge, tmp_path: Path
) -> None:
    for version in ("8.4", "9.0"):
        uv.add("pytest", version)
    manifest = depends("python3-pytest", tag="test_depend")
    workspace = new_workspace(tmp_path / "ws", "'tiny>=1'", *manifest)
    assert forge("fetch", "--test", cwd=workspace, env={**ros.variables(), **uv.variables()}).code == 0
    assert modules(workspace)["pytest"] == "8.4"


def test_modules_keep_their_versions_until_update(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), **uv.variables()}
    assert forge("fetch", cwd=workspace, env=env).code == 0
    uv.add("lark", "1.2")
    uv.add("tiny", "1.2")
    uv.add("more", "1.0")
    new_workspace(workspace, "'tiny>=1', 'more'")
    ran = forge("fetch", "--locked", cwd=workspace, env=env)
    assert (ran.code, "is out of date" in ran.err) == (2, True)
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert modules(workspace) == {"below": "1.0", "lark": "1.1", "more": "1.0", "tiny": "1.0"}
    env["VIRTUAL_ENV"] = str(workspace / ".venv")  # it may be the active one
    assert forge("fetch", "--update", "tiny", cwd=workspace, env=env).code == 0
    assert modules(workspace) == {"lark": "1.1", "more": "1.0", "tiny": "1.2"}
    assert version_in(workspace / ".venv", "tiny") == "1.2"


def test_workspaces_that_need_different_modules_install_them_once(
    ros: Ros, uv: Index, forge: Forge, tmp_path: Path
) -> None:
    modules_of = {"psutil": "5.0", "netifaces": "0.1"}
    for name, version in modules_of.items():
        uv.add(name, version)
        ros.release(f"show_{name}", *depends("rclmini", f"python3-{name}"))
    env = {**ros.variables(), **uv.variables()}
    for name in modules_of:
        workspace = tmp_path / name
        workspace.mkdir()
        assert forge("fetch", f"show_{name}", cwd=workspace, env=env).code == 0
        ran = forge("build", cwd=workspace, env=env)
        assert (ran.code, "installing 2 Python modules in " in ran.err) == (0, True), ran.err
    (of_ros,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("*/venv")
    for name in modules_of:
        ran = forge("build", cwd=tmp_path / name, env=env)
        assert (ran.code, ran.err) == (0, "")
        assert {each: version_in(of_ros, each) for each in modules_of} == modules_of


def test_a_lock_of_another_machine_is_installed_offline_with_hash_checks(
    ros: Ros, uv: Index, forge: Forge, tmp_path: Path
) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), **uv.variables()}
    assert forge("fetch", cwd=workspace, env=env).code == 0
    lock = (workspace / "forge.lock").read_text()
    other = new_workspace(tmp_path / "other")
    ran = forge("fetch", "--offline", cwd=other, env=env)
    assert (ran.code, "not locked yet" in ran.err) == (2, True)
    (other / "forge.lock").write_text(lock)
    assert forge("fetch", "--offline", cwd=other, env=env).code == 0
    assert version_in(other / ".venv", "tiny") == "1.0"
    uv.add("tiny", "1.0", text="# another file\n")
    shutil.rmtree(other / ".venv")
    ran = forge("build", cwd=other, env={**env, "UV_CACHE_DIR": str(tmp_path / "new cache")})
    assert (ran.code, "hash" in ran.err.lower()) == (2, True)
    assert (other / "forge.lock").read_text() == lock


def test_the_lock_has_hashes_of_files_for_other_platforms(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    index = Index(tmp_path / "index", "pip")
    index.add("lark", "1.1")
    own, other = index.add("tiny", "1.0").partition(":")[2], "0" * 64
    hashes = {"tiny-1.0-py3-none-any.whl": own, "tiny-1.0.tar.gz": other, "tiny-0.9.tar.gz": "1" * 64}
    links = "".join(f'<a href="/files/{name}#sha256={value}">{name}</a>' for name, value in hashes.items())
    write_files(tmp_path / "index/simple", {"tiny/index.html": links})
    serve = partial(SimpleHTTPRequestHandler, directory=str(tmp_path / "index"))
    with ThreadingHTTPServer(("127.0.0.1", 0), serve) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_address[1]}/simple"
        env = {**ros.variables(), **index.variables(), "PIP_NO_INDEX": None, "PIP_INDEX_URL": url}
        workspace = new_workspace(tmp_path / "ws", "'tiny'")
        ran = forge("fetch", cwd=workspace, env=env)
        server.shutdown()
    assert ran.code == 0, ran.err
    found = {each["name"]: each["hashes"] for each in locked(workspace)["module"]}
    assert found["tiny"] == [f"sha256:{other}", f"sha256:{own}"]


def test_url_requirements_are_not_pinned(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    workspace = new_workspace(tmp_path / "ws", "'tiny @ https://example.invalid/tiny.whl'")
    ran = forge("fetch", cwd=workspace, env={**ros.variables(), **uv.variables()})
    assert ran.code == 0
    assert "'talker' requires 'tiny @ https://example.invalid/tiny.whl': forge cannot pin URLs" in ran.err
    assert modules(workspace) == {"lark": "1.1"}


def test_only_missing_modules_are_installed_into_an_active_environment(
    ros: Ros, uv: Index, forge: Forge, tmp_path: Path
) -> None:
    environment = tmp_path / "mine"
    venv.create(environment, symlinks=True)
    older = Index(tmp_path / "older", "uv")
    older.add("tiny", "0.9")
    argv = [find_uv_bin(), "pip", "install", "--quiet", "--offline", "--no-index", "--find-links"]
    subprocess.run([*argv, older.files, "--python", environment, "tiny"], check=True)
    uv.add("tiny", "1.2")
    workspace = new_workspace(tmp_path / "ws", "'tiny'")
    env = {**ros.variables(), **uv.variables(), "VIRTUAL_ENV": str(environment)}
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert f"'{environment / 'bin/python3'}' has tiny 0.9, not 1.2 of the lock" in ran.err
    assert (version_in(environment, "lark"), version_in(environment, "tiny")) == ("1.1", "0.9")
    assert not (workspace / ".venv").exists()


def test_a_configured_interpreter_is_not_modified(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), **uv.variables()}
    python = Path(sys.executable).resolve()
    write_files(workspace, {"forge.toml": f"[build]\npython = '{python}'\n"})
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert "lacks below==1.0 lark==1.1 tiny==1.0\nhint: install them, or use a virtual environment" in ran.err
    assert not (workspace / ".venv").exists()


def test_packages_find_programs_from_pypi(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    uv.add("vcs2l", "1.0", text="def main(): print('the program')", program="only-on-pypi")
    find = """\
find_program(PROGRAM only-on-pypi REQUIRED)
execute_process(COMMAND ${PROGRAM} OUTPUT_FILE ${CMAKE_CURRENT_BINARY_DIR}/printed.txt)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/printed.txt DESTINATION share)"""
    ros.release("cloning", *depends("python3-vcstool"), cmake=find)
    workspace, env = tmp_path / "ws", {**ros.variables(), **uv.variables()}
    workspace.mkdir()
    for command in (("fetch", "cloning"), ("build",)):
        ran = forge(*command, cwd=workspace, env=env)
        assert ran.code == 0, ran.err
    (printed,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("*/install/share/printed.txt")
    assert printed.read_text() == "the program\n"


def test_a_python_workspace_needs_no_ros_packages(uv: Index, ros: Ros, forge: Forge, tmp_path: Path) -> None:
    project = "[project]\nname = 'tool'\nversion = '1'\ndependencies = ['tiny']\n"
    files = {"package.xml": manifest_text("tool", build_type="ament_python"), "pyproject.toml": project}
    workspace = write_files(tmp_path / "ws/src/tool", files).parent.parent
    env = {**ros.variables(), **uv.variables()}
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert modules(workspace) == {"below": "1.0", "tiny": "1.0"}
    write_files(workspace / "src/tool", {"pyproject.toml": project.replace("'tiny'", "")})
    assert "nothing to fetch" in forge("fetch", cwd=workspace, env=env).out
    assert "module" not in locked(workspace)


def test_an_unsatisfiable_requirement_gives_one_error(
    ros: Ros, uv: Index, forge: Forge, tmp_path: Path
) -> None:
    workspace, env = new_workspace(tmp_path / "ws", "'tiny>9'"), {**ros.variables(), **uv.variables()}
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 2
    assert "cannot find Python modules for" in ran.err
    assert "tiny>9" in ran.err
    assert not (workspace / "forge.lock").exists()


def test_an_interrupted_installation_is_repeated(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), **uv.variables()}
    assert forge("fetch", cwd=workspace, env=env).code == 0
    environment = workspace / ".venv"
    for state in ("# forge installs modules\n", "# forge makes this environment\n"):
        (module,) = environment.glob("lib/python*/site-packages/tiny.py")
        module.unlink()
        place = module.parent
        (place / "tiny-1.0.dist-info/RECORD").unlink()
        record = "old.py,,\ntiny-0.9.dist-info/RECORD,,\n../../../../kept.txt,,\n"
        remains = {"tiny-0.9.dist-info/RECORD": record, "old.py": "", "~iny/tiny.py": "", "own.py": ""}
        write_files(place, remains)
        (workspace / "kept.txt").touch()
        (environment / "forge-modules.txt").write_text(state)
        ran = forge("fetch", "--locked", cwd=workspace, env=env)
        assert ran.code == 0, ran.err
        assert version_in(environment, "tiny") == "1.0"
        assert [path.name for path in place.glob("tiny-*")] == ["tiny-1.0.dist-info"]
        assert not {path.name for path in place.iterdir()} & {"old.py", "~iny"}
        assert (workspace / "kept.txt").is_file()


def test_malformed_modules_in_a_lock_are_rejected(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), **uv.variables()}
    assert forge("fetch", cwd=workspace, env=env).code == 0
    lock = workspace / "forge.lock"
    lock.write_text(lock.read_text().replace('"tiny"', json.dumps("tiny --index-url=https://x.invalid")))
    ran = forge("build", cwd=workspace, env=env)
    assert (ran.code, "invalid version or hash of 'tiny --index-url" in ran.err) == (2, True)


def test_a_broken_environment_of_the_user_is_kept(ros: Ros, uv: Index, forge: Forge, tmp_path: Path) -> None:
    """forge removes only environments that it made."""
    root = new_workspace(tmp_path / "ws")
    write_files(root, {".venv/pyvenv.cfg": "home = /nowhere\n", ".venv/notes.txt": "mine\n"})
    ran = forge("fetch", cwd=root, env={**ros.variables(), **uv.variables()})
    assert ran.code == 2
    assert "is not a working Python environment, and was not created by forge" in ran.err
    assert (root / ".venv/notes.txt").read_text() == "mine\n"


def test_programs_that_modules_start_are_named_if_they_are_missing(tmp_path: Path) -> None:
    keys = {"python3-pydot": ["qt_dotgraph"], "python3-yaml": ["rclpy"]}
    (problem,) = missing_programs(keys, {"PATH": str(tmp_path)})
    assert problem.message == "'qt_dotgraph' needs the program 'dot' to run"
    assert problem.hint == "install it, for example with `apt install graphviz`"
    write_files(tmp_path, {"dot": "#!/bin/sh\n"})
    assert not [*missing_programs(keys, {"PATH": str(tmp_path)})]
