"""The inputs that forge ignores on purpose: the table of docs/explanation/change-detection.md; pure."""

from __future__ import annotations

import re
from posixpath import dirname

from forge.base.frozen import frozen
from forge.build.audit.accesses import Access, AccessKind


@frozen
class IgnoredInput:
    """A row of the table; `what` is the beginning of its text in the documentation.

    It applies to paths that match `pattern` and are accessed by `programs`. A row without a pattern describes
    inputs that no path shows, or that need more than a pattern.
    """

    what: str
    pattern: str = ""
    programs: str = ""

    def covers(self, access: Access) -> bool:
        """Return True if the row applies to an access."""
        return (
            bool(self.pattern)
            and re.match(self.programs, access.program) is not None
            and re.match(self.pattern, access.path) is not None
        )


@frozen
class Machine:
    """Folders that depend on the machine: home, temporary folder, and default search paths."""

    home: str
    temporary: str
    searched: frozenset[str] = frozenset()
    """Folders of PATH and prefixes of underlays."""
    imports: frozenset[str] = frozenset()
    """Module search paths of interpreters."""


COMPILER = re.compile(r"(?:cc1\w*|cpp|clang(?:\+\+)?|f951)(?:-[\d.]+)?$")
_WITHOUT_CONTENT = frozenset({AccessKind.SEEN, AccessKind.FOLDER, AccessKind.LISTED, AccessKind.MISSED})
_LINKERS = frozenset({"ld", "ld.bfd", "ld.gold", "ld.lld", "lld", "mold", "ld.mold", "collect2"})
_LIBRARIES = r"/(?:usr/)?(?:local/)?lib\w*/(?:[^/]+/)*"
_SHARED = rf"{_LIBRARIES}[^/]+\.so(?:\.[\w.-]+)?$"
_RUNTIME = (
    rf"{_LIBRARIES}(?:\w*crt\w*\.o|ld-linux[^/]*|ld-musl[^/]*|libldscripts.*"
    r"|lib(?:c|m|dl|rt|util|pthread|resolv|mvec|gcc|gcc_s|gcc_eh|stdc\+\+|supc\+\+|atomic|c_nonshared"
    r"|pthread_nonshared|c\+\+|c\+\+abi|unwind|asan|tsan|ubsan|lsan|gcov)(?:-[\d.]+)?\.(?:a|so)[\d.]*)$"
)
_SYSTEM_PROGRAMS = """
    sh dash bash uname mkdir rmdir rm cp mv ln cat sed grep egrep fgrep awk gawk mawk env touch true false
    test expr tr cut sort uniq head tail wc tee basename dirname readlink realpath chmod find xargs cmp diff
    date echo printf sleep id hostname getconf ldconfig file which pwd ls tar gzip install patch
    as ld ld.bfd ld.gold ld.lld lld mold ar gcc-ar ranlib gcc-ranlib nm gcc-nm strip objcopy objdump readelf
    addr2line c++filt size dwp gstrip gnm
""".split()
_TOOL = rf"(?:{'|'.join(map(re.escape, _SYSTEM_PROGRAMS))})(?:-[\d.]+)?"

CLOCKS = IgnoredInput("clocks")
GIT = IgnoredInput(
    "git",
    r".*/\.(?:git|hg|svn|bzr)(?:/|$|modules$|attributes$|ignore$)|.*/\.gitconfig$|.*/\.?config/git(?:/|$)",
)
BY_GIT = IgnoredInput("git", ".*", programs=r"(?:git|hg|svn)$")
NETWORK = IgnoredInput("the network")
KERNEL = IgnoredInput("the kernel and devices", r"/(?:proc|sys|dev|run)(?:/|$)")
SETTINGS = IgnoredInput(
    "settings of the machine",
    r"/etc(?:/(?:localtime|timezone|adjtime|passwd|group|shadow|nsswitch\.conf|hosts?|host\.conf|hostname|resolv\.conf"
    r"|gai\.conf|services|protocols|machine-id|locale[^/]*|[\w-]*release|debian_version|mime\.types"
    r"|alternatives|ssl|pki|crypto-policies|gnutls|selinux|terminfo|profile|bash[^/]*|inputrc|python[\d.]*"
    r"|gitconfig)(?:/.*)?)?$"
    r"|/usr/share/(?:locale|zoneinfo|i18n|terminfo|mime|misc|bash-completion)(?:/|$)"
    r"|/usr/lib(?:/[\w-]+)?/(?:locale|gconv|ssl|os-release|terminfo)(?:/|$)",
)
LOADER = IgnoredInput(
    "shared libraries that the tools themselves load",
    rf"{_SHARED}|/etc/ld\.so\.|.*/glibc-hwcaps(?:/|$)|/usr/lib/bfd-plugins(?:/|$)",
)
RUNTIME = IgnoredInput("the C and C++ runtime", _RUNTIME)
CHECKS = IgnoredInput(
    "headers of the system that CMake compiles with only to find something out",
    r"/usr/(?:local/)?include/|/usr/lib/(?:gcc|clang|llvm)",
    COMPILER.pattern,
)
BINUTILS = IgnoredInput(
    "the shell and the usual small programs",
    rf"(?:/usr)?(?:/local)?/s?bin/(?:[\w]+-[\w]+-(?:[\w]+-)?)?{_TOOL}$",
)
NAMES = IgnoredInput("which files there are in the system's own folders")
HOME = IgnoredInput("settings in the home directory")
TEMPORARY = IgnoredInput("names in the temporary folder")
LITTER = IgnoredInput("bytecode and what editors leave")
PREPROCESSOR = IgnoredInput("file names that the preprocessor puts together")
ON_ITS_OWN = IgnoredInput("files that a program reads on its own")
LEFT = IgnoredInput("what a package that has left the workspace had installed")
MERGED = IgnoredInput("new files in a merged install")

LINKED = IgnoredInput("new files beside a source that is installed as a link")

ROWS = (
    *(
        CLOCKS,
        GIT,
        NETWORK,
        NAMES,
        CHECKS,
        MERGED,
        LINKED,
        RUNTIME,
        LOADER,
        BINUTILS,
        SETTINGS,
        HOME,
        KERNEL,
        TEMPORARY,
    ),
    *(LITTER, PREPROCESSOR, ON_ITS_OWN, LEFT),
)
"""The table in the order of the documentation."""

_BY_PATTERN = (KERNEL, GIT, BY_GIT, SETTINGS, BINUTILS, RUNTIME)
_SYSTEM = re.compile(
    r"/(?:(?:usr|lib\w*|bin|sbin|include|share|cmake|opt/(?:lib\w*|share|include|cmake|bin))(?:/|$)"
    r"|(?:opt)?$|(?:opt/)?[^/]*[cC]onfig\.cmake$)"
)
"""Default search paths of compilers, CMake and pkg-config: the prefixes `/`, `/usr` and `/opt`."""
_ZIP = re.compile(r"/lib\w*/python\d+\.zip$")
_OF_PREFIX = r"(?:lib\w*|share|include|cmake|bin|sbin|etc)(?:/|$)|[^/]*[cC]onfig\.cmake$"
_OF_HOME = r"\.(?:cmake|pydistutils\.cfg|config|cache|local|netrc|curlrc|terminfo|hgrc)(?:/|$)"


def untracked(access: Access, machine: Machine) -> IgnoredInput | None:
    """Return the row of the table that applies to an access, or None."""
    path, kind, program = access.path, access.kind, access.program
    for row in _BY_PATTERN:
        if row.covers(access):
            return row
    if LOADER.covers(access) and (
        kind is AccessKind.LOADED or program not in _LINKERS or "/bfd-plugins" in path
    ):
        return LOADER
    if kind not in _WITHOUT_CONTENT:
        return CHECKS if kind is AccessKind.READ and CHECKS.covers(access) else None
    if _below(path, machine.home) and re.match(_OF_HOME, path[len(machine.home) + 1 :]):
        return HOME
    if _is_searched(path, machine):
        return NAMES
    return TEMPORARY if kind is AccessKind.MISSED and dirname(path) == machine.temporary else None


def _is_searched(path: str, machine: Machine) -> bool:
    """Return True if tools search for the path by default."""
    if _SYSTEM.match(path) or dirname(path) in machine.imports or _ZIP.search(path):
        return True
    for folder in machine.searched:
        if path == folder or _below(path, folder):
            return True
        prefix = dirname(folder)
        if path == prefix or (_below(path, prefix) and re.match(_OF_PREFIX, path[len(prefix) + 1 :])):
            return True
    return False


def _below(path: str, folder: str) -> bool:
    return path.startswith(f"{folder}/")
