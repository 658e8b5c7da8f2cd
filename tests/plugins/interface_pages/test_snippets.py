"""The code snippets of interface pages run and compile."""

import re
import subprocess
from pathlib import Path

import pytest

from forge.base.distributions import EMBEDDED
from forge.interfaces.read.sources import Library
from tests.conftest import Forge
from tests.generated import generate_embedded, run_python
from tests.sites import faults_of, read_page

DOCS = ("interface", "docs")


def _snippets(folder: Path, language: str) -> dict[str, str]:
    """Return the lines of Python or C++ that the pages of a site show, by the page."""
    found = {}
    for path in sorted(folder.glob("*/*/*.html")):
        code = re.search(
            rf"<h3>{re.escape(language)}</h3>\n<pre><code>(.*?)</code>", path.read_text(), re.DOTALL
        )
        assert code
        words = read_page(code[1]).text
        found[path.relative_to(folder).as_posix()] = words
    return found


def test_all_embedded_packages_have_pages_whose_python_snippets_run(forge: Forge, tmp_path: Path) -> None:
    assert forge(*DOCS, "--embedded", "-o", "site", cwd=tmp_path).code == 0
    assert faults_of(tmp_path / "site") == []
    generate_embedded(tmp_path / "code")
    snippets = _snippets(tmp_path / "site", "Python")
    assert len(snippets) == len(list(Library().names()))
    code = (
        f"for name, text in {snippets!r}.items():\n    exec(compile(text, name, 'exec'), {{}})\nprint('all')"
    )
    assert run_python(tmp_path / "code", code) == "all"
    assert "message.position.x = 1.0" in snippets["geometry_msgs/msg/Pose.html"]


@pytest.mark.needs("g++")
def test_the_cpp_snippets_of_the_pages_compile(forge: Forge, tmp_path: Path) -> None:
    """Those of a few packages, with every kind of member among them."""
    packages = ("example_interfaces", "rcl_interfaces", "std_srvs", "geometry_msgs")
    forge(*DOCS, *packages, "-o", "site", cwd=tmp_path)
    for package in packages:
        forge(
            "interface",
            "generate",
            "--package",
            package,
            "--lang",
            "cpp",
            "--output",
            "code",
            str(EMBEDDED / package),
            cwd=tmp_path,
        )
    lines, functions = set(), []
    for number, text in enumerate(_snippets(tmp_path / "site", "C++").values()):
        include, _, body = text.partition("\n\n")
        lines.add(include)
        functions.append(f"void f{number}()\n{{\n{body}}}\n")
    (tmp_path / "all.cpp").write_text("\n".join([*sorted(lines), *functions]))
    argv = ["g++", "-std=c++17", "-fsyntax-only", "-Icode/cpp", "all.cpp"]
    ran = subprocess.run(argv, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.stderr == ""
    assert ran.returncode == 0
