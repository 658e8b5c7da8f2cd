"""Mistakes in Python packages that build backends do not report."""

import pytest

from forge.base.errors import Location
from forge.plugins.pyproject.pitfalls import invalid_scripts, invalid_scripts_of_setup
from tests.conftest import Tree
from tests.wheels import SETUP, install, setup_py

pytestmark = pytest.mark.usefixtures("own_environment")


@pytest.mark.needs("gcc")
def test_compiled_and_relocated_modules_give_no_warnings(
    tree: Tree, capfd: pytest.CaptureFixture[str]
) -> None:
    """A compiled module has no syntax, and `install_lib` moves the modules."""
    setup = setup_py(
        "from setuptools import Extension",
        "ext_modules=[Extension('talk.c', ['c.c'])], options={'install': {'install_lib': '$base/lib/own'}},",
    )
    root = tree(setup | {"src/talk/c.c": "int value;\n"})
    assert install(root) == 0
    assert list(root.glob("install/lib/own/talk/c.*.so"))
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"setup.py": "from setuptools import setup\nsetup(name='talk'\n      version='1')\n"},
            ("{}/setup.py:2:", ": error: ", "    setup(name='talk'\n"),
        ),
        (
            {"setup.py": None},
            ("{}: error: there is neither a setup.py nor a pyproject.toml", "hint: 'forge pkg create"),
        ),
        (
            {"talk/hello.py": "def main()\n    pass\n"},
            ("{}/talk/hello.py:1:11: warning: expected ':'", "    def main()\n"),
        ),
        (
            {"talk/hello.py": "def main():\n    if 1:\n\tpass\n"},
            ("{}/talk/hello.py:3", "warning: inconsistent use of tabs"),
        ),
        (
            {"setup.py": SETUP["src/talk/setup.py"].replace("talk.hello:", "talk.helo:")},
            (
                "{}/setup.py: warning: the script 'hello' starts 'talk.helo', which",
                "hint: did you mean 'talk.hello'?",
            ),
        ),
        (
            {"setup.py": SETUP["src/talk/setup.py"].replace(":main", ":mian")},
            (
                "{}/setup.py: warning: 'hello' calls 'mian', which 'talk.hello' does not define",
                "hint: did you mean 'main'?",
            ),
        ),
        (
            {
                "talk/__init__.py": None,
                "setup.py": SETUP["src/talk/setup.py"]
                .replace('packages=["talk"]', "packages=find_packages()")
                .replace("import setup", "import find_packages, setup"),
            },
            (
                "{}/setup.py: warning: the script 'hello' starts 'talk.hello', which",
                "hint: add an empty {}/talk/__init__.py",
            ),
        ),
    ],
    ids=["setup.py", "no setup.py", "syntax", "tabs", "module", "function", "__init__"],
)
def test_metadata_errors_that_backends_miss_are_reported(
    changes: dict[str, str | None], told: tuple[str, ...], tree: Tree, capfd: pytest.CaptureFixture[str]
) -> None:
    """Such a package would be installed, and fail when it is started."""
    root = tree(SETUP)
    source = root / "src/talk"
    for name, text in changes.items():
        if text is None:
            (source / name).unlink()
        else:
            (source / name).write_text(text, encoding="utf-8")
    code = install(root)
    err = capfd.readouterr().err
    assert code == (2 if "error: " in err else 0)
    assert "Traceback" not in err
    for part in told:
        assert part.format(source) in err


@pytest.mark.parametrize(
    ("point", "problem", "meant"),
    [
        ("hello = talk.hello", "lacks ':FUNCTION'", "hello = talk.hello:main"),
        ("hello talk.hello:run", "lacks '='", "hello = talk.hello:run"),
        (
            "hello = talk/hello:main()",
            "is not of the form 'NAME = MODULE:FUNCTION'",
            "hello = talk.hello:main",
        ),
    ],
)
def test_an_invalid_entry_point_in_setup_py_gives_one_error(
    point: str, problem: str, meant: str, tree: Tree, capfd: pytest.CaptureFixture[str]
) -> None:
    """Whether setuptools or only the installation rejects it."""
    setup = SETUP["src/talk/setup.py"].replace("hello = talk.hello:main", point)
    root = tree(SETUP | {"src/talk/setup.py": setup})
    only_warned = "FUNCTION'" in problem and "lacks" in problem
    assert install(root) == (0 if only_warned else 2)
    first, quoted, *rest = capfd.readouterr().err.splitlines()
    place, _, message = first.partition(": ")
    assert place.startswith(f"{root}/src/talk/setup.py:4")
    severity = "warning" if only_warned else "error"
    assert message.startswith(f"{severity}: the entry point '{point}' {problem}")
    assert f"'{point}'" in quoted.replace('"', "'")
    assert rest[-1] == f"hint: write '{meant}'"


def test_a_computed_entry_point_is_reported_with_its_file(tree: Tree) -> None:
    setup = "package = 'talk'\nsetup(entry_points={'console_scripts': ['hello = ' + package + '.hello']})\n"
    source = tree({"setup.py": setup})
    assert list(invalid_scripts_of_setup(source / "setup.py")) == []
    (problem,) = invalid_scripts("[console_scripts]\nhello = talk.hello\n", source)
    assert problem.location == Location(source / "setup.py")
    assert not list(invalid_scripts("no section\n", source))


def test_a_correct_package_gives_no_warnings(tree: Tree, capfd: pytest.CaptureFixture[str]) -> None:
    """Functions may come from anywhere, and modules from other packages."""
    points = "['a = talk.hello:Node.main', 'b = other.module:main', 'c = talk:late', 'd = talk.hello:given']"
    setup = SETUP["src/talk/setup.py"].replace('["hello = talk.hello:main"]', points)
    root = tree(
        {
            **SETUP,
            "src/talk/setup.py": setup,
            "src/talk/talk/__init__.py": "def __getattr__(name):\n    return print\n",
            "src/talk/talk/hello.py": "from os import *\nclass Node:\n    main = print\n",
        }
    )
    assert install(root) == 0
    assert capfd.readouterr().err == ""


def test_a_script_with_a_path_as_its_name_is_rejected(tree: Tree, capfd: pytest.CaptureFixture[str]) -> None:
    setup = SETUP["src/talk/setup.py"].replace("hello = ", "../../../away = ")
    root = tree(SETUP | {"src/talk/setup.py": setup})
    assert install(root) == 2
    assert "contains a path separator" in capfd.readouterr().err
    assert not list(root.rglob("away"))


def test_the_traceback_of_a_setup_py_omits_internal_frames(
    tree: Tree, capfd: pytest.CaptureFixture[str]
) -> None:
    """Neither forge nor setuptools is the reason."""
    root = tree({"src/talk/setup.py": "def fail():\n    raise RuntimeError('my own words')\nfail()\n"})
    assert install(root) == 2
    assert capfd.readouterr().err == (
        "Traceback (most recent call last):\n"
        f'  File "{root}/src/talk/setup.py", line 3, in <module>\n'
        "    fail()\n"
        f'  File "{root}/src/talk/setup.py", line 2, in fail\n'
        "    raise RuntimeError('my own words')\n"
        "RuntimeError: my own words\n"
        "error: the package's build backend 'setuptools.build_meta' failed; see its output above\n"
    )


def test_the_progress_before_an_error_is_not_shown(tree: Tree, capfd: pytest.CaptureFixture[str]) -> None:
    """It is in the log; setuptools has the command that makes wheels."""
    root = tree(SETUP)
    (root / "src/talk/launch/talk.launch.py").unlink()
    assert install(root) == 2
    said = capfd.readouterr()
    assert said.err == (
        "error: can't copy 'launch/talk.launch.py': doesn't exist or not a regular file\n"
        "error: the package's build backend 'setuptools.build_meta' failed; see its output above\n"
    )
    assert "running install_data\n" in said.out
