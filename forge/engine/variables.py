"""The environment variables that are inputs of builds.

The variables that a build requests are observed, but not those that shells, Python and others read from their
copies of the environment. For these, `RELEVANT` lists the documented variables of the tools of ROS builds.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.base.frozen import Pairs


def relevant_environment(variables: Mapping[str, str]) -> Pairs:
    """Return the environment variables that compilers, CMake, Python and ROS packages read."""
    return tuple((name, variables[name]) for name in sorted(variables) if is_relevant(name))


def is_relevant(name: str) -> bool:
    """Return True if the environment variable `name` affects every package."""
    return name in RELEVANT or (name.startswith(_BEGINNINGS) and name not in _OUTPUT_ONLY)


def is_tracked(name: str, *, named: bool = False) -> bool:
    """Return True if a variable is an input of the packages whose build requests it.

    The home folder and the locale, which nearly all programs request, are inputs only if scripts `named`
    them.
    """
    if named and (name in _NAMED or name.startswith(_NAMED_BEGINNINGS)):
        return True
    return not (name in _UNTRACKED or name.startswith(_UNTRACKED_BEGINNINGS) or is_relevant(name))


FOR_COMPILERS = frozenset(
    """ASM ASMFLAGS CC CFLAGS CPP CPPFLAGS CUDAARCHS CUDACXX CUDAFLAGS CUDAHOSTCXX CXX CXXFLAGS FC FFLAGS
    HIPCXX HIPFLAGS HIPHOSTCXX ISPC ISPCFLAGS LDFLAGS OBJC OBJCFLAGS OBJCXX OBJCXXFLAGS
    AR ARFLAGS AS LD NM OBJCOPY RANLIB STRIP CMAKE_BUILD_TYPE
    CPATH C_INCLUDE_PATH CPLUS_INCLUDE_PATH OBJC_INCLUDE_PATH LIBRARY_PATH GCC_EXEC_PREFIX COMPILER_PATH
    CCC_OVERRIDE_OPTIONS CCACHE_COMPILER LD_RUN_PATH LDEMULATION GNUTARGET
    """.split()
)
"""Variables that affect only compiled code."""

RELEVANT = FOR_COMPILERS | frozenset(
    """ADSP_ROOT DESTDIR INCLUDE LIB MACOSX_DEPLOYMENT_TARGET SDKROOT
    BUILD_TESTING GTEST_DIR GMOCK_DIR MAKEFILES SOURCE_DATE_EPOCH
    CUDA_BIN_PATH CUDA_HOME CUDA_INC_PATH CUDA_LIB_PATH CUDA_PATH CUDA_ROOT CUDA_TOOLKIT_ROOT
    CUDA_TOOLKIT_ROOT_DIR CUDAToolkit_ROOT NVCC_APPEND_FLAGS NVCC_CCBIN NVCC_PREPEND_FLAGS
    PYTHONPATH PYTHONHOME PYTHONNOUSERSITE PYTHONPLATLIBDIR PYTHONSAFEPATH PYTHONUSERBASE
    _PYTHON_HOST_PLATFORM _PYTHON_SYSCONFIGDATA_NAME
    ARCHFLAGS CCSHARED DIST_EXTRA_CONFIG LDCXXSHARED LDSHARED PBR_VERSION
    AMENT_PREFIX_PATH ROS_PYTHON_VERSION ROS_VERSION
    """.split()
)
"""See the manuals of CMake (cmake-env-variables), gcc, ld, clang, nvcc, Python, setuptools and ament."""
_BEGINNINGS = (
    *("CMAKE_", "PKG_CONFIG", "STATIC_ROSIDL", "SETUPTOOLS_", "DISTUTILS", "SKBUILD_"),
    # Other build backends of Python packages.
    *("HATCH_BUILD_", "MATURIN_PEP517_", "PDM_BUILD_", "POETRY_DYNAMIC_VERSIONING_"),
)

_OUTPUT_ONLY = frozenset(
    """CMAKE_BUILD_PARALLEL_LEVEL CMAKE_COLOR_DIAGNOSTICS CMAKE_EXPORT_BUILD_DATABASE
    CMAKE_EXPORT_COMPILE_COMMANDS CMAKE_INSTALL_PARALLEL_LEVEL CMAKE_INSTALL_PREFIX CMAKE_MSVCIDE_RUN_PATH
    CMAKE_NO_VERBOSE CMAKE_TEST_LAUNCHER CMAKE_TLS_VERIFY CMAKE_TLS_VERSION
    PKG_CONFIG_DEBUG_SPEW PKG_CONFIG_LOG
    """.split()
)
"""Variables with a relevant prefix that do not affect results: they control parallelism or output."""

_UNTRACKED = _OUTPUT_ONLY | frozenset(
    # Files found through these are tracked instead.
    "HOME PATH TEMP TEMPDIR TMP TMPDIR "
    # The interpreter of the workspace is tracked instead.
    "CONDA_PREFIX VIRTUAL_ENV "
    # They differ from shell to shell.
    "OLDPWD PWD SHELL SHLVL _ "
    # They affect messages and their appearance.
    "CLICOLOR CLICOLOR_FORCE COLORTERM COLUMNS EMACS FORCE_COLOR GCC_COLORS GCC_URLS LANG LANGUAGE LINES "
    "NINJA_STATUS NO_COLOR TERM TERMCAP TERMINFO TERM_URLS VERBOSE "
    # They limit the number of processors.
    "CTEST_PARALLEL_LEVEL MAKEFLAGS MAKELEVEL MAKE_TERMERR MAKE_TERMOUT MFLAGS "
    # forge sets them.
    "ASAN_OPTIONS COLCON LD_PRELOAD".split()
)
_UNTRACKED_BEGINNINGS = (
    *("FORGE_", "LC_", "XDG_"),
    # They are for debugging.
    *("PYTHONBREAKPOINT", "PYTHONDEBUG", "PYTHONDEVMODE", "PYTHONDUMPREFS", "PYTHONFAULTHANDLER"),
    *(
        "PYTHONASYNCIODEBUG",
        "PYTHONINSPECT",
        "PYTHONMALLOC",
        "PYTHONNODEBUGRANGES",
        "PYTHONPROFILEIMPORTTIME",
    ),
    *(
        "PYTHONSTARTUP",
        "PYTHONTRACEMALLOC",
        "PYTHONVERBOSE",
        "PYTHON_COLORS",
        "PYTHON_PERF",
        "PYTHON_HISTORY",
    ),
    # They affect output, warnings, bytecode and threads.
    *("PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX", "PYTHONUNBUFFERED", "PYTHONWARNINGS"),
    *("PYTHON_CPU_COUNT", "PYTHON_GIL", "PYTHON_JIT"),
    # Access of git to repositories: short-lived credentials, and mirrors.
    *("GIT_CONFIG_COUNT", "GIT_CONFIG_KEY_", "GIT_CONFIG_VALUE_"),
    # gcc sets it for the programs that it starts.
    "COLLECT_",
)


_NAMED = frozenset({"HOME", "LANG", "LANGUAGE"})
_NAMED_BEGINNINGS = ("LC_", "XDG_")


def mentioned(text: str, program: str = "") -> frozenset[str]:
    """Return the variables named in a text that was read by a program that copies the whole environment.

    Requests of such a program cannot be observed, only files that it reads: scripts and templates.
    """
    naming = _NAMING_OF_CMAKE if _is_cmake(program) else _NAMING
    names = frozenset(match[match.lastindex] for match in naming.finditer(text) if match.lastindex)
    is_shell = not program or _IS_SHELL.match(os.path.basename(program)) is not None
    home = _HOME_OF_SHELLS if is_shell else _HOME_OF_OTHERS
    return names | {"HOME"} if home.search(text) else names


def copies_environment(program: str) -> bool:
    """Return whether a program, given as its path, copies the whole environment."""
    return _is_cmake(program) or _COPIES_ENVIRONMENT.match(os.path.basename(program)) is not None


def has_few_modules(program: str) -> bool:
    """Return whether an interpreter mostly reads scripts that it is told to run, unlike Python and CMake."""
    return _RUNS_SCRIPTS.match(os.path.basename(program)) is not None


def _is_cmake(program: str) -> bool:
    return os.path.basename(program) == "cmake"


def of_interpreter(program: str) -> frozenset[str]:
    """Return the variables that a program obeys without requesting them or finding them in a script."""
    return _OF_SHELLS if _IS_SHELL.match(os.path.basename(program)) else frozenset()


_OF_SHELLS = frozenset({"BASH_ENV", "BASHOPTS", "CDPATH", "ENV", "POSIXLY_CORRECT", "SHELLOPTS"})
_IS_SHELL = re.compile(r"(ba|da|k|z)?sh$")
_COPIES_ENVIRONMENT = re.compile(r"(ba|da|k|z|fi)?sh$|busybox$|g?make$|python|perl|[gm]?awk$|ruby|node|tclsh")
_RUNS_SCRIPTS = re.compile(r"(ba|da|k|z|fi)?sh$|g?make$|[gm]?awk$")
_NAMING_OF_CMAKE = re.compile(r"\bENV\{(\w+)\}")
_NAMING = re.compile(
    # Perl, awk, Ruby, Node.js, Tcl.
    r"\$?\bENV\{\s*['\"]?(\w+)|\$?\b(?:ENVIRON|ENV|env)(?:\[['\"]|\.|\()(\w+)"
    # xacro, Python's templates and configuration files.
    r"|\$\((?:opt)?env\s+(\w+)|%\((\w+)\)s"
    # make.
    r"|\$[({](?:flavor|origin|value)\s+(\w+)|^\s*ifn?def\s+(\w+)"
    # Shells, make, Perl's and Python's templates.
    r"|\$[({]?[#!]?([A-Za-z_]\w*)"
    r"|(?:\[|\btest)\s+-v\s+(\w+)|\b(?:declare|typeset)\s+-\w+\s+(\w+)"
    # Python.
    r"|environb?\s*(?:\[|\.\s*\w+\s*\()\s*[bru]*['\"](\w+)|getenvb?\s*\(\s*[bru]*['\"](\w+)"
    # Names that are looked up through an alias, as after `env = os.environ`.
    r"|['\"]([A-Z][A-Z0-9_]+)['\"]|['\"](\w+)['\"]\s+(?:not\s+)?in\s+(?:os\s*\.\s*)?environ",
    re.MULTILINE,
)
_HOME_OF_SHELLS = re.compile(r"^(?:[^#\n]*[\s=:])?~(?=[/\s;]|$)", re.MULTILINE)
_HOME_OF_OTHERS = re.compile(r"\bexpanduser\b|\bPath\.home\(")
"""Other names of the home folder."""
