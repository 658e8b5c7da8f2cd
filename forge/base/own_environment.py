"""Suggests commands that install further Python packages beside forge, with the tool that installed forge."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from forge.base.files import text_or_nothing
from forge.base.formats import read_toml

_NAME = "ros-forge"
_UV_RECEIPT = "uv-receipt.toml"
_PIPX_METADATA = "pipx_metadata.json"


def extra_command(extra: str) -> str:
    """Return the shell command that installs the packages of an extra beside forge."""
    from importlib.metadata import PackageNotFoundError, requires

    from packaging.requirements import Requirement

    try:
        declared = [Requirement(text) for text in requires(_NAME) or ()]
    except PackageNotFoundError:
        return install_beside_forge(f"{_NAME}[{extra}]")
    of_extra = (
        each
        for each in declared
        if each.marker and each.marker.evaluate({"extra": extra}) and not each.marker.evaluate({"extra": ""})
    )
    return install_beside_forge(*(f"{each.name}{each.specifier}" for each in of_extra))


def install_beside_forge(*requirements: str, prefix: Path | None = None) -> str:
    """Return the shell command that installs packages into forge's own environment, by default `sys.prefix`.

    `uv tool install` discards the requirements and extras of earlier runs, so the command repeats them.
    """
    own = prefix or Path(sys.prefix)
    if (own / _UV_RECEIPT).is_file():
        receipt = own / _UV_RECEIPT
        entries = read_toml(receipt.read_bytes(), receipt).get("tool", {}).get("requirements", [])
        earlier = [_uv_requirement(entry) for entry in entries if entry.get("name") != _NAME]
        words = ["uv", "tool", "install"]
        for requirement in dict.fromkeys((*earlier, *requirements)):
            words += ("--with", requirement)
        for entry in (entry for entry in entries if entry.get("name") == _NAME):
            words += (*(("--editable",) if "editable" in entry else ()), _uv_requirement(entry))
    elif (own / _PIPX_METADATA).is_file():
        words = ["pipx", "inject", own.name, *requirements]
    elif has_no_pip(own):
        words = ["uv", "pip", "install", "--python", sys.executable, *requirements]
    else:
        words = [sys.executable, "-m", "pip", "install", *requirements]
    return shlex.join(words)


def has_no_pip(environment: Path) -> bool:
    """Return whether a virtual environment was created by uv, without pip."""
    by_uv = any(line.startswith("uv =") for line in text_or_nothing(environment / "pyvenv.cfg").splitlines())
    return by_uv and not any(environment.glob("lib/python*/site-packages/pip"))


def _uv_requirement(entry: Mapping[str, Any]) -> str:
    extras = f"[{','.join(entry['extras'])}]" if entry.get("extras") else ""
    path = next((entry[kind] for kind in ("editable", "directory", "path") if kind in entry), None)
    if path is not None:
        return f"{path}{extras}"
    name = f"{entry['name']}{extras}"
    if "git" in entry:
        url, _, revision = entry["git"].partition("?rev=")
        return f"{name} @ git+{url}{'@' if revision else ''}{revision}"
    if "url" in entry:
        return f"{name} @ {entry['url']}"
    return f"{name}{entry.get('specifier', '')}"
