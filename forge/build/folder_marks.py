"""Mark folders and decide who owns them: only folders marked by forge or colcon are ever emptied.

A path alone proves nothing: a user may pass '--build-base src' instead of '--build-base build'. A folder of a
package belongs to forge if it does not exist, is empty, or has a mark, which forge creates before anything
else, or one of colcon's marks below a marked base. Sources are never forge's, whatever marks they carry.
"""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.ament_index import INDEX
from forge.base.errors import Problem, WorkspaceError, raise_if_any
from forge.base.files import mount_points, text_or_nothing, write_if_changed
from forge.base.layout import (
    BACKUP_DIR,
    BUILD_BASE_FILES,
    BUILD_RESULT,
    BUILT_BY,
    IGNORE_MARK,
    INSTALL_BASE_FILES,
    INSTALL_STATE_FILE,
    INSTALLED_LISTS_DIR,
    JOURNAL_FILE,
    LAYOUT_MARKER,
    SCRATCH_DIR,
    SET_ASIDE_DIR,
    TEST_RESULT,
    TEST_SCRATCH_DIR,
)
from forge.build.installed_lists import listed_files
from forge.environment.prefixes import PACKAGES
from forge.environment.shells import SHELLS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from forge.base.layout import Layout
    from forge.build.model import BuildRecord

BUILDERS = ("colcon", "forge")
_OTHER_BUILDERS = ("ament_tools", "catkin build", "catkin_make", "catkin_make_isolated")
"""Tools that write the same mark; any other word beside forge's journal is damage."""
_OWN_MARKS = (SCRATCH_DIR, TEST_SCRATCH_DIR)
_COLCON_MARKS = (BUILD_RESULT, TEST_RESULT, "cmake_args.last", "colcon_command_prefix_*.sh")
_BASE_MARKS = (BUILT_BY, LAYOUT_MARKER, IGNORE_MARK, INSTALLED_LISTS_DIR)
_HOME_OF_CMAKE = re.compile(r"^CMAKE_HOME_DIRECTORY:INTERNAL=(.*)$", re.MULTILINE)
_WORD = re.compile(r"[A-Za-z][\w.+-]*")
RUN_NAME = re.compile(r"[a-z][a-z_-]*_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d(_\d+)?")
_LATEST = re.compile(r"latest_[a-z][a-z_-]*")
_RESULTS_MARK = ".forge_results"
_LEVELS = 3
"""The depth to which a future base is searched for sources that no command discovered."""


def builder(build: Path) -> str | None:
    """Return the tool that created a build folder; None without a mark, or with one that was damaged."""
    word = text_or_nothing(build / BUILT_BY).strip()
    damaged = not _WORD.fullmatch(word) or (build / JOURNAL_FILE).is_file()
    return word if word in {*BUILDERS, *_OTHER_BUILDERS} or not damaged else None


def is_own_build_base(build: Path) -> bool:
    tool = builder(build)
    marked = (build / BUILT_BY).is_file() and (build / JOURNAL_FILE).is_file()
    return tool in BUILDERS or (tool is None and marked)


def is_own_install_base(install: Path) -> bool:
    """The lists of installed files remain if 'forge clean' keeps unowned files in prefixes."""
    return (install / LAYOUT_MARKER).is_file() or (install / INSTALLED_LISTS_DIR).is_dir()


def recorded_layout(install: Path) -> str | None:
    """Return the layout of an install folder; if its marker is damaged, that of the packages in it."""
    word = text_or_nothing(install / LAYOUT_MARKER).strip()
    if word in {"merged", "isolated"} or not is_own_install_base(install):
        return word or None
    if (install / PACKAGES).is_dir():
        return "merged"
    return "isolated" if any(install.glob(f"*/{PACKAGES}")) else None


def is_own_log_link(link: Path) -> bool:
    """Return whether an entry of a log folder is a link to the latest run, as forge and colcon create it."""
    return link.is_symlink() and bool(
        RUN_NAME.fullmatch(target := os.readlink(link)) or _LATEST.fullmatch(target)
    )


def is_own_ignore_mark(mark: Path) -> bool:
    """Return whether forge or colcon may have created a COLCON_IGNORE, which then is an empty file."""
    return mark.is_file() and not mark.is_symlink() and not mark.stat().st_size


def is_own_build_dir(build: Path) -> bool:
    """Return whether a folder has the marks of a package's build folder, and is not a source folder."""
    if sources_in(build):
        return False
    if any((build / mark).is_dir() for mark in _OWN_MARKS):
        return True
    return is_own_build_base(build.parent) and (
        any(path.is_file() for mark in _COLCON_MARKS for path in build.glob(mark))
        or (build.parent / SET_ASIDE_DIR / build.name).is_dir()
    )


def is_own_result_dir(folder: Path) -> bool:
    return is_own_build_dir(folder) or (folder / _RESULTS_MARK).is_file()


def mark_result_dir(folder: Path) -> None:
    if not is_own_result_dir(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _RESULTS_MARK).touch()


def has_package_marks(prefix: Path) -> bool:
    share = prefix / "share" / prefix.name
    marks = (prefix / PACKAGES, prefix / INDEX / "packages")
    return any((mark / prefix.name).is_file() for mark in marks) or (share / "package.dsv").is_file()


def is_own_prefix(prefix: Path) -> bool:
    """Return whether a list of installed files, or a killed build, marks an isolated prefix of a package."""
    base, name = prefix.parent, prefix.name
    notes = (
        INSTALLED_LISTS_DIR + f"/{name}.json",
        *(f"{BACKUP_DIR}/{name}{end}" for end in ("", ".part", ".state")),
    )
    return is_own_install_base(base) and (
        has_package_marks(prefix) or any((base / note).exists() for note in notes)
    )


def sources_in(folder: Path) -> str:
    """Return the name at the top of a folder that shows that it contains sources, '' if none does.

    CMake may generate a package.xml in a build folder, which is then not the source folder of its cache;
    colcon links one into the build folders of Python packages.
    """
    if os.path.lexists(folder / ".git"):
        return ".git"
    manifest = folder / "package.xml"
    if not manifest.is_file() or manifest.is_symlink():
        return ""
    home = _HOME_OF_CMAKE.search(text_or_nothing(folder / "CMakeCache.txt"))
    generated = home is not None and not _same_folder(home[1], folder)
    return "" if generated else "package.xml"


def is_source_of(folder: Path, record: BuildRecord | None) -> bool:
    """Return whether a package was built from this folder, which therefore is never an output folder."""
    return record is not None and bool(record.source) and _same_folder(record.source, folder)


def contents(folder: Path) -> str:
    names = sorted(os.listdir(folder), key=lambda name: (name not in {".git", "package.xml"}, name))
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return f"'{names[0]}'{more}" if names else "nothing"


class SourceFolders:
    """Folders that cannot be output folders: sources, the home folder, the root of the file system.

    A package at the root of the workspace may have the bases beside its own files. Paths are compared
    without links.
    """

    def __init__(self, root: Path, sources: Iterable[Path]) -> None:
        """Resolve the absolute folders of packages, `sources`."""
        self._top = os.path.realpath(root)
        self._home = os.path.realpath(Path.home())
        self._sources: dict[str, str] = {}
        real_parent = cache(os.path.realpath)  # hundreds of packages have few parents
        for path in map(str, sources):
            parent, name = os.path.split(path)
            is_plain = name not in {"", ".", ".."} and not os.path.islink(path)
            real = os.path.join(real_parent(parent), name) if is_plain else os.path.realpath(path)
            self._sources[real] = path

    def conflict(self, folder: Path) -> str:
        """Return why a folder cannot be an output folder, as the end of a sentence; '' if it can."""
        real, sources = os.path.realpath(folder), self._sources
        if real == os.sep:
            return "is the root of the file system"
        if f"{self._home}/".startswith(f"{real}/"):
            return "is the home folder" if real == self._home else "contains the home folder"
        if real in sources:
            return f"is the source folder of a package: '{sources[real]}'"
        inside = next((path for path in sources if path.startswith(f"{real}/")), None)
        if inside:
            return f"contains the sources of a package: '{sources[inside]}'"
        above = real
        while above != os.sep:
            above = os.path.dirname(above)
            if above in sources and above != self._top:
                return f"is inside the sources of a package: '{sources[above]}'"
        return ""


def bases_of(layout: Layout) -> dict[str, Path]:
    """Return the bases of a workspace by the options that name them."""
    own = layout.of_host
    bases = {"--build-base": own.build, "--install-base": own.install}
    return {**bases, "--log-base": layout.logs} if layout.logs else bases


def base_problems(
    bases: Mapping[str, Path], sources: SourceFolders, *, thorough: bool = False
) -> Iterator[Problem]:
    """Yield a problem for each unsuitable base; `bases` maps options to folders.

    A `thorough` check also searches marked bases for sources, which a mark hides from discovery.
    """
    for option, base in bases.items():
        top = f"contains '{source}'" if (source := sources_in(base)) else ""
        deep = _unfit_base(base, thorough=thorough) if option in _MARKED else ""
        if reason := sources.conflict(base) or top or deep:
            hint = f"choose another folder with '{option}'"
            yield Problem(f"the {_KINDS[option]} folder '{base}' {reason}", hint=hint)


def occupied_bases(layout: Layout) -> Iterator[Problem]:
    """Yield a problem for each unmarked base where forge would overwrite an unowned file."""
    own = layout.of_host
    for kind, base, is_own, names in (
        ("build", own.build, is_own_build_base, BUILD_BASE_FILES),
        ("install", own.install, is_own_install_base, INSTALL_BASE_FILES),
    ):
        candidates = () if is_own(base) else (name for name in names if name != IGNORE_MARK)
        if name := next((name for name in candidates if os.path.lexists(base / name)), None):
            message = f"the {kind} folder '{base}' contains '{name}', which forge did not create"
            yield Problem(message, hint=f"move it away, or choose another folder with '--{kind}-base'")


_MARKED = ("--build-base", "--install-base", "--log-base")
_KINDS = {
    "--build-base": "build",
    "--install-base": "install",
    "--log-base": "log",
    "--test-result-base": "test result",
    "--cache": "cache",
    "FORGE_CACHE_DIR": "cache",
}


def _unfit_base(base: Path, *, thorough: bool) -> str:
    """Return why an existing folder cannot be a base, as the end of a sentence; '' if it can."""
    if not base.is_dir():
        return ""
    marked = any(os.path.lexists(base / mark) for mark in _BASE_MARKS)
    if marked and not thorough:
        return ""
    real = os.path.realpath(base)
    if (
        not marked
        and not any(base.glob(f"*/{SCRATCH_DIR}"))
        and not _is_free(base)
        and real in mount_points()
    ):
        return f"is the root of a mount that contains {contents(base)}"
    # Once the folder is marked, no command would discover these sources.
    waiting = [(real, 0)]
    while waiting:
        folder, level = waiting.pop()
        try:
            entries = {entry.name: entry for entry in os.scandir(folder)}
        except OSError:
            continue
        source = next((name for name in (".git", "package.xml") if name in entries), "")
        if source and not entries[source].is_symlink():
            return f"contains sources: '{folder}/{source}'"
        if level < _LEVELS and "CMakeCache.txt" not in entries:
            folders = (entry for entry in entries.values() if entry.is_dir(follow_symlinks=False))
            waiting += [
                (e.path, level + 1) for e in folders if e.name != "share" and not e.name.startswith(".")
            ]
    return ""


def nesting_problems(layout: Layout, names: Iterable[str]) -> Iterator[Problem]:
    """Yield a problem if two bases are the same, or if one is inside the folder of a package.

    A base in such a folder would be emptied with it.
    """
    build, install = os.path.realpath(layout.build), os.path.realpath(layout.install)
    hint = "choose another folder with '{}'"
    if build == install:
        message = f"the build folder and the install folder are the same: '{layout.build}'"
        yield Problem(message, hint=hint.format("--build-base' or '--install-base"))
        return
    package_names = frozenset(names)
    logs = os.path.realpath(layout.logs) if layout.logs else ""
    for kind, outer, other, inner in (
        ("build", build, "install", install),
        ("install", install, "build", build),
        ("build", build, "log", logs),
        ("install", install, "log", logs),
    ):
        if kind == "install" and layout.merged:
            continue
        part = inner[len(outer) + 1 :].partition("/")[0] if inner.startswith(f"{outer}/") else ""
        if part in package_names:
            message = f"the {other} folder '{inner}' is inside the {kind} folder of '{part}'"
            yield Problem(message, hint=hint.format(f"--{other}-base"))


def folder_problems(
    names: Iterable[str],
    layout: Layout,
    sources: SourceFolders,
    records: Callable[[], Mapping[str, BuildRecord]],
    *,
    prefixes: bool = True,
) -> Iterator[Problem]:
    """Yield a problem for each build folder and isolated prefix of these packages that is not forge's.

    `records` reads the journal, which is only necessary for a prefix without marks.
    """
    prefixes = prefixes and not layout.merged
    is_own_install = prefixes and is_own_install_base(layout.install)
    for name in names:
        folders = []
        build, prefix = f"{layout.build}/{name}", f"{layout.install}/{name}"
        if not _is_plain(build, SCRATCH_DIR) and os.path.lexists(build):
            folders.append(("build", layout.build_dir(name)))
        if (
            prefixes
            and not (is_own_install and _is_plain(prefix, f"{PACKAGES}/{name}"))
            and os.path.lexists(prefix)
        ):
            folders.append(("install", layout.prefix(name)))
        for kind, folder in folders:
            hint = f"move it away, or choose another folder with '--{kind}-base'"
            what = f"the {kind} folder '{folder}' of '{name}'"
            if folder.is_symlink() and (reason := sources.conflict(folder) or _other_workspace(folder, kind)):
                yield Problem(f"{what} {reason}", hint=hint)
            elif not (
                is_own_build_dir(folder) if kind == "build" else is_usable_prefix(folder, layout, records)
            ) and not _is_free(folder):
                message = f"{what} was not created by forge or colcon: it contains {contents(folder)}"
                yield Problem(message, hint=hint)


def _other_workspace(link: Path, kind: str) -> str:
    """Return the end of a sentence if a link leads into a build or install folder other than its own."""
    real = Path(os.path.realpath(link))
    is_own = is_own_build_base if kind == "build" else is_own_install_base
    if _same_folder(real.parent, link.parent) or not is_own(real.parent):
        return ""
    return f"is a link to '{real}', which belongs to another {kind} folder"


def _is_plain(folder: str, mark: str) -> bool:
    """Return whether a folder, not a link, has a mark and needs no closer inspection; fast."""
    exists = os.path.lexists
    return (
        exists(f"{folder}/{mark}")
        and not os.path.islink(folder)
        and not (exists(f"{folder}/package.xml") or exists(f"{folder}/.git"))
    )


def is_usable_prefix(prefix: Path, layout: Layout, records: Callable[[], Mapping[str, BuildRecord]]) -> bool:
    """Return whether a build may replace the files of a package in a prefix that exists."""
    name = prefix.name
    if source := sources_in(prefix):
        path = str(prefix / source)
        record = records().get(name)
        if is_source_of(prefix, record):
            return False
        listed = path in listed_files(layout.build_dir(name))
        installed = listed or (record is not None and path in record.files)
        if not installed and (source == "package.xml" or not has_package_marks(prefix)):
            return False
    if is_own_prefix(prefix):
        return True
    # The marks of a package are written last: without them, the files belong to a failed build.
    return is_own_install_base(prefix.parent) and (
        name in records() or is_own_build_dir(layout.build_dir(name))
    )


def _is_free(folder: Path) -> bool:
    """Return whether emptying a folder loses nothing: it is missing, empty, or reported as a file."""
    try:
        with os.scandir(folder) as entries:
            return all(entry.name == "lost+found" for entry in entries)
    except (FileNotFoundError, NotADirectoryError):
        return True


def _same_folder(one: str | Path, other: str | Path) -> bool:
    return os.path.realpath(one) == os.path.realpath(other)


def create_output_folders(layout: Layout) -> None:
    """Create the build and install folders with the markers that colcon and forge share.

    Raises WorkspaceError if a folder cannot be created, belongs to another tool, or has the other layout.
    """
    problems = []
    if layout.target:
        # The folders around them are marked, too: they identify the workspace and contain no packages.
        _make_ignored(layout.of_host.install)
        mark_build_base(layout.of_host.build)
    for check in (_begin_build, _begin_install):
        try:
            problem = check(layout)
        except OSError as error:
            hint = "choose other folders with '--build-base' and '--install-base', or make them writable"
            problem = Problem(f"cannot create '{error.filename}': {error.strerror}", hint=hint)
        if problem:
            problems.append(problem)
    if problems:
        raise WorkspaceError(*dict.fromkeys(problems))


def foreign_build(layout: Layout) -> Problem | None:
    tool = builder(layout.build)
    if tool in {None, *BUILDERS}:
        return None
    hint = "choose another folder with '--build-base'"
    return Problem(f"the build folder '{layout.build}' was created by '{tool}'", hint=hint)


def other_layout(layout: Layout) -> Problem | None:
    layout_name = recorded_layout(layout.install)
    if layout_name in {None, layout.word}:
        return None
    change = "remove '--merge-install'" if layout.merged else "add '--merge-install'"
    return Problem(
        f"the install folder '{layout.install}' has the {layout_name} layout, not the {layout.word} one",
        hint=f"{change}, remove the folder, or choose another with '--install-base'",
    )


def workspace_scripts(root: Path) -> list[str]:
    """Return the workspace-level files of an install folder: forge's state file and the setup scripts."""
    scripts = (f"{root}/{name}.{shell}" for name in ("setup", "local_setup") for shell in SHELLS)
    return [f"{root}/{INSTALL_STATE_FILE}", *scripts]


def mark_build_base(build: Path) -> None:
    _make_ignored(build)
    write_if_changed(build / BUILT_BY, "colcon\n")


def _begin_build(layout: Layout) -> Problem | None:
    if not (problem := foreign_build(layout)):
        mark_build_base(layout.build)
    return problem


def _begin_install(layout: Layout) -> Problem | None:
    if layout.install.exists() and not layout.install.is_dir():
        hint = "remove it, or choose another with '--install-base'"
        return Problem(f"the install folder '{layout.install}' is a file", hint=hint)
    problem = other_layout(layout)
    if problem is None:
        _make_ignored(layout.install)
    return problem


def mark_layout(layout: Layout) -> None:
    """Record the layout of an install folder. Builds hold its lock: another one may begin at the same time.

    Raises WorkspaceError if the folder has the other layout.
    """
    raise_if_any(filter(None, (other_layout(layout),)), WorkspaceError)
    write_if_changed(layout.install / LAYOUT_MARKER, f"{layout.word}\n")


def _make_ignored(folder: Path) -> None:
    """Create a folder that package discovery ignores."""
    folder.mkdir(parents=True, exist_ok=True)
    marker = folder / IGNORE_MARK
    if not os.path.lexists(marker):
        marker.touch()


_SEPARATORS = {
    ":": "path lists use it as separator",
    ";": "CMake lists use it as separator",
    '"': "CMake's scripts use it as string delimiter",
    "\\": "CMake interprets it as '/'",
}
_SETUPTOOLS_PLACEHOLDERS = dict.fromkeys("$%{}", "setuptools substitutes it")


def path_problems(folders: Iterable[Path], *, python: bool) -> Iterator[Problem]:
    """Yield a problem for each folder with an unsupported character; `python`: with Python packages."""
    reasons = {**_SEPARATORS, **(_SETUPTOOLS_PLACEHOLDERS if python else {})}
    for folder in dict.fromkeys(folders):
        for character in dict.fromkeys(str(folder)):
            reason = "it is a line break" if character in "\n\r" else reasons.get(character)
            if reason:
                hint = "move the workspace, or choose other folders with '--build-base' and '--install-base'"
                message = f"the path '{folder}' contains {character!r}, which is not supported: {reason}"
                yield Problem(message, hint=hint)
                break


def is_removed_package(source: Path) -> bool:
    """Return True if a folder no longer contains a package, or is ignored."""
    if not (source / "package.xml").is_file():
        return not (source / "CMakeLists.txt").is_file() and not (source / "setup.py").is_file()
    return any(
        (folder / marker).exists()
        for folder in (source, *source.parents)
        for marker in (IGNORE_MARK, "AMENT_IGNORE")
    )
