"""Explains why a package lacks an executable."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Sequence
from pathlib import Path

from forge.base.files import names_in, text_or_nothing
from forge.base.names import did_you_mean

_BUILD_TYPE = re.compile(r"<build_type[^>]*>\s*(\w+)\s*</build_type>")


def missing_executable_hint(package: str, name: str, prefix: Path, paths: Sequence[Path]) -> str:
    """Return a hint on how to make `name` available; `paths` are the package's executables."""
    folder = prefix / "lib" / package
    plain = next((path for path in folder.rglob("*") if path.name == name and path.is_file()), None)
    if plain is not None:
        command = f"chmod +x {shlex.quote(str(plain))}"
        return f"the file exists, but is not executable: use install(PROGRAMS ...), or {command}"
    match = _BUILD_TYPE.search(text_or_nothing(prefix / "share" / package / "package.xml"))
    build_type = match[1] if match else ""
    others = (prefix / "bin" / name, *sorted(prefix.glob(f"lib/*/{name}")))
    elsewhere = next((path for path in others if os.access(path, os.X_OK)), None)
    if elsewhere is not None:
        python = build_type == "ament_python"
        line = f"install_scripts=$base/lib/{package}" if python else "DESTINATION lib/${PROJECT_NAME}"
        where = "below [install] in its setup.cfg" if python else "in install() in its CMakeLists.txt"
        start = f"start it with 'forge shell -- {name}', or " if elsewhere == others[0] else ""
        return f"it is in '{elsewhere.parent}' instead of lib/{package}: {start}write {line} {where}"
    launch_files = (prefix / "share" / package).rglob("*launch*")
    if any(name in {path.name, *names_in(path)} for path in launch_files):
        return f"to launch it: forge shell -- ros2 launch {package} {name}"
    near = did_you_mean(name, (path.name for path in paths))
    if near:
        return near
    if paths:
        return f"'forge pkg executables {package}' lists all executables"
    message = f"package '{package}' has no executables in '{folder}'"
    if build_type == "ament_python":
        return f"{message}: add it to 'console_scripts' in its setup.py, and build again"
    if build_type == "ament_cmake":
        line = f"install(TARGETS {name} DESTINATION lib/${{PROJECT_NAME}})"
        return f"{message}: add {line} to its CMakeLists.txt, and build again"
    return message
