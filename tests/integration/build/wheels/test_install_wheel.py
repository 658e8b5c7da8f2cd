"""Python packages into prefixes, with real backends."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import setuptools

from tests.conftest import Tree
from tests.wheels import SETUP, SITE, files, hello, install, setup_py

pytestmark = pytest.mark.usefixtures("own_environment")


INSTALLED = {
    "lib/talk/hello",
    "share/talk/launch/talk.launch.py",
    f"{SITE}/talk/__init__.py",
    f"{SITE}/talk/hello.py",
    f"{SITE}/talk/old.py",
}


def test_a_setup_py_package_is_installed_and_its_source_folder_stays_clean(tree: Tree) -> None:
    root = tree(SETUP)
    before = files(root / "src")
    assert install(root) == 0
    assert files(root / "install") == INSTALLED
    assert hello(root) == "hello from talk\n"
    assert files(root / "src") == before


@pytest.mark.parametrize(
    ("said", "options", "folder"),
    [
        (SETUP["src/talk/setup.cfg"], (), "lib/talk"),
        ("[install]\ninstall-scripts = $base/libexec/talk/\n", (), "libexec/talk"),
        ("[install]\ninstall_scripts=$base/lib/$dist_name\n", (), "lib/talk"),
        ("[develop]\nscript_dir=$base/lib/talk\n", (), "bin"),
        ("[develop]\nscript_dir=$base/lib/talk\n", ("--link",), "lib/talk"),
        (None, (), "bin"),
    ],
)
def test_scripts_are_installed_as_in_setup_cfg_or_in_bin(
    tree: Tree, said: str | None, options: tuple[str, ...], folder: str
) -> None:
    """As with setuptools, and with its command 'develop', which colcon's --symlink-install runs.

    ros2 itself, and the linters, say nothing and are typed without `ros2 run`.
    """
    root = tree(SETUP | {"src/talk/setup.cfg": said or ""})
    if said is None:
        (root / "src/talk/setup.cfg").unlink()
    assert install(root, *options) == 0
    assert [name for name in files(root / "install") if name.endswith("/hello")] == [f"{folder}/hello"]


@pytest.mark.parametrize(
    "changes",
    [
        {
            "src/talk/setup.cfg": SETUP["src/talk/setup.cfg"]
            + "[build_scripts]\nexecutable = /usr/bin/env python3\n"
        },
        {"src/talk/setup.cfg": SETUP["src/talk/setup.cfg"] + "[build]\nexecutable = /usr/bin/env python3\n"},
        setup_py(arguments="options={'build_scripts': {'executable': '/usr/bin/env python3'}},"),
        {
            "src/talk/setup.cfg": SETUP["src/talk/setup.cfg"],
            "src/talk/setup.py": None,
            "src/talk/pyproject.toml": """[project]
name = "talk"
version = "1"
scripts = { hello = "talk.hello:main" }
[tool.setuptools]
packages = ["talk"]
[tool.distutils.build_scripts]
executable = "/usr/bin/env python3"
""",
        },
    ],
    ids=["build_scripts", "build", "options", "pyproject"],
)
def test_scripts_use_the_configured_interpreter(tree: Tree, changes: dict[str, str | None]) -> None:
    root = tree({name: text for name, text in {**SETUP, **changes}.items() if text is not None})
    for options in ((), ("--link",)) if "src/talk/setup.py" not in changes else ((),):
        assert install(root, *options) == 0
        script = root / "install/lib/talk/hello"
        assert script.read_text().startswith("#!/usr/bin/env python3\n")
        script.unlink()


HOOKS = {
    "install": """
from setuptools.command.install import install
class Hook(install):
    def run(self):
        super().run()
        for name in os.listdir(self.install_scripts):
            with open(os.path.join(self.install_scripts, name), "a") as stream:
                stream.write("# changed\\n")
        with open(os.path.join(self.install_data, "hook"), "w") as stream:
            stream.write(" ".join((self.prefix, self.install_lib, self.install_scripts, self.install_data)))
""",
    "install_lib": """
from setuptools.command.install_lib import install_lib
class Hook(install_lib):
    def run(self):
        super().run()
        with open(os.path.join(sys.prefix, "hook"), "w") as stream:
            stream.write(self.install_dir)
""",
    "install_data": """
from distutils.command.install_data import install_data
class Hook(install_data):
    def run(self):
        self.data_files.append(("", ["hook"]))
        with open("../../build/hook", "w") as stream:
            stream.write(self.install_dir)
        self.data_files[-1] = ("", ["../../build/hook"])
        super().run()
""",
    "install_scripts": """
from setuptools.command.install_scripts import install_scripts
class Hook(install_scripts):
    def run(self):
        super().run()
        with open(os.path.join(self.install_dir, "../../hook"), "w") as stream:
            stream.write(self.install_dir)
""",
    "install_egg_info": """
from setuptools.command.install_egg_info import install_egg_info
class Hook(install_egg_info):
    def run(self):
        super().run()
        with open(os.path.join(sys.prefix, "hook"), "w") as stream:
            stream.write(self.target)
""",
}


@pytest.mark.parametrize("command", HOOKS)
def test_custom_install_commands_see_the_real_prefix(tree: Tree, command: str) -> None:
    """What it stores leads nowhere else."""
    root = tree(setup_py(HOOKS[command], f"cmdclass={{'{command}': Hook}},"))
    assert install(root) == 0
    paths = (root / "install/hook").read_text().split()
    assert paths
    assert all(f"{path}/".startswith(f"{root}/install/") for path in paths)
    assert hello(root) == "hello from talk\n"
    changes_scripts = command == "install"
    assert (root / "install/lib/talk/hello").read_text().endswith("# changed\n") == changes_scripts


def test_setup_py_runs_as_the_main_program(tree: Tree) -> None:
    """It sees the words of colcon's command line, and the prefix; so do programs that it starts."""
    after = """
import subprocess
assert __name__ == "__main__" and sys.modules["__main__"].__file__ == __file__ == os.path.abspath("setup.py")
assert sys.argv[0] == "setup.py" and "install" in sys.argv
child = subprocess.check_output([sys.executable, "-c", "import sys; print(sys.prefix)"], text=True)
with open(os.path.join(sys.prefix, "share/talk/after"), "w") as stream:
    stream.write(child)
setup(name="second", version="2", py_modules=["second"])
"""
    files_of_it = setup_py()
    files_of_it["src/talk/setup.py"] += after
    root = tree(files_of_it | {"src/talk/second.py": ""})
    assert install(root) == 0
    assert (root / "install/share/talk/after").read_text() == f"{root}/install\n"
    assert files(root / "install") == INSTALLED | {"share/talk/after", f"{SITE}/second.py"}


def test_options_of_the_install_command_are_respected(tree: Tree) -> None:
    options = "'install_scripts': '$base/libexec', 'install_lib': '$base/lib/own', "
    options += "'install_data': '$base/data', 'install_headers': '$base/h'"
    code = setup_py(arguments=f"headers=['talk.h'], options={{'install': {{{options}}}}},")
    root = tree(code | {"src/talk/setup.cfg": "", "src/talk/talk.h": ""})
    assert install(root) == 0
    assert files(root / "install") >= {
        "libexec/hello",
        "lib/own/talk/hello.py",
        "data/share/talk/launch/talk.launch.py",
        "h/talk.h",
    }


INTERMEDIATE = {
    "lib": {
        "build": {"build_lib": "made", "build_temp": "made", "build_scripts": "made_scripts"},
        "build_py": {"build_lib": "made"},
        "install_lib": {"build_dir": "made"},
    },
    "base": {"build": {"build_base": "made", "build_purelib": "made"}, "egg_info": {"egg_base": "made"}},
}


@pytest.mark.parametrize("file", ["setup.cfg", "setup.py"])
@pytest.mark.parametrize("options", INTERMEDIATE.values(), ids=INTERMEDIATE)
def test_intermediate_files_are_outside_the_sources_and_always_new(
    tree: Tree, file: str, options: dict[str, dict[str, str]]
) -> None:
    package = {**setup_py(arguments="scripts=['tool'],"), "src/talk/tool": "#!/bin/sh\n"}
    if file == "setup.py":
        package |= setup_py(arguments=f"scripts=['tool'], options={options!r},")
    else:
        for command, values in options.items():
            lines = "".join(f"{name} = {value}\n" for name, value in values.items())
            package["src/talk/setup.cfg"] += f"[{command}]\n{lines}"
    root = tree(package)
    before = files(root / "src")
    assert install(root) == 0
    assert files(root / "install") == INSTALLED | {"lib/talk/tool"}
    assert files(root / "src") == before
    (root / "src/talk/talk/old.py").unlink()
    shutil.rmtree(root / "install")
    assert install(root) == 0
    assert files(root / "install") == INSTALLED - {f"{SITE}/talk/old.py"} | {"lib/talk/tool"}


def test_scripts_that_are_not_executable_are_not_linked(tree: Tree) -> None:
    root = tree(setup_py(arguments="scripts=['tool'],") | {"src/talk/tool": "#!/bin/sh\necho tool\n"})
    assert install(root, "--link") == 0
    assert subprocess.check_output([str(root / "install/lib/talk/tool")], text=True) == "tool\n"


def test_packages_named_build_and_dist_are_linked(tree: Tree) -> None:
    """Even next to a copy that somebody built in the sources by hand."""
    every = {f"talk/{name}/__init__.py": f"# {name}\n" for name in ("build", "dist")}
    more = {f"src/talk/{name}": text for name, text in every.items()}
    more |= {f"src/talk/build/lib/{name}": text for name, text in every.items()}
    packages = SETUP["src/talk/setup.py"].replace('["talk"]', '["talk", "talk.build", "talk.dist"]')
    root = tree(SETUP | {"src/talk/setup.py": packages} | more)
    assert install(root, "--link") == 0
    for name in every:
        assert (root / "install" / SITE / name).readlink() == root / "src/talk" / name


def test_an_interpreter_path_with_a_space_works(tree: Tree) -> None:
    root = tree(
        setup_py(arguments="scripts=['tool'],") | {"src/talk/tool": "#!/usr/bin/python\nprint('tool')\n"}
    )
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(root / "a venv")], check=True)
    assert install(root, python=str(root / "a venv/bin/python3")) == 0
    assert hello(root) == "hello from talk\n"
    assert subprocess.check_output([str(root / "install/lib/talk/tool")], text=True) == "tool\n"


def test_setup_requires_does_not_download_into_the_sources(tree: Tree) -> None:
    root = tree(setup_py(arguments="setup_requires=['no-such-project-of-anybody'],"))
    before = files(root / "src")
    assert install(root) == 0
    assert files(root / "src") == before


def test_edits_are_visible_through_links_and_copies_replace_links_safely(tree: Tree) -> None:
    root = tree(SETUP)
    install(root, "--link")
    source = root / "src/talk/talk/hello.py"
    source.write_text("def main():\n    print('edited')\n")
    assert hello(root) == "edited\n"
    assert (root / "install/share/talk/launch/talk.launch.py").is_symlink()
    install(root)
    assert not any(path.is_symlink() for path in (root / "install").rglob("*"))
    assert source.read_text() == "def main():\n    print('edited')\n"


def test_identical_data_files_are_linked_to_their_own_sources(tree: Tree) -> None:
    data = """data_files=[("share/talk/x", ["cfg/one/c.yaml"]), ("share/talk/y", glob("cfg/two/*")),
        ("share/talk/z", ["../outside/c.yaml"]), ("share/talk/one", ["cfg/two/c.yaml"])],"""
    setup = SETUP["src/talk/setup.py"].replace(
        'data_files=[("share/talk/launch", ["launch/talk.launch.py"])],', data
    )
    alike = {f"src/{name}/c.yaml": "same" for name in ("talk/cfg/one", "talk/cfg/two", "outside")}
    root = tree({**SETUP, "src/talk/setup.py": f"from glob import glob\n{setup}", **alike})
    assert install(root, "--link") == 0
    share, sources = root / "install/share/talk", root / "src/talk"
    assert (share / "x/c.yaml").readlink() == sources / "cfg/one/c.yaml"
    assert (share / "y/c.yaml").readlink() == sources / "cfg/two/c.yaml"
    assert (share / "one/c.yaml").readlink() == sources / "cfg/two/c.yaml"
    assert not (share / "z/c.yaml").is_symlink(), "its source is no file of the package"


def test_identical_modules_are_linked_to_their_own_sources(tree: Tree) -> None:
    """Even if the folder of the sources has another name."""
    setup = SETUP["src/talk/setup.py"].replace(
        'packages=["talk"],',
        'packages=["talk", "talk.deep"], package_dir={"talk": "talk", "talk.deep": "other"},',
    )
    alike = {f"src/talk/{name}/__init__.py": "" for name in ("other", "deep", "talk/deep")}
    root = tree({**SETUP, "src/talk/setup.py": setup, **alike})
    assert install(root, "--link") == 0
    site = root / "install" / SITE
    assert (site / "talk/__init__.py").readlink() == root / "src/talk/talk/__init__.py"
    assert (site / "talk/deep/__init__.py").readlink() == root / "src/talk/other/__init__.py"


def test_warnings_of_a_backend_are_not_shown(tree: Tree, capfd: pytest.CaptureFixture[str]) -> None:
    """They are for the package's author, who finds them in the log; stderr is shown to everyone."""
    setup = SETUP["src/talk/setup.py"].replace("packages=", "tests_require=['x'], packages=")
    root = tree(SETUP | {"src/talk/setup.py": setup})
    assert install(root) == 0
    said = capfd.readouterr()
    assert said.err == ""
    assert "tests_require" in said.out


@pytest.mark.parametrize("contents", [["--without-pip"], []])
def test_a_fresh_virtual_environment_needs_no_packages(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, contents: list[str]
) -> None:
    """It has no setuptools, or one of its Python's age that makes no wheels."""
    root = tree(SETUP)
    subprocess.run([sys.executable, "-m", "venv", *contents, str(root / "venv")], check=True)
    python = root / "venv/bin/python3"
    (root / "build/talk/wheel").mkdir(parents=True)
    monkeypatch.chdir(root / "build/talk")  # where a build runs it, and a folder is no module called wheel
    assert install(root, python=str(python)) == 0
    assert files(root / "install") == INSTALLED
    assert (root / "install/lib/talk/hello").read_text().startswith(f"#!{python}\n")
    assert hello(root) == "hello from talk\n"


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            {"src/talk/setup.cfg": "[install]\ninstall_scripts=$base/../../away\n"},
            "/away', which is outside its",
        ),
        (
            {"src/talk/setup.cfg": "[install]\ninstall_scripts=lib/talk\n"},
            "/src/talk/lib/talk', which is outside",
        ),
        (setup_py(arguments="options={'install': {'prefix': '/elsewhere'}},"), "which is outside its"),
        (
            {"src/talk/setup.py": SETUP["src/talk/setup.py"].replace('"share/talk/launch"', '"/elsewhere"')},
            "'/elsewhere'",
        ),
        ({"src/talk/pyproject.toml": "[build-system]\nbuild-backend = 5\n"}, "invalid 'build-system' table"),
        ({"src/talk/pyproject.toml": "build-system = 5\n"}, "invalid 'build-system' table"),
        ({"src/talk/pyproject.toml": "a = [\n"}, "not well-formed TOML"),
    ],
)
def test_entry_points_that_escape_the_prefix_are_rejected(
    tree: Tree, capfd: pytest.CaptureFixture[str], said: dict[str, str], told: str
) -> None:
    root = tree(SETUP | said)
    assert install(root) == 2
    assert told in capfd.readouterr().err
    assert not list(root.rglob("away"))


def test_a_script_without_a_function_does_not_block_others(tree: Tree) -> None:
    """As colcon installs it, although it cannot be started."""
    both = '"hello = talk.hello:main", "bad = talk.hello"'
    setup = SETUP["src/talk/setup.py"].replace('"hello = talk.hello:main"', both)
    root = tree(SETUP | {"src/talk/setup.py": setup})
    assert install(root) == 0
    assert {"lib/talk/hello", "lib/talk/bad"} <= files(root / "install")


@pytest.mark.parametrize(("has_setuptools", "starts"), [(True, 1), (False, 3)])
def test_installing_a_package_starts_one_interpreter(has_setuptools: bool, starts: int, tree: Tree) -> None:
    """One without setuptools is asked what it lacks, and started again with those of forge."""
    root = tree(SETUP)
    options = ["--system-site-packages"] if has_setuptools else []
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", *options, str(root / "venv")], check=True)
    if has_setuptools:
        (site,) = root.glob("venv/lib/python*/site-packages")
        (site / "own.pth").write_text(f"{Path(setuptools.__file__).parents[1]}\n", encoding="utf-8")
    (root / "python").write_text(f'#!/bin/sh\necho >> {root}/starts\nexec {root}/venv/bin/python3 "$@"\n')
    (root / "python").chmod(0o755)
    assert install(root, python=str(root / "python")) == 0
    assert len((root / "starts").read_text().splitlines()) == starts
    assert hello(root) == "hello from talk\n"
