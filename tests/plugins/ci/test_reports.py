"""The output for CI services, parsed as the services document it."""

import html
import json
import re
from pathlib import Path

import pytest

from forge.plugins.ci.findings import Finding, diagnostics
from forge.plugins.ci.github import cell, command, fence
from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.testable import needs_plugin

COMMAND = re.compile(r"^::(?P<name>[\w-]+)(?: (?P<properties>[^:]*))?::(?P<data>.*)$")
SECTION = re.compile(
    r"\x1b\[0Ksection_(?P<edge>start|end):(?P<time>\d+):(?P<name>[\w.-]+)"
    r"(?P<options>\[collapsed=true\])?\r\x1b\[0K(?P<header>.*)"
)
CODES = (("%2C", ","), ("%3A", ":"), ("%0A", "\n"), ("%0D", "\r"), ("%25", "%"))
PYTHON = """
[project]
name = "nav"
version = "1.0"
optional-dependencies = {test = ["pytest"]}

[tool.setuptools]
py-modules = ["nav"]
"""
NAV = {
    "src/nav/package.xml": manifest_text("nav", build_type="ament_python"),
    "src/nav/pyproject.toml": PYTHON,
    "src/nav/nav.py": "",
}


def unescaped(text: str) -> str:
    for code, character in CODES:
        text = text.replace(code, character)
    return text


def commands(output: str) -> list[tuple[str, dict[str, str], str]]:
    """Return the workflow commands that GitHub's runner would find, which obeys 'stop-commands'.

    It ignores spaces before commands, and finds the older '##[name]' anywhere in a line.
    """
    found, stopped = [], ""
    for line in map(str.strip, re.split("\r\n|\r|\n", output)):
        match = COMMAND.match(line)
        if stopped:
            stopped = "" if line == f"::{stopped}::" else stopped
        elif match:
            words = (word.split("=", 1) for word in (match["properties"] or "").split(",") if word)
            properties = {key: unescaped(value) for key, value in words}
            found.append((match["name"], properties, unescaped(match["data"])))
            stopped = match["data"] if match["name"] == "stop-commands" else ""
        elif "##[" in line:
            found.append(("##", {}, line))
    return found


def annotations(output: str) -> list[tuple[str, dict[str, str], str]]:
    return [each for each in commands(output) if each[0] in {"error", "warning"}]


@pytest.fixture
def repository(tree: Tree) -> Path:
    """Return a repository with a space in its path, whose workspace is in a folder of it."""
    return tree({"the repo/.git/HEAD": "", "the repo/ws/src/x": ""}) / "the repo"


def add(repository: Path, tree: Tree, files: dict[str, str]) -> Path:
    tree({f"the repo/ws/{name}": text for name, text in files.items()})
    return repository / "ws"


def library(name: str, code: str) -> dict[str, str]:
    lists = (
        f"cmake_minimum_required(VERSION 3.16)\nproject({name} CXX)\nadd_library(x x.cpp)\n"
        "target_compile_options(x PRIVATE -Wall)\ninstall(FILES x.cpp DESTINATION share)\n"
    )
    return {f"src/{name}/CMakeLists.txt": lists, f"src/{name}/x.cpp": code}


def github(repository: Path) -> dict[str, str]:
    summary = repository.parent / "summary.md"
    summary.touch()
    return {
        "GITHUB_ACTIONS": "true",
        "GITHUB_WORKSPACE": str(repository),
        "GITHUB_STEP_SUMMARY": str(summary),
    }


@pytest.mark.parametrize("text", ["a", "100 %0A", "a,b:c\r\nd", "::error::x", "%25"])
def test_workflow_commands_are_escaped(text: str) -> None:
    assert commands(command("error", text, file=text)) == [("error", {"file": text}, text)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a b/x.cpp:3:7: error: no\n", Finding("error", "", "no", "a b/x.cpp", 3, 7)),
        ("a:1.cpp:3:7: error: no\n", Finding("error", "", "no", "a:1.cpp", 3, 7)),
        ("x.cpp:3: fatal error: a.h: none\n", Finding("error", "", "a.h: none", "x.cpp", 3, 0)),
        ("\x1b[1mx.c:3:7: \x1b[35mwarning: \x1b[0mold\n", Finding("warning", "", "old", "x.c", 3, 7)),
        (
            "CMake Warning (dev) at src/a/CMakeLists.txt:2 (message):\n  so\n  old\nThis\n",
            Finding("warning", "", "so old", "src/a/CMakeLists.txt", 2, 0),
        ),
        ("  x.cpp:3:7: error: quoted\nnote: x.cpp:1:1: error: no\n", None),
    ],
)
def test_errors_and_warnings_are_found_with_their_locations(text: str, expected: Finding | None) -> None:
    assert next(diagnostics(text), None) == expected


def test_the_summary_accepts_any_text() -> None:
    text = "a | b `<c>` **d** __e__ [f](g) & @h"
    written = cell(f"{text}\n")
    assert written == f"<code>{written[6:-7]}</code>"
    assert html.unescape(written[6:-7]) == text
    assert not re.search("[|`<>*_@\\[]|&(?!#)", written[6:-7])
    assert (fence("a"), fence("a ```` b")) == ("```", "`````")


@needs_plugin("first-error")
@pytest.mark.needs("cmake", "ninja")
def test_errors_and_warnings_become_annotations(forge: Forge, repository: Path, tree: Tree) -> None:
    code = "int main() { int unused; return 0; }\n#warning ::error::not a command\n"
    root = add(repository, tree, library("bad", "\nint main() { return missing; }\n") | library("good", code))
    ran = forge("build", "--continue-on-error", cwd=root, env=github(repository))
    assert ran.code == 1
    (error,) = [each for each in annotations(ran.out) if each[0] == "error"]
    place = {"file": "ws/src/bad/x.cpp", "line": "2", "col": "21"}
    assert error[1] == {"title": "bad: step 'build' failed", **place}
    assert "was not declared in this scope" in error[2].partition("\n")[0]
    warnings = [each for each in annotations(ran.out) if each[0] == "warning"]
    assert {(each[1]["file"], each[1]["line"]) for each in warnings} == {
        ("ws/src/good/x.cpp", "1"),
        ("ws/src/good/x.cpp", "2"),
    }
    # The service reads its commands from stdout.
    assert commands(ran.err) == []
    groups = [(name, data) for name, _, data in commands(ran.out) if name in {"group", "endgroup"}]
    assert sorted(groups) == [("endgroup", "")] * 2 + [("group", "log of bad"), ("group", "stderr: good")]
    assert "::error::not a command" in ran.out
    summary = Path(repository.parent / "summary.md").read_text()
    assert summary.startswith("### forge build: 1 package failed\n\n| finished |")
    assert "\n**bad** failed in step <code>build</code>:\n\n```text\n" in summary
    assert re.search(r"\n\n\| slowest packages \| time \|\n\|---\|---:\|\n\| good \| [\d.]+s \|\n", summary)
    table = [line for line in summary.splitlines() if line.startswith("|")][:3]
    assert len({line.count("|") for line in table}) == 1
    assert table[2].startswith("| 1 | 0 | 0 | 1 | 0 | 2 |")


HEADER = {
    "src/user/CMakeLists.txt": "cmake_minimum_required(VERSION 3.16)\nproject(user)\nadd_library(x a.cpp)\n",
    "src/user/a.cpp": "#include <algorithm>\nstruct A {};\nA a[2];\nvoid f() { std::sort(a, a + 2); }\n",
}


@pytest.mark.needs("cmake", "ninja")
@pytest.mark.parametrize(
    "compiler", [pytest.param(name, marks=pytest.mark.needs(name)) for name in ("g++", "clang++")]
)
@needs_plugin("first-error")
def test_an_error_in_a_system_header_is_attributed_to_the_including_line(
    forge: Forge, repository: Path, tree: Tree, compiler: str
) -> None:
    root = add(repository, tree, HEADER)
    ran = forge("build", cwd=root, env={**github(repository), "CXX": compiler})
    (error,) = annotations(ran.out)
    assert (error[1]["file"], error[1]["line"]) == ("ws/src/user/a.cpp", "4")
    assert error[2].startswith("/usr/")


@needs_plugin("first-error")
def test_very_long_lines_are_shortened_and_empty_logs_omitted(
    forge: Forge, repository: Path, tree: Tree
) -> None:
    lists = (
        "cmake_minimum_required(VERSION 3.16)\nproject(long NONE)\nadd_custom_target(x ALL COMMAND ${run})\n"
    )
    run = "set(run python3 -c \"print('error: ' + 'y' * 99999); exit(3)\")\n"
    root, env = add(repository, tree, {"src/long/CMakeLists.txt": run + lists}), github(repository)
    ran = forge("build", cwd=root, env=env)
    assert ran.code == 1
    (error,) = annotations(ran.out)
    assert len(error[2]) < 1000
    assert (repository.parent / "summary.md").stat().st_size < 2000
    add(repository, tree, library("good", "int x;\n"))
    ran = forge("build", "--packages-select", "good", cwd=root)
    ran = forge("test", cwd=root, env=env)
    assert "'long' is not built" in annotations(ran.out)[0][2]
    assert "::group::" not in ran.out


INJECTION = "::stop-commands::evil\\n  ::error::evil\\n##[error]evil\\nx\\r::add-mask::evil\\n"


@needs_plugin("first-error")
@pytest.mark.parametrize("handlers", [(), ("--event-handlers", "console_direct+"), ("--json",)])
def test_output_of_packages_contains_no_commands(
    forge: Forge, repository: Path, tree: Tree, handlers: tuple[str, ...]
) -> None:
    lists = (
        "cmake_minimum_required(VERSION 3.22)\nproject(p NONE)\nenable_testing()\n"
        f'add_custom_target(x ALL COMMAND printf "{INJECTION}" && printf "{INJECTION}" >&2 VERBATIM)\n'
        f"add_test(NAME bad COMMAND sh -c \"printf '{INJECTION}'; exit 1\")\n"
    ).replace("\\", "\\\\")
    broken = {"src/q/CMakeLists.txt": 'message(FATAL_ERROR "\n::error::evil\n##[error]evil")\n'}
    root, env = add(repository, tree, {"src/p/CMakeLists.txt": lists, **broken}), github(repository)
    built = forge("build", "--continue-on-error", *handlers, cwd=root, env=env)
    tested = forge("test", "--packages-select", "p", *handlers, cwd=root, env=env)
    assert "evil" in tested.out + tested.err
    streams = (
        (built.err, tested.err) if "--json" in handlers else (built.out, built.err, tested.out, tested.err)
    )
    found = [each for stream in streams for each in commands(stream)]
    assert {name for name, _, _ in found} <= {"group", "endgroup", "stop-commands", "error", "warning"}
    assert all(re.fullmatch("[0-9a-f]{32}", data) for name, _, data in found if name == "stop-commands")
    titles = [properties.get("title", "") for name, properties, _ in found if name == "error"]
    assert [title.partition(":")[0] for title in titles] == ["q", "p"]


@needs_plugin("failed-tests")
def test_a_failed_test_annotates_its_line(forge: Forge, repository: Path, tree: Tree) -> None:
    test = "def test_fails():\n    print('::error::no command')\n    assert 1 == 2\n"
    root, env = add(repository, tree, {**NAV, "src/nav/test/test_nav.py": test}), github(repository)
    assert forge("build", cwd=root, env=env).code == 0
    ran = forge("test", "--return-code-on-test-failure", cwd=root, env=env)
    assert ran.code == 1
    (error,) = annotations(ran.out)
    assert error[1]["file"] == "ws/src/nav/test/test_nav.py"
    assert error[1]["line"] == "3"
    assert error[1]["title"].startswith("nav: ")
    assert "assert 1 == 2" in error[2]
    summary = Path(repository.parent / "summary.md").read_text()
    assert "### forge build: succeeded\n" in summary
    assert "### forge test: 1 package with failed tests\n" in summary
    assert "| <code>nav: test.test_nav.test_fails</code> | <code>assert 1 == 2" in html.unescape(summary)
    assert "| tests | failed tests | skipped tests |" in summary


@needs_plugin("first-error")
@pytest.mark.needs("cmake", "ninja")
def test_gitlab_gets_sections_and_a_code_quality_report(forge: Forge, repository: Path, tree: Tree) -> None:
    code = "#warning old\nint f() { return missing; }\n"
    root = add(repository, tree, library("bad", code))
    env = {"GITLAB_CI": "true", "CI_PROJECT_DIR": str(repository)}
    ran = forge("build", cwd=root, env=env)
    start, end = SECTION.finditer(ran.out)
    assert (start["edge"], end["edge"], start["name"]) == ("start", "end", end["name"])
    assert (start["options"], start["header"]) == ("[collapsed=true]", "log of bad")
    assert int(start["time"]) <= int(end["time"])
    assert "code quality report: log/gl-code-quality-report.json\n" in ran.out
    rows = json.loads((root / "log/gl-code-quality-report.json").read_text())
    found = [(row["severity"], row["location"], row["check_name"]) for row in rows]
    assert found == [
        ("critical", {"path": "ws/src/bad/x.cpp", "lines": {"begin": 2}}, "forge error"),
        ("minor", {"path": "ws/src/bad/x.cpp", "lines": {"begin": 1}}, "forge warning"),
    ]
    assert len({row["fingerprint"] for row in rows}) == 2
    assert all(re.fullmatch(r"[0-9a-f]{64}", row["fingerprint"]) for row in rows)
    (root / "src/bad/x.cpp").write_text(f"\n{code}")
    forge("build", cwd=root, env=env)
    moved = json.loads((root / "log/gl-code-quality-report.json").read_text())
    assert [row["fingerprint"] for row in moved] == [row["fingerprint"] for row in rows]


@needs_plugin("first-error")
@pytest.mark.needs("cmake", "ninja")
def test_a_long_code_quality_report_is_limited(forge: Forge, repository: Path, tree: Tree) -> None:
    script = "for i in range(6000): print(f'run.py:{i + 1}: warning: old')\nexit('run.py:3: error: no')\n"
    lists = (
        "cmake_minimum_required(VERSION 3.16)\nproject(long NONE)\n"
        "add_custom_target(x ALL COMMAND python3 ${CMAKE_CURRENT_SOURCE_DIR}/run.py)\n"
    )
    root = add(repository, tree, {"src/long/CMakeLists.txt": lists, "src/long/run.py": script})
    ran = forge("build", "--ci-output", "gitlab", cwd=root)
    path = "log/gl-code-quality-report.json"
    assert f"code quality report: {path} (the first 5000 of 6001 entries)\n" in ran.out
    rows = json.loads((root / path).read_text())
    assert [row["severity"] for row in rows] == ["critical", *["minor"] * 4999]


@pytest.mark.parametrize(
    ("words", "variables", "service"),
    [
        ((), {}, ""),
        ((), {"GITHUB_ACTIONS": "true"}, "github"),
        (("--ci-output", "none"), {"GITHUB_ACTIONS": "true"}, ""),
        (("--ci-output", "gitlab"), {"GITHUB_ACTIONS": "true"}, "gitlab"),
        (("--ci-output", "github"), {}, "github"),
        (("--log-base", "/dev/null"), {"GITHUB_ACTIONS": "true"}, "github"),
        (("--json",), {"GITHUB_ACTIONS": "true"}, "github"),
    ],
    ids=str,
)
def test_the_service_is_detected_and_can_be_chosen(
    forge: Forge,
    repository: Path,
    tree: Tree,
    words: tuple[str, ...],
    variables: dict[str, str],
    service: str,
) -> None:
    invalid = '[project]\nname = "nav"\nversion = "nonsense"\n'
    root = add(repository, tree, {**NAV, "src/nav/pyproject.toml": invalid})
    ran = forge("build", *words, cwd=root, env=variables)
    assert ran.code == 1
    printed = ran.err if "--json" in words else ran.out
    assert bool(annotations(printed)) == (service == "github")
    assert ("section_start" in printed) == (service == "gitlab")
    if "--json" in words:
        assert all(json.loads(line) for line in ran.out.splitlines())
