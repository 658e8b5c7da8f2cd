"""The layout of build, install and log folders, compatible with colcon, and the names of forge's files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.base.frozen import frozen

PACKAGE = Path(__file__).parents[1]
"""The folder of forge's modules; a wheel contains the templates in it, a checkout next to it."""


# A folder with this file is not searched for packages. forge and colcon create it in their own folders.
IGNORE_MARK = "COLCON_IGNORE"

# In the build folder of the workspace.
JOURNAL_FILE = "forge_journal.jsonl"
"""The inputs and results of each package."""
FILE_TABLE = "forge_files.json"
"""Digests of files by their stats, so that unchanged files are not read again."""
INSTALLED_STATES_DIR = ".forge_installed"
"""Lists of installed files for each package and state, to find out which of them changed."""
TOOLCHAIN_DIR = "forge_toolchain"
"""Cached results of CMake's checks of compilers and Python."""
MEMORY_FILE = "forge_memory.json"
"""The peak memory use of each package."""
TEST_FILE_TABLE = "forge_test_files.json"
"""The same as FILE_TABLE for the inputs of tests."""
COMPILE_COMMANDS = "compile_commands.json"
LOCK_FILE = ".forge_lock"
PACKAGE_LOCK = "forge.lock"
"""A file in the root of a workspace for which a plugin builds an underlay."""
PROCESSES_FILE = ".forge_processes"
"""The process groups of a running build, so that the next one can end them if forge was killed."""
PROGRAMS_DIR = ".forge_programs"
"""Links to the programs that come first on PATH."""
COMPILATIONS_FILE = ".forge_compilations"
"""ccache's log of the compilations of a build."""
CLUSTER_DIR = ".forge_cluster"
"""Files for the workers of a Dask cluster."""
OWN_CACHE_DIR = ".forge_own"
"""Replaces the user's cache folder if there is none."""
TEMPLATES_DIR = ".forge_templates"
"""Compiled templates, if the user has no cache folder."""
SET_ASIDE_DIR = ".forge_set_aside"
"""The previous build folders of packages that are being reconfigured from scratch."""
TRASH_DIR = ".forge_trash"
"""Build folders that are being removed."""
INTERFACE_PAGES_DIR = "forge_interface_docs"
"""The pages of `forge interface docs` without --output."""
STYLES_FILE = "styles.json"
"""The jobserver styles that ninja and make support; in the user's cache folder if there is one."""

BUILT_BY = ".built_by"
"""Names the tool that created the build folder; the same file as colcon's."""
BUILD_BASE_FILES = (
    *(
        BUILT_BY,
        IGNORE_MARK,
        JOURNAL_FILE,
        FILE_TABLE,
        MEMORY_FILE,
        TEST_FILE_TABLE,
        INSTALLED_STATES_DIR,
    ),
    *(TOOLCHAIN_DIR, COMPILE_COMMANDS, LOCK_FILE, PROCESSES_FILE, PROGRAMS_DIR, COMPILATIONS_FILE),
    *(CLUSTER_DIR, OWN_CACHE_DIR, TEMPLATES_DIR, SET_ASIDE_DIR, TRASH_DIR, STYLES_FILE),
    INTERFACE_PAGES_DIR,
)
"""Files that forge and colcon create in the build folder of a workspace, beside package folders."""

# In the log folder.
CODE_QUALITY_FILE = "gl-code-quality-report.json"
"""The errors and warnings of the last build on GitLab, which suggests this name."""

# In the build folder of a package.
SCRATCH_DIR = ".forge"
"""forge's own files for the steps of the package."""
TEST_SCRATCH_DIR = ".forge_test"
"""forge's own files for the tests of the package."""
UNITS_FAILED_FILE = ".forge_units_failed"
"""Exists if generated sources of the package do not compile together."""
BUILD_RESULT = "colcon_build.rc"
TEST_RESULT = "colcon_test.rc"
"""Result files shared with colcon: an exit code, SIGINT, or 'test failures'."""

# In SCRATCH_DIR.
CONFIGURED_FILE = "configured"
"""A digest of the last configure command."""
RECORD_FILE = "record.json"
"""The record of a build folder: inputs of its contents, and accesses of its commands."""
DEFERRED_BUILD_FILE = "deferred_build.json"
"""The build steps of a package that was restored from the cache, for its tests."""
LAST_COMMAND = "last_command"
"""The command that repeats the last step."""

# In TEST_SCRATCH_DIR.
PASSED_TESTS_FILE = "passed.json"
"""The record of the last pass, for `forge test --cached`."""

# In the install folder.
LAYOUT_MARKER = ".colcon_install_layout"
INSTALL_STATE_FILE = ".forge.json"
"""The underlays and the interpreter of the last build."""
BACKUP_DIR = ".forge_before"
"""The previous files of packages while they are built."""
INSTALLED_LISTS_DIR = ".forge_files"
"""The files that forge installed for each package: it removes no others."""


INSTALL_BASE_FILES = (
    *(LAYOUT_MARKER, IGNORE_MARK, INSTALL_STATE_FILE, "_local_setup_util_sh.py", "_local_setup_util_ps1.py"),
    *(
        f"{name}.{shell}"
        for name in ("setup", "local_setup")
        for shell in ("bash", "fish", "ps1", "sh", "zsh")
    ),
)
"""Files that forge and colcon create in the install folder of a workspace, beside those of packages."""


def templates_folder() -> Path:
    packed = PACKAGE / "_templates"
    return packed if packed.is_dir() else PACKAGE.parent / "templates"


def docs_url(page: str) -> str:
    """Return the URL of a page below docs/, `page` with its anchor if any.

    The wheel contains the pages, so that they match the installed version and can be read without a network.
    """
    packed = PACKAGE / "_docs"
    return f"{(packed if packed.is_dir() else PACKAGE.parent / 'docs').as_uri()}/{page}"


NO_CODE = ("embedded", "_docs")
"""Folders of the package whose files do not affect forge's behaviour: source packages and documentation."""


def own_folders() -> list[Path]:
    templates = templates_folder()
    return [PACKAGE] if templates.is_relative_to(PACKAGE) else [PACKAGE, templates]


@frozen
class Layout:
    """The absolute output folders of one workspace, and whether packages share a prefix."""

    build: Path
    install: Path
    logs: Path | None
    merged: bool = False
    symlink: bool = False
    target: str = ""
    """The platform of these folders, which are below those of this machine; '' for this machine."""
    profile: str = ""
    """The profile of these folders, which are usually beside those of builds without a profile."""
    root: Path = Path()
    """The root of the workspace."""

    def prefix(self, name: str) -> Path:
        return self.install if self.merged else self.install / name

    def build_dir(self, name: str) -> Path:
        return self.build / name

    @property
    def of_host(self) -> Layout:
        """Return the folders of this machine, which contain those of all targets."""
        if not self.target:
            return self
        return replace(self, build=self.build.parent, install=self.install.parent, target="")

    def command(self, words: str) -> str:
        """Return a command of forge for these folders, for hints."""
        return forge_command(words, self.profile)

    @property
    def word(self) -> str:
        return "merged" if self.merged else "isolated"


def forge_command(words: str, profile: str | None) -> str:
    """Return a command of forge with a profile, for hints."""
    return f"forge {words} --profile {profile}" if profile else f"forge {words}"
