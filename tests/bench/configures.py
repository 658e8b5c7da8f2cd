"""What ament costs when CMake configures a package: pairs of packages that differ in nothing else.

Each command line is the one that forge runs, beginning with a folder that CMake has not configured yet. Where
a language is enabled the compilers are known already, as in every build but a workspace's first.
"""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from forge.plugins.compiler_probe.probe import Toolchain
from tests.bench.commands import forge
from tests.bench.figures import Case
from tests.bench.sitting import Sitting, run
from tests.bench.timing import Variant
from tests.packages import manifest_text

_AMENT = "find_package(ament_cmake REQUIRED)\n{more}ament_package()\n"
_LINTERS = "find_package(ament_lint_auto REQUIRED)\nament_lint_auto_find_test_dependencies()\n"
_LINTERS_DECLARED = "<test_depend>ament_lint_auto</test_depend><test_depend>ament_lint_common</test_depend>"

_PACKAGES = {
    "without a language": {"plain": ("NONE", "", ""), "forge": ("NONE", _AMENT.format(more=""), "")},
    "in C++": {
        "plain": ("CXX", "", ""),
        "forge": ("CXX", _AMENT.format(more=""), ""),
        "forge, linters": ("CXX", _AMENT.format(more=_LINTERS), _LINTERS_DECLARED),
    },
}
"""What is compared: a project without ament, one with forge's; their language, commands, manifest's lines."""

_FORGET = "rm -rf CMakeCache.txt CMakeFiles{copy}"
_COMMAND = re.compile(r"^Invoked command in .* returned '0': (.* -C .*)$", re.MULTILINE)


def configuring(sitting: Sitting) -> Iterator[Case]:
    """Measure CMake's configure of packages with ament and without."""
    folder = sitting.new_folder("configures")
    for case, packages in _PACKAGES.items():
        for name, (language, commands, lines) in packages.items():
            _write(folder / "src" / _word(f"{name} {case}"), language, commands, lines)
    run(forge("build"), folder)
    for case, packages in _PACKAGES.items():
        variants = [
            _variant(folder, name, _word(f"{name} {case}"), language)
            for name, (language, _, _) in packages.items()
        ]
        yield sitting.turns_of(case, variants, 11)


def _write(package: Path, language: str, commands: str, lines: str) -> None:
    package.mkdir(parents=True)
    build_type = "ament_cmake" if commands else "cmake"
    depends = "<buildtool_depend>ament_cmake</buildtool_depend>" if commands else ""
    manifest = manifest_text(package.name, depends, lines, build_type=build_type)
    (package / "package.xml").write_text(manifest, encoding="utf-8")
    text = f"cmake_minimum_required(VERSION 3.18)\nproject({package.name} {language})\n{commands}"
    (package / "CMakeLists.txt").write_text(text, encoding="utf-8")


def _variant(folder: Path, name: str, package: str, language: str) -> Variant:
    """Return the command that forge ran, in a folder that knows at most the compilers."""
    build = folder / "build" / package
    log = (folder / "log" / "latest_build" / package / "command.log").read_text(encoding="utf-8")
    command = _COMMAND.search(log)
    assert command is not None, log
    copy = ""
    if language != "NONE":
        copy = f" && cp -r {shlex.quote(str(_known_compilers(folder, command[1])))}/. ."
    surroundings = shlex.quote(str(build / ".forge" / "environment.sh"))
    return Variant(
        name,
        ("sh", "-c", f". {surroundings} && exec {command[1]}"),
        build,
        before=("sh", "-c", _FORGET.format(copy=copy)),
    )


def _known_compilers(folder: Path, command: str) -> Path:
    """Return a folder that holds what forge copies into each new build folder, and nothing else."""
    seed, source = folder / "seed", folder / "src" / _word("plain in C++")
    if not seed.exists():
        cmake, *words = shlex.split(command)
        generator = tuple(word for word in words if word in {"-G", "Ninja"} or "CMAKE_MAKE_PROGRAM" in word)
        toolchain = Toolchain(folder / "build", Path(cmake), generator, ())
        toolchain.seed(source, seed, os.environ)
        assert (seed / "CMakeCache.txt").is_file()
    return seed


def _word(name: str) -> str:
    return re.sub(r"\W", "_", name.replace("+", "p").lower())
