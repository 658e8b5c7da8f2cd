"""What ROS programs do with messages works with generated code: the snippets in tests/data/user_code."""

import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from forge.cli.main import main
from forge.interfaces.read.sources import Library
from tests.snippets import shell

pytestmark = pytest.mark.slow

CODE = Path(__file__).parents[1] / "data/user_code"
PYTHON = sorted((CODE / "python").glob("*.py"))
CPP = sorted((CODE / "cpp").glob("*.cpp"))
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
MAIN = """{includes}
#include <map>

int main(int, char ** arguments)
{{
  const std::map<std::string, void (*)()> programs = {{{programs}}};
  programs.at(arguments[1])();
}}
"""


def _name(path: Path) -> str:
    return path.stem


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate everything that forge brings along, and the package 'rover', into one folder."""
    out = tmp_path_factory.mktemp("generated")
    for package, folder in {**Library().packages(), "rover": CODE / "rover"}.items():
        words = ("--package", package, "--output", str(out), str(folder))
        assert main(("interface", "generate", *words)) == 0
    return out


@pytest.fixture(scope="module")
def _importable(generated: Path) -> Iterator[None]:
    """Let this interpreter find the generated modules for a while, and their run time."""
    before = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(generated / "python"))
        yield
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(f"{generated}/"):
            del sys.modules[name]


@pytest.mark.usefixtures("_importable")
@pytest.mark.parametrize("program", PYTHON, ids=_name)
def test_python_snippets_run(program: Path) -> None:
    """Each is a list of statements and assertions; nothing else happens here."""
    runpy.run_path(str(program), run_name="__main__")


def test_python_programs_pass_strict_type_checking(generated: Path, tmp_path: Path) -> None:
    variables = {"MYPYPATH": str(generated / "python"), "MYPY_CACHE_DIR": str(tmp_path)}
    argv = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", *map(str, PYTHON)]
    ran = subprocess.run(argv, cwd=tmp_path, env=variables, check=False, capture_output=True, text=True)
    assert (ran.stdout, ran.stderr) == ("", "")


def _compile(generated: Path, folder: Path, *argv: str) -> None:
    """Compile all C++ programs as one, without a warning."""
    includes = "".join(f'#include "{path}"\n' for path in CPP)
    names = ", ".join(f'{{"{path.stem}", {path.stem}::run}}' for path in CPP)
    (folder / "main.cpp").write_text(MAIN.format(includes=includes, programs=names), encoding="utf-8")
    words = [*argv, *WARNINGS, "-UNDEBUG", "-I", str(generated / "cpp"), "main.cpp"]
    ran = subprocess.run(words, cwd=folder, check=False, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.fixture(scope="module")
def programs(generated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("programs")
    _compile(generated, folder, "g++", "-std=c++17", "-o", "main")
    return folder / "main"


@pytest.mark.needs("clang++")
def test_cpp_snippets_are_valid_cpp20_for_clang(generated: Path, tmp_path: Path) -> None:
    _compile(generated, tmp_path, "clang++", "-std=c++20", "-fsyntax-only")


@pytest.mark.needs("g++")
@pytest.mark.parametrize("program", CPP, ids=_name)
def test_cpp_snippets_run(programs: Path, program: Path) -> None:
    ran = subprocess.run([programs, program.stem], check=False, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package 'rover' as its users do."""
    folder = tmp_path_factory.mktemp("installed")
    shutil.copytree(CODE / "rover", folder / "src/rover")
    output = shell("forge build", folder)
    assert "Summary: 1 package finished" in output, output
    return folder


@pytest.mark.needs("bash", "cmake")
def test_python_snippets_run_with_installed_modules(installed: Path) -> None:
    lines = [f"python3 '{CODE / 'python' / name}.py'" for name in ("checking", "defaults", "showing")]
    assert shell("source install/setup.bash\n" + "\n".join(lines), installed) == ""


@pytest.mark.needs("bash", "cmake")
def test_installed_interfaces_are_found_by_name(installed: Path) -> None:
    """rosidl_runtime_py reads the index of what is installed, and brings along what reads it."""
    code = (
        "from rosidl_runtime_py import get_interface_path, get_interfaces; "
        "print(get_interfaces(['rover', 'rosidl_parser'])); print(get_interface_path('rover/srv/Plan'))"
    )
    assert shell(f'source install/setup.bash\npython3 -c "{code}"', installed).splitlines() == [
        "{'rover': ['action/Drive', 'msg/Route', 'msg/Waypoint', 'srv/Plan']}",
        str(installed / "install/rover/share/rover/srv/Plan.srv"),
    ]


@pytest.mark.needs("bash", "cmake")
def test_type_checkers_find_stubs_next_to_installed_modules(installed: Path) -> None:
    (package,) = (installed / "install/rover").glob("lib/python3*/site-packages/rover")
    modules, stubs = (
        {path.relative_to(package).with_suffix("") for path in package.glob(f"*/*.{ending}")}
        for ending in ("py", "pyi")
    )
    # Only forge_cdr loads the modules that know a type's bytes.
    assert stubs == {path for path in modules if not path.name.endswith("__cdr")}
    assert (package / "py.typed").is_file()
