"""Decide whether a package is up to date, and why not; pure.

A package is up to date if its installed files are intact and none of its inputs changed: its sources, its
options, the tools, the environment, forge itself, the files outside the workspace that its build read, and
the installed files of its dependencies. If a dependency is rebuilt and installs identical files, its
dependents remain up to date.
"""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.base.frozen import Pairs
    from forge.build.model import BuildInputs, BuildRecord, Snapshot

UNKNOWN = "unknown"
"""The digest of a package without a record, for example one that another tool built."""


@frozen
class ExtraInputs:
    """Further inputs of one package: options, tools and variables."""

    options: tuple[str, ...] = ()
    tools: Pairs = ()
    environment: Pairs = ()


class DependencyHashes:
    """The hash of each package for its dependents; owned by the build loop.

    It covers the installed files of the package and the hashes of its dependencies. While a package is being
    built, its hash and those of its dependents are pending.
    """

    def __init__(self, needs: Mapping[str, frozenset[str]], installed: Mapping[str, str]) -> None:
        """Start with the digests of the installed files; nothing is pending."""
        self._needs = needs
        self._installed = dict(installed)
        self._pending: set[str] = set()
        self._hashes: dict[str, str | None] = {}

    def expect(self, name: str) -> None:
        """Mark the package as pending: it will or may be built in this run."""
        self._pending.add(name)
        self._hashes.pop(name, None)

    def finish(self, name: str, installed: str | None = None) -> None:
        """Mark the package as finished, with the digest of its files if they changed."""
        self._pending.discard(name)
        if installed is not None:
            self._installed[name] = installed

    def needs_of(self, name: str, below: Iterable[str]) -> Pairs | None:
        """Return the hashes of the direct dependencies of `name`, or None while one is pending.

        `below` are all its transitive dependencies in topological order.
        """
        for other in below:
            if self._hashes.get(other) is None:
                self._hashes[other] = self._combined_hash(other)
        hashes = [(need, self._hashes.get(need)) for need in sorted(self._needs[name])]
        return None if any(hash_ is None for _, hash_ in hashes) else tuple((n, h or "") for n, h in hashes)

    def _combined_hash(self, name: str) -> str | None:
        if name in self._pending:
            return None
        below = [self._hashes.get(need) for need in sorted(self._needs[name])]
        if None in below:
            return None
        parts = (self._installed.get(name, UNKNOWN), *(digest or "" for digest in below))
        return hashlib.blake2b("\0".join(parts).encode(), digest_size=16).hexdigest()


def unconditional_reason(name: str, record: BuildRecord | None, snapshot: Snapshot) -> str | None:
    """Return why the package must be built regardless of its inputs, or None."""
    if record is None:
        return "not built yet"
    if not record.complete:
        return "the last build did not finish successfully"
    if name not in snapshot.present or snapshot.installed[name].digest != record.installed.digest:
        return "an installed file was changed or removed"
    if name in snapshot.changed_externals:
        return f"the external input '{snapshot.changed_externals[name]}' changed"
    if record.saved:
        return f"'{record.saved[0]}' was modified during the last build"
    return None


def changed_input_reason(
    now: BuildInputs, then: BuildInputs, changed_files: tuple[str, ...] = ()
) -> str | None:
    """Return the most significant difference between current and recorded inputs, or None."""
    if now.forge != then.forge:
        return "forge itself changed"
    for before, after, message in (
        (then.tools, now.tools, "the tool '{}' changed"),
        (then.environment, now.environment, "the environment variable '{}' changed"),
    ):
        name = _first_difference(after, before)
        if name:
            return message.format(name)
    if now.options != then.options:
        return _option(now.options, then.options)
    if now.sources != then.sources:
        return source_changes(changed_files)
    need = _first_difference(now.needs, then.needs)
    if need:
        return f"the dependency '{need}' changed"
    return "packages were added to or removed from an underlay" if now.underlays != then.underlays else None


def _first_difference(now: Pairs, then: Pairs) -> str | None:
    before, after = dict(then), dict(now)
    return next((name for name in sorted(before | after) if before.get(name) != after.get(name)), None)


def _option(now: Sequence[str], then: Sequence[str]) -> str:
    """Describe the most significant difference between options as the user knows them."""
    count = len(COMMON_OPTIONS)
    common = _common_option(now[:count], then[:count])
    if common:
        return common
    before, after = _definitions(then[count:]), _definitions(now[count:])
    added = next((option for option in after if option not in before), None)
    if added is not None and added.startswith((MANIFEST, NAMED_FILE, BUILD_TYPE, RUST)):
        return f"{added.rpartition(' ')[0]} changed"
    removed = next((option for option in before if option not in after), None)
    if added is not None:
        return _NEGATIVE[added][0] if added in _NEGATIVE else f"the option '{added}' was added"
    if removed is not None:
        return _NEGATIVE[removed][1] if removed in _NEGATIVE else f"the option '{removed}' was removed"
    return "the order of its options changed"


def _common_option(now: Sequence[str], then: Sequence[str]) -> str | None:
    """Describe a difference between the options of every package; the layout explains other differences."""
    pairs = list(zip(COMMON_OPTIONS, then, now, strict=True))
    for name, before, after in sorted(pairs, key=lambda pair: pair[0] != INSTALL_LAYOUT):
        if before == after:
            continue
        if name == INSTALL_LAYOUT and before.removesuffix(LINKS) == after.removesuffix(LINKS):
            return f"the option '--symlink-install' was {'added' if after.endswith(LINKS) else 'removed'}"
        before, after = before.removesuffix(LINKS), after.removesuffix(LINKS)  # noqa: PLW2901
        return f"the {name} changed from '{before}' to '{after}'"
    return None


def _definitions(options: Iterable[str]) -> list[str]:
    """Return the options, with those that CMake accepts as two arguments joined."""
    joined = re.sub(r"(?m)^(-[DU])\n", r"\1 ", "\n".join(options))
    return joined.split("\n") if joined else []


INSTALL_LAYOUT = "install layout"
LINKS = " links"
"""The suffix of the install layout with symbolic links to sources."""

COMMON_OPTIONS = (
    *("source folder", "build folder", "install folder", INSTALL_LAYOUT),
    *("Python interpreter", "folder of Python modules"),
)
"""The meaning of the first recorded options of every package."""

PATH_MAPS, FAST_ROSIDL = "path maps", "fast rosidl"
_NEGATIVE = {
    PATH_MAPS: ("a package cache is now used", "the package cache is no longer used"),
    FAST_ROSIDL: ("the option '--no-fast-rosidl' was removed", "the option '--no-fast-rosidl' was added"),
}
"""Recorded words that are no options of the user: what was added or removed instead."""


def source_changes(changed_files: tuple[str, ...]) -> str:
    """Describe what changed in the sources of a package; `changed_files` are those with new content."""
    if not changed_files:
        return "source files were added, removed or renamed"
    rest = f" and {len(changed_files) - 1} more" if len(changed_files) > 1 else ""
    return f"'{changed_files[0]}'{rest} changed"


MANIFEST, NAMED_FILE, BUILD_TYPE = "the evaluated package.xml", "the file ", "the build type "
RUST = "the Rust toolchain"
"""Prefixes of recorded options that end with a digest, RUST after a space."""


def relevant_environment(variables: Mapping[str, str]) -> Pairs:
    """Return the environment variables that compilers, CMake, Python and ROS packages read."""
    return tuple((name, variables[name]) for name in sorted(variables) if is_relevant(name))


def is_relevant(name: str) -> bool:
    """Return True if the environment variable `name` affects every package."""
    return name in _NAMES or (name.startswith(_BEGINNINGS) and name not in WITHOUT_EFFECT)


WITHOUT_EFFECT = frozenset(
    """CMAKE_BUILD_PARALLEL_LEVEL CMAKE_COLOR_DIAGNOSTICS CMAKE_EXPORT_BUILD_DATABASE
    CMAKE_EXPORT_COMPILE_COMMANDS CMAKE_INSTALL_PARALLEL_LEVEL CMAKE_INSTALL_PREFIX CMAKE_MSVCIDE_RUN_PATH
    CMAKE_NO_VERBOSE CMAKE_TEST_LAUNCHER CMAKE_TLS_VERIFY CMAKE_TLS_VERSION
    PKG_CONFIG_DEBUG_SPEW PKG_CONFIG_LOG
    """.split()  # noqa: SIM905
)
"""Variables with a relevant prefix that do not affect the result: they control parallelism or output."""

CONFIGURING = frozenset({"python", "cmake", "ninja", "make"})
"""The tools of packages that compile nothing."""

FOR_COMPILERS = frozenset(
    """ASM ASMFLAGS CC CFLAGS CPP CPPFLAGS CUDAARCHS CUDACXX CUDAFLAGS CUDAHOSTCXX CXX CXXFLAGS FC FFLAGS
    HIPCXX HIPFLAGS HIPHOSTCXX ISPC ISPCFLAGS LDFLAGS OBJC OBJCFLAGS OBJCXX OBJCXXFLAGS
    AR ARFLAGS AS LD NM OBJCOPY RANLIB STRIP CMAKE_BUILD_TYPE
    CPATH C_INCLUDE_PATH CPLUS_INCLUDE_PATH OBJC_INCLUDE_PATH LIBRARY_PATH GCC_EXEC_PREFIX COMPILER_PATH
    CCC_OVERRIDE_OPTIONS CCACHE_COMPILER LD_RUN_PATH LDEMULATION GNUTARGET
    """.split()  # noqa: SIM905
)
"""Variables that affect only compiled code."""

_NAMES = FOR_COMPILERS | frozenset(
    """ADSP_ROOT DESTDIR INCLUDE LIB MACOSX_DEPLOYMENT_TARGET SDKROOT
    BUILD_TESTING GTEST_DIR GMOCK_DIR MAKEFILES SOURCE_DATE_EPOCH
    CUDA_BIN_PATH CUDA_HOME CUDA_INC_PATH CUDA_LIB_PATH CUDA_PATH CUDA_ROOT CUDA_TOOLKIT_ROOT
    CUDA_TOOLKIT_ROOT_DIR CUDAToolkit_ROOT NVCC_APPEND_FLAGS NVCC_CCBIN NVCC_PREPEND_FLAGS
    PYTHONPATH PYTHONHOME PYTHONNOUSERSITE PYTHONPLATLIBDIR PYTHONSAFEPATH PYTHONUSERBASE
    _PYTHON_HOST_PLATFORM _PYTHON_SYSCONFIGDATA_NAME
    ARCHFLAGS CCSHARED LDCXXSHARED LDSHARED PBR_VERSION PDM_BUILD_SCM_VERSION
    AMENT_PREFIX_PATH ROS_PYTHON_VERSION ROS_VERSION
    """.split()  # noqa: SIM905  (shorter than a list of eighty lines)
)
"""See the manuals of CMake (cmake-env-variables), gcc, ld, clang, nvcc, Python, setuptools and ament."""
_BEGINNINGS = (
    "CMAKE_",
    "PKG_CONFIG",
    "STATIC_ROSIDL",
    "SETUPTOOLS_",
    "DISTUTILS",
    "SKBUILD_",
)
