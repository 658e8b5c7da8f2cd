"""Which definitions an embedded package has in a ROS distribution.

Its folders msg, srv and action have those of the oldest distribution. Those that a later one added or changed
are in since/DISTRIBUTION, whose file `removed` names those that it no longer has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.distributions import DISTRIBUTIONS, OLDEST, up_to
from forge.base.layout import PACKAGE

if TYPE_CHECKING:
    from pathlib import Path

EMBEDDED = PACKAGE / "embedded"
SINCE = "since"
REMOVED = "removed"

_KINDS = ("msg", "srv", "action")


def definition_folders(folder: Path, rosdistro: str) -> tuple[Path, ...]:
    """Return the folders that contain the definitions of a package; the first ones take precedence."""
    newer = folder / SINCE
    if not folder.is_relative_to(EMBEDDED) or not newer.is_dir():
        return (folder,)
    return (*(base for name in up_to(rosdistro) if (base := newer / name).is_dir()), folder)


def removed_definitions(folder: Path) -> frozenset[str]:
    """Return the definitions that are removed with one of these folders, such as 'msg/Pose2D.msg'."""
    path = folder / REMOVED
    in_distribution = folder.parent.name == SINCE and path.is_file()
    return frozenset(path.read_text(encoding="utf-8").split() if in_distribution else ())


def find_definition(folder: Path, rosdistro: str, relative: str) -> Path | None:
    """Return the path of the definition `relative` to the folder of a package, None if it has none."""
    for base in definition_folders(folder, rosdistro):
        if relative in removed_definitions(base):
            return None
        path = base / relative
        if path.is_file():
            return path
    return None


def is_embedded(folder: Path) -> bool:
    """Tell whether a package is forge's own, or was installed from one; `folder` contains its package.xml."""
    if folder.is_relative_to(EMBEDDED):
        return True
    manifest = folder / "package.xml"
    return manifest.is_file() and "<forge_family>" in manifest.read_text(encoding="utf-8")


def has_definitions(folder: Path, rosdistro: str) -> bool:
    paths = (
        path.relative_to(base).as_posix()
        for base in definition_folders(folder, rosdistro)
        for kind in _KINDS
        for path in (base / kind).glob(f"*.{kind}")
    )
    return any(find_definition(folder, rosdistro, relative) for relative in paths)


def distributions_with(package: str, relative: str = "") -> tuple[str, ...]:
    """Return the distributions in which an embedded package has a definition, or any definition at all."""
    folder = EMBEDDED / package
    if not folder.is_dir():
        return ()
    if relative:
        return tuple(name for name in DISTRIBUTIONS if find_definition(folder, name, relative))
    return tuple(name for name in DISTRIBUTIONS if has_definitions(folder, name))


def distribution_hint(package: str, rosdistro: str, relative: str = "") -> str | None:
    """Return a hint that names the distributions with what `rosdistro` lacks, None if there are none."""
    distributions = distributions_with(package, relative)
    if not distributions or rosdistro in distributions:
        return None
    name = f"{package}/{relative.rpartition('/')[2].partition('.')[0]}" if relative else package
    if distributions[0] == OLDEST:
        span = f"up to {distributions[-1].capitalize()}"
    else:
        span = f"in {distributions[0].capitalize()}" + (
            " and later" if distributions[-1] == DISTRIBUTIONS[-1] else ""
        )
    nearest = distributions[-1] if distributions[0] == OLDEST else distributions[0]
    return f"'{name}' exists {span}, this workspace is for {rosdistro.capitalize()}: --rosdistro {nearest}"
