"""Find the prefixes and share folders of packages."""

from __future__ import annotations

from pathlib import Path

from ament_index_python.resources import InvalidResourceNameError, get_resources, has_resource
from ament_index_python.search_paths import get_search_paths


class PackageNotFoundError(KeyError):
    """No prefix in AMENT_PREFIX_PATH contains the package."""

    def __str__(self) -> str:
        """Return the message, which KeyError would quote."""
        return str(self.args[0]) if self.args else ""


def get_packages_with_prefixes() -> dict[str, str]:
    """Return the prefix of each installed package."""
    return get_resources("packages")


def get_package_prefix(package_name: str) -> str:
    """Return the install prefix of a package.

    Raises PackageNotFoundError if the package is not found, and ValueError if its name is invalid.
    """
    if not package_name:
        raise ValueError("The package name must not be empty")
    try:
        prefix = has_resource("packages", package_name)
    except InvalidResourceNameError as error:
        raise ValueError(f"'{package_name}' is not a valid package name") from error
    if not prefix:
        searched = get_search_paths()
        raise PackageNotFoundError(f"package '{package_name}' not found, searching: {searched}")
    return prefix


def get_package_share_directory(package_name: str, print_warning: bool = True) -> str:
    """Return the share folder of a package, and warn if it is missing; raises as `get_package_prefix`."""
    path = Path(get_package_prefix(package_name), "share", package_name)
    if print_warning and not path.is_dir():
        import warnings

        warnings.warn(f"share directory of '{package_name}' ({path}) does not exist", stacklevel=2)
    return str(path)


def get_package_share_path(package_name: str, print_warning: bool = True) -> Path:
    """Return the share folder of a package as a path; raises as `get_package_prefix`."""
    return Path(get_package_share_directory(package_name, print_warning))
