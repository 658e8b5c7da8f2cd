"""Why a package must be built, or that it need not be; pure.

A package is fresh when nothing that its result depends on changed: its sources, its options, the
tools, the environment, forge itself, files outside the workspace that its build read, what its
dependencies give, and when what it installed is still there. A dependency that was built again and
installed the same bytes gives the same: the change stops there.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.model import Pairs, Parts, Record, Snapshot

UNKNOWN = "unknown"
"""What a package installed of which there is no record, such as one that another tool built."""


@frozen
class Extra:
    """What one package is made from beside what all are: more options, tools and variables of its `Parts`."""

    options: tuple[str, ...] = ()
    tools: Pairs = ()
    environment: Pairs = ()


class Outlook:
    """What each package gives to others, as far as that is settled; owned by the loop of a build.

    A package gives its own installed files and what its needs give. What is built in this run is pending
    until it ended; so is everything above it.
    """

    def __init__(self, needs: Mapping[str, frozenset[str]], installed: Mapping[str, str]) -> None:
        """Begin with the digests of what is installed now; nothing is pending."""
        self._needs = needs
        self._installed = dict(installed)
        self._pending: set[str] = set()
        self._gives: dict[str, str | None] = {}

    def expect(self, name: str) -> None:
        """Note that the package will, or may, be built in this run."""
        self._pending.add(name)
        self._gives.pop(name, None)

    def settle(self, name: str, installed: str | None = None) -> None:
        """Note that the package ended, and the digest of its files if that is new."""
        self._pending.discard(name)
        if installed is not None:
            self._installed[name] = installed

    def needs_of(self, name: str, below: Iterable[str]) -> Pairs | None:
        """Return what the direct needs of `name` give, or None while one is pending.

        `below` is all that the package needs, however deep, in topological order.
        """
        for other in below:
            if self._gives.get(other) is None:
                self._gives[other] = self._given(other)
        found = [(need, self._gives.get(need)) for need in sorted(self._needs[name])]
        return None if any(said is None for _, said in found) else tuple((n, said or "") for n, said in found)

    def _given(self, name: str) -> str | None:
        if name in self._pending:
            return None
        below = [self._gives.get(need) for need in sorted(self._needs[name])]
        if None in below:
            return None
        said = (self._installed.get(name, UNKNOWN), *(digest or "" for digest in below))
        return hashlib.blake2b("\0".join(said).encode(), digest_size=16).hexdigest()


def why_at_all(name: str, record: Record | None, snapshot: Snapshot) -> str | None:
    """Return why the package must be built whatever it is made from, or None."""
    if record is None:
        return "it was not built here yet"
    if not record.complete:
        return "its last build did not end well"
    if name not in snapshot.present or snapshot.installed[name].digest != record.installed.digest:
        return "something that it had installed was changed or removed"
    if name in snapshot.moved:
        return f"'{snapshot.moved[name]}', which it reads, changed"
    if record.saved:
        return f"'{record.saved[0]}' was saved while it was built"
    return None


def why_different(now: Parts, then: Parts, news: tuple[str, ...] = ()) -> str | None:
    """Return what the package is made from differently now, the weightiest first, or None."""
    if now.forge != then.forge:
        return "forge itself changed"
    for before, after, words in (
        (then.tools, now.tools, "the tool '{}' changed"),
        (then.environment, now.environment, "the environment variable '{}' changed"),
    ):
        name = _first_difference(after, before)
        if name:
            return words.format(name)
    if now.options != then.options:
        return _option(now.options, then.options)
    if now.sources != then.sources:
        return source_changes(news)
    need = _first_difference(now.needs, then.needs)
    if need:
        return f"'{need}', which it needs, came out different"
    return "packages were added to an underlay, or removed" if now.underlays != then.underlays else None


def _first_difference(now: Pairs, then: Pairs) -> str | None:
    known, said = dict(then), dict(now)
    return next((name for name in sorted(known | said) if known.get(name) != said.get(name)), None)


def _option(now: Iterable[str], then: Iterable[str]) -> str:
    known, said = list(then), list(now)
    added = next((word for word in said if word not in known), None)
    if added is not None and added.startswith((MANIFEST, NAMED_FILE)):
        return f"{added.rpartition(' ')[0]} changed"
    if added is not None:
        return f"the option '{added}' is new"
    gone = next((word for word in known if word not in said), None)
    return f"the option '{gone}' is gone" if gone is not None else "the order of its options changed"


def source_changes(news: tuple[str, ...]) -> str:
    """Return what changed in the sources of a package; `news` are the files that were read anew."""
    if not news:
        return "files were added to it, removed or renamed"
    rest = f" and {len(news) - 1} more" if len(news) > 1 else ""
    return f"'{news[0]}'{rest} changed"


MANIFEST, NAMED_FILE = "what its package.xml comes to", "the file "
"""How words among the options begin that end in a digest."""


def environment_that_counts(variables: Mapping[str, str]) -> Pairs:
    """Return the variables that compilers, CMake, Python and ROS packages read."""
    return tuple((name, variables[name]) for name in sorted(variables) if counts(name))


def counts(name: str) -> bool:
    """Tell if a variable of this name counts for every package."""
    return name in _NAMES or (name.startswith(_BEGINNINGS) and name not in WITHOUT_EFFECT)


WITHOUT_EFFECT = frozenset(
    """CMAKE_BUILD_PARALLEL_LEVEL CMAKE_COLOR_DIAGNOSTICS CMAKE_EXPORT_BUILD_DATABASE
    CMAKE_EXPORT_COMPILE_COMMANDS CMAKE_INSTALL_PARALLEL_LEVEL CMAKE_INSTALL_PREFIX CMAKE_MSVCIDE_RUN_PATH
    CMAKE_NO_VERBOSE CMAKE_TEST_LAUNCHER CMAKE_TLS_VERIFY CMAKE_TLS_VERSION
    PKG_CONFIG_DEBUG_SPEW PKG_CONFIG_LOG
    """.split()  # noqa: SIM905
)
"""What begins like a variable that counts, and says how to build or what to print, not what."""

CONFIGURING = frozenset({"python", "cmake", "ninja", "make"})
"""The tools of a package that compiles nothing."""

FOR_COMPILERS = frozenset(
    """ASM ASMFLAGS CC CFLAGS CPP CPPFLAGS CUDAARCHS CUDACXX CUDAFLAGS CUDAHOSTCXX CXX CXXFLAGS FC FFLAGS
    HIPCXX HIPFLAGS HIPHOSTCXX ISPC ISPCFLAGS LDFLAGS OBJC OBJCFLAGS OBJCXX OBJCXXFLAGS
    AR ARFLAGS AS LD NM OBJCOPY RANLIB STRIP CMAKE_BUILD_TYPE
    CPATH C_INCLUDE_PATH CPLUS_INCLUDE_PATH OBJC_INCLUDE_PATH LIBRARY_PATH GCC_EXEC_PREFIX COMPILER_PATH
    CCC_OVERRIDE_OPTIONS CCACHE_COMPILER LD_RUN_PATH LDEMULATION GNUTARGET
    """.split()  # noqa: SIM905
)
"""Variables that only concern what is compiled."""

_NAMES = FOR_COMPILERS | frozenset(
    """ADSP_ROOT DESTDIR INCLUDE LIB MACOSX_DEPLOYMENT_TARGET SDKROOT
    BUILD_TESTING GTEST_DIR GMOCK_DIR MAKEFILES SOURCE_DATE_EPOCH
    CUDA_BIN_PATH CUDA_HOME CUDA_INC_PATH CUDA_LIB_PATH CUDA_PATH CUDA_ROOT CUDA_TOOLKIT_ROOT
    CUDA_TOOLKIT_ROOT_DIR CUDAToolkit_ROOT NVCC_APPEND_FLAGS NVCC_CCBIN NVCC_PREPEND_FLAGS
    PYTHONPATH PYTHONHOME PYTHONNOUSERSITE PYTHONPLATLIBDIR PYTHONSAFEPATH PYTHONUSERBASE
    _PYTHON_HOST_PLATFORM _PYTHON_SYSCONFIGDATA_NAME
    ARCHFLAGS CCSHARED LDCXXSHARED LDSHARED PBR_VERSION PDM_BUILD_SCM_VERSION
    AMENT_PREFIX_PATH ROS_DISTRO ROS_PYTHON_VERSION ROS_VERSION
    """.split()  # noqa: SIM905  (a list of eighty lines would say no more)
)
"""From the manuals of CMake (cmake-env-variables), gcc, ld, clang, nvcc, Python, setuptools and ament."""
_BEGINNINGS = (
    "CMAKE_",
    "PKG_CONFIG",
    "STATIC_ROSIDL",
    "SETUPTOOLS_",
    "DISTUTILS",
    "SKBUILD_",
)
