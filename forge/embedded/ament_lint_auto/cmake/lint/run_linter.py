"""Run an installed linter on the files of a package, and write a result file.

    run_linter.py TOOL PROGRAM --xunit-file FILE [--exclude PATH ...] [--language L] [--linelength N]
                  [--root R] [--config FILE] [--filters F ...] [--include_dirs D ...] [--libraries L ...]
                  [-- PATH ...]

TOOL is the name of the linter in ament, PROGRAM the installed program. The options are those of ament's
programs; options of other linters are ignored, because packages mix them up. The style is that of ROS as far
as command-line options support it. Exits with 1 if there are findings. Uses only the standard library.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

CPP = (".c", ".cc", ".cpp", ".cxx", ".h", ".hh", ".hpp", ".hxx")
UNPRINTABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# Codes of pydocstyle: missing docstrings are allowed, and both styles of the first line.
DOCSTRINGS = "D100,D101,D102,D103,D104,D105,D106,D107,D203,D212,D404"
# Codes that contradict the style of ROS, or that another linter checks.
CPPLINT = (
    *("-build/c++11", "-build/header_guard", "-legal/copyright", "-runtime/references"),
    *("-whitespace/braces", "-whitespace/indent", "-whitespace/parens", "-whitespace/semicolon"),
)


def main(words: list[str]) -> int:
    """Run the linter, write the result file, return the exit code."""
    return int(bool(complaints_of(parse(words))))


def complaints_of(options: argparse.Namespace) -> dict[str, str]:
    """Run the linter, write the result file if requested, and return the findings by file."""
    command, suffixes = LINTERS[options.tool]
    files = list(_files(options.paths, suffixes, options.exclude))
    argv = command(options)
    if not files or not argv:
        _write(options, {}, skipped="nothing to look at" if not files else "no configuration was given")
        return {}
    ran = subprocess.run(
        [options.program, *argv, *files], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
    )
    output = ran.stdout.decode(errors="replace")
    sys.stdout.write(output)
    complaints = _by_file(output, files) if ran.returncode else {}
    if ran.returncode and not complaints:
        complaints = {files[0]: output or f"'{options.program}' ended with exit code {ran.returncode}"}
    _write(options, {file: complaints.get(file, "") for file in files})
    return complaints


def parse(words: list[str], *, folders_first: bool = False) -> argparse.Namespace:
    """Return the options; with `folders_first`, paths need no '--' before them."""
    parser = argparse.ArgumentParser(description="Run a linter and leave a result file.", allow_abbrev=False)
    parser.add_argument("tool", choices=sorted(LINTERS))
    parser.add_argument("program")
    parser.add_argument("--xunit-file", type=Path)
    for option in ("--language", "--linelength", "--root", "--lnt-file"):
        parser.add_argument(option)
    parser.add_argument("--config", "-c")
    for option in ("--exclude", "--filters", "--include_dirs", "--libraries", "--compile-defs"):
        parser.add_argument(option, nargs="*", default=[])
    # Paths may follow an option with any number of values; CMake adds '--' before them.
    at = words.index("--") if "--" in words else len(words)
    if folders_first:
        parser.add_argument("paths", nargs="*")
    options, more = parser.parse_known_args(words[:at])
    options.more = more
    options.paths = words[at + 1 :] or getattr(options, "paths", ()) or ["."]
    return options


def _files(paths: Iterable[str], suffixes: tuple[str, ...], exclude: Iterable[str]) -> Iterable[str]:
    """Yield the files to check as relative paths, without folders that start with '.' or '_'."""
    excluded = {os.path.normpath(path) for path in exclude}
    for path in paths:
        found = [path]
        if Path(path).is_dir():
            found = []
            for folder, folders, names in os.walk(path):
                hidden = "AMENT_IGNORE" in names or "COLCON_IGNORE" in names
                folders[:] = [] if hidden else sorted(name for name in folders if name[0] not in "._")
                found += [] if hidden else [str(Path(folder) / name) for name in sorted(names)]
        for file in map(os.path.normpath, found):
            place = Path.cwd() / file
            own = {file, place.name, *map(str, (place, *place.parents, *Path(file).parents))} - {"."}
            if file.endswith(suffixes) and not own & excluded:
                yield file


def _by_file(output: str, files: list[str]) -> dict[str, str]:
    """Group findings by file: a line that starts with a file name, and the lines after it."""
    known = {name: file for file in files for name in (file, f"./{file}", str(Path.cwd() / file))}
    complaints: dict[str, list[str]] = defaultdict(list)
    current = ""
    for line in output.splitlines():
        named = re.match(r"(?:FAIL: |would reformat )?([^:]+?)(?::| \(|$)", line)
        current = known.get(named[1], current) if named else current
        if current:
            complaints[current].append(line)
    return {file: "\n".join(lines) for file, lines in complaints.items()}


def _write(options: argparse.Namespace, results: dict[str, str], skipped: str = "") -> None:
    """Write one test case per file, or a skipped one if there are no files."""
    if options.xunit_file is None:
        return
    suite = quoteattr(f"{Path.cwd().name}.{options.tool}")
    cases = [
        (file, f"<failure message={_attribute(text)}/>" if text else "") for file, text in results.items()
    ]
    if skipped:
        cases = [(options.tool, f"<skipped message={quoteattr(skipped)}/>")]
    lines = (
        f"  <testcase classname={suite} name={quoteattr(name)}>{outcome}</testcase>\n"
        for name, outcome in cases
    )
    counts = f'tests="{len(cases)}" failures="{sum(map(bool, results.values()))}" errors="0"'
    options.xunit_file.parent.mkdir(parents=True, exist_ok=True)
    options.xunit_file.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<testsuite name={suite} {counts} skipped="{int(bool(skipped))}">\n{"".join(lines)}</testsuite>\n',
        encoding="utf-8",
    )


def _attribute(text: str) -> str:
    return quoteattr(UNPRINTABLE.sub("", text))


def _black(options: argparse.Namespace) -> list[str]:
    return ["--check", *([f"--config={options.config}"] if options.config else [])]


def _clang_format(options: argparse.Namespace) -> list[str]:
    style = f"file:{options.config}" if options.config else "file"
    return [f"--style={style}", "--fallback-style=none", "--dry-run", "--Werror"]


def _cppcheck(options: argparse.Namespace) -> list[str]:
    language = [f"--language={options.language}"] if options.language else []
    return [
        *("--force", "--inline-suppr", "--quiet", "--error-exitcode=1", "--template=gcc"),
        *("--suppress=internalAstError", "--suppress=unknownMacro"),
        *language,
        *(f"--library={library}" for library in options.libraries),
        *(f"-I{folder}" for folder in options.include_dirs),
        *options.more,
    ]


def _cpplint(options: argparse.Namespace) -> list[str]:
    filters = ",".join((*CPPLINT, *options.filters))
    root = [f"--root={options.root}"] if options.root else []
    return [f"--filter={filters}", f"--linelength={options.linelength or 100}", "--quiet", *root]


def _flake8(options: argparse.Namespace) -> list[str]:
    if options.config:
        return [f"--config={options.config}"]
    return [f"--max-line-length={options.linelength or 99}", f"--extend-ignore=B902,C816,I202,{DOCSTRINGS}"]


def _cmakelint(options: argparse.Namespace) -> list[str]:
    # In ROS style, the closing bracket of a long call is on a separate line.
    filters = ",".join(("-linelength", "-package/stdargs", "-whitespace/extra", *options.filters))
    return [f"--filter={filters}", *([f"--linelength={options.linelength}"] if options.linelength else [])]


def _mypy(options: argparse.Namespace) -> list[str]:
    config = ["--config-file", options.config] if options.config else ["--ignore-missing-imports"]
    return [*config, "--cache-dir", os.devnull, "--no-error-summary", "--scripts-are-modules"]


def _pydocstyle(_: argparse.Namespace) -> list[str]:
    return [f"--ignore={DOCSTRINGS}"]


def _pycodestyle(options: argparse.Namespace) -> list[str]:
    return [
        f"--config={options.config}" if options.config else f"--max-line-length={options.linelength or 99}"
    ]


def _pyflakes(_: argparse.Namespace) -> list[str]:
    return ["--"]


def _uncrustify(options: argparse.Namespace) -> list[str]:
    if not options.config:
        return []  # the tool's defaults are not the style of ROS
    words = ["-c", options.config, "-q", "--check"]
    if options.language:
        words += ["-l", {"c++": "CPP", "c": "C"}.get(options.language.lower(), options.language)]
    if options.linelength:
        words += ["--set", f"code_width={options.linelength}"]
    return words


def _xmllint(_: argparse.Namespace) -> list[str]:
    return ["--noout", "--nonet"]


LINTERS: dict[str, tuple[Callable[[argparse.Namespace], list[str]], tuple[str, ...]]] = {
    "black": (_black, (".py",)),
    "clang_format": (_clang_format, CPP),
    "cppcheck": (_cppcheck, CPP),
    "cpplint": (_cpplint, CPP),
    "flake8": (_flake8, (".py",)),
    "lint_cmake": (_cmakelint, ("CMakeLists.txt", ".cmake")),
    "mypy": (_mypy, (".py",)),
    "pep257": (_pydocstyle, (".py",)),
    "pycodestyle": (_pycodestyle, (".py",)),
    "pyflakes": (_pyflakes, (".py",)),
    "uncrustify": (_uncrustify, CPP),
    "xmllint": (_xmllint, (".xml",)),
}

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
