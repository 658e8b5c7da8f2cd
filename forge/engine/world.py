"""What a build asks of its surroundings by name: variables, programs, and packages that CMake finds by PATH.

Questions are texts, so that records can keep them with the answers: '$NAME', 'program NAME', 'package NAME',
'FORGE_PROCESSOR'.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.text import digest
from forge.engine.variables import is_tracked
from forge.toolchain.config_search import ConfigSearch, prefixes_of_path
from forge.toolchain.programs import ProgramLookup

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.base.frozen import Pairs

_SYSTEM = ("/usr/local", "/usr", "", "/opt")
_OF_PACKAGES = re.compile(r"/?|/(lib\w*|share)(/[\w-]+-linux-\w+)?(/cmake|/CMake)?")
VARIABLE, PROGRAM, PACKAGE_FOUND = "$", "program ", "package "
"""The beginnings of questions."""
PROCESSOR = "FORGE_PROCESSOR"
"""The question of builds that compile for the processor at hand, or read what it is."""
CPU_INFO = "/proc/cpuinfo"
_TRAITS = frozenset(
    {
        *("vendor_id", "cpu family", "model", "model name", "stepping", "cache size", "flags"),
        *("CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features"),
        *("isa", "uarch", "machine", "cpu", "features", "CPU Family", "Model Name"),
    }
)
"""Relevant lines of CPU_INFO on several architectures; other lines vary over time or between cores."""


class World:
    """The surroundings of one run of forge; what was looked up is remembered."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        """`variables` is the environment of builds, below that of dependencies."""
        self._variables = variables
        self._lookup = ProgramLookup(variables)
        self._configs = ConfigSearch()
        paths = (variables.get(name, "") for name in ("CMAKE_PREFIX_PATH", "AMENT_PREFIX_PATH"))
        underlays = filter(None, os.pathsep.join(paths).split(os.pathsep))
        self._prefixes = tuple(dict.fromkeys((*underlays, *prefixes_of_path(self._lookup.folders), *_SYSTEM)))
        self._answers: dict[str, str] = {}
        folders = self._lookup.folders
        self.path = frozenset((*folders, *map(os.path.realpath, folders)))
        """The folders of PATH."""

    def value(self, name: str) -> str:
        """Return the value of a variable, '' if it is not set."""
        return self._variables.get(name, "")

    def searched_for_packages(self, folder: str) -> bool:
        """Return True if CMake lists a folder to find packages, which are tracked by their names."""
        below = (folder[len(prefix) :] for prefix in self._prefixes if folder.startswith(prefix))
        return any(map(_OF_PACKAGES.fullmatch, below))

    def answers(self, questions: Iterable[str]) -> Pairs:
        """Return the sorted questions with their answers."""
        return tuple((question, self.answer(question)) for question in sorted(questions))

    def answer(self, question: str) -> str:
        """Return the digest of a value, the path of a program or the folder of a package; '' for none."""
        if question not in self._answers:
            self._answers[question] = self._ask(question)
        return self._answers[question]

    def _ask(self, question: str) -> str:
        if question.startswith(VARIABLE):
            value = self._variables.get(question[1:])
            return "" if value is None else digest(value)  # a value may be a secret
        if question == PROCESSOR:
            return processor(text_or_nothing(CPU_INFO))
        if question.startswith(PROGRAM):
            name = question.removeprefix(PROGRAM)
            found = self._lookup.identity(name) if name in self._lookup.names else ""
            return found.rsplit(" ", 2)[0]
        name = question.removeprefix(PACKAGE_FOUND)
        return next(filter(None, (self._configs.folder(prefix, name) for prefix in self._prefixes)), "")


def processor(cpu_info: str) -> str:
    """Return a digest of processor model and features."""
    lines = {line.strip() for line in cpu_info.splitlines() if line.partition(":")[0].strip() in _TRAITS}
    return digest(*sorted(lines))


def about_variables(names: Iterable[str]) -> Iterator[str]:
    """Yield the questions about those variables that are inputs."""
    return (f"{VARIABLE}{name}" for name in names if is_tracked(name))


def about_programs(names: Iterable[str]) -> Iterator[str]:
    """Yield the questions about programs on PATH."""
    return (f"{PROGRAM}{name}" for name in names)


def about_packages(names: Iterable[str]) -> Iterator[str]:
    """Yield the questions about packages that CMake may find beside the folders of PATH."""
    return (f"{PACKAGE_FOUND}{name}" for name in names)
