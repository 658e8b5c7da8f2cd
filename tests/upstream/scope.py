"""Which packages of a workspace are measured: those that generate interfaces and need no client library."""

import re
from pathlib import Path

from forge.workspace.discovery import discover
from forge.workspace.model import Package

_GENERATES = re.compile(r"^\s*rosidl_generate_interfaces\s*\(", re.MULTILINE)
_CLIENT = re.compile(r"^\s*find_package\s*\(\s*(rclcpp|rclpy|rcl|rmw)\b", re.MULTILINE)


def interface_packages(workspace: Path, distribution: str) -> dict[Path, list[str]]:
    """Return the names of the interface packages by the checkout OWNER+NAME that they are in."""
    found: dict[Path, list[str]] = {}
    for name, package in discover(workspace, ["src"], {"ROS_DISTRO": distribution}).packages.items():
        folder = (workspace / package.path).resolve()
        checkout = next((path for path in (folder, *folder.parents) if "+" in path.name), None)
        if checkout and is_interface_package(workspace, package):
            found.setdefault(checkout, []).append(name)
    return {checkout: sorted(found[checkout]) for checkout in sorted(found)}


def is_interface_package(workspace: Path, package: Package) -> bool:
    """Tell whether a package generates interfaces with ament and CMake asks for no client library.

    Many packages name one in package.xml and do without it.
    """
    path = workspace / package.path / "CMakeLists.txt"
    script = path.read_text(encoding="utf-8") if path.is_file() else ""
    return (
        package.build_type == "ament_cmake" and bool(_GENERATES.search(script)) and not _CLIENT.search(script)
    )
