"""Install trees as shell text: setup, local_setup and package scripts for sh, bash and zsh, pure.

The scripts are static: what the packages' dsv files say is settled when they are written, so that
sourcing a workspace starts no program, and has few and long lines instead of many files to read.
"""

from __future__ import annotations

import re
import shlex
from typing import TYPE_CHECKING

from forge.environment import Edit, Script
from forge.templating import render

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from forge.environment import Installed

    Statement = dict[str, object]
    """A paragraph of a script: its template, and finished words for it."""

SHELLS = ("sh", "bash", "zsh")

_SPECIAL = re.compile(r'[\\"$`]')
_FOR_HOOKS = {
    "present": ("_forge_present",),
    "ament": ("ament_append_value", "ament_append_unique_value", "ament_prepend_unique_value"),
}
"""The functions that sourcing a package's scripts takes, by their template."""


def setup(shell: str, root: Path, underlays: Sequence[Path]) -> str:
    """Return the script that sources the scripts `underlays`, lowest first, and its own local_setup."""
    variable = "_forge_setup_root"
    statements = [_underlay(script) for script in underlays]
    own = _sourced("This workspace.", f"${variable}", f"local_setup.{shell}")
    return render(
        "scripts/setup.j2",
        shell=shell,
        present="_forge_setup_present",
        options="_forge_setup_options",
        statements=[*statements, own],
        **_location("setup", shell, variable, root),
    )


def local_setup(shell: str, root: Path, packages: Sequence[Installed]) -> str:
    """Return the script that adds the packages of one install tree; `packages` come lowest first.

    All paths in it are relative to the script's own place; only plain sh, which cannot know that,
    falls back to `root`.
    """
    edits = [(package, edit) for package in packages for edit in package.edits]
    words = _words(edit for _, edit in edits)
    parts = {"select": ("_forge_select", "_forge_prepend"), "unique": ("_forge_first",)}
    if words["appending"]:
        parts["append"] = ("_forge_append",)
    if words["sourcing"]:
        parts |= _FOR_HOOKS
    isolated = [package for package in packages if package.folder]
    return render(
        "scripts/local_setup.j2",
        shell=shell,
        names=sorted(package.name for package in isolated),
        marker=_marker("$_forge_root/$_forge_name", "$_forge_name"),
        functions=[f"scripts/{part}.sh.j2" for part in parts],
        function="_forge_first",
        function_names=[" ".join(names) for names in parts.values() if names],
        statements=[s for group in _groups(edits) if (s := _group_statement(shell, group))],
        **words,
        **_location("local_setup", shell, "_forge_root", root),
    )


def package_setup(shell: str, prefix: Path, package: Installed) -> str:
    """Return the script that adds one package alone and puts its entries before all others."""
    words = _words(package.edits)
    parts: dict[str, tuple[str, ...]] = {"unique": ()}  # the one function that stays: others' hooks call it
    if words["appending"]:
        parts["unique_append"] = ("_forge_append",)
    if words["sourcing"]:
        parts |= _FOR_HOOKS
    return render(
        "scripts/package.j2",
        shell=shell,
        name=package.name,
        functions=[f"scripts/{part}.sh.j2" for part in parts],
        function="_colcon_prepend_unique_value",
        function_names=[" ".join(names) for names in parts.values() if names],
        statements=[s for edit in package.edits if (s := _edit_statement(shell, package, edit))],
        **words,
        **_location("package", shell, "_forge_prefix", prefix),
    )


def dsv(lines: Sequence[str]) -> str:
    """Return the text of a dsv file."""
    return render("scripts/dsv.j2", lines=lines)


def hook_runner() -> str:
    """Return a sh script that sources the hook `$1` and prints the environment, separated by NUL."""
    return render("scripts/run_hook.sh.j2", function="_colcon_prepend_unique_value")


def quoted(text: str) -> str:
    """Return `text` as it stands between the double quotes of any of the shells."""
    return _SPECIAL.sub(r"\\\g<0>", text)


def _words(edits: Iterable[Edit | Script]) -> dict[str, object]:
    """Return which functions the edits take, and how they are called."""
    listed = list(edits)
    return {
        "appending": any(isinstance(edit, Edit) and edit.operation == "append" for edit in listed),
        "sourcing": any(isinstance(edit, Script) for edit in listed),
        "append": "_forge_append",
        "present": "_forge_present",
        "options": "_forge_options",
    }


def _location(script: str, shell: str, variable: str, baked: Path) -> dict[str, object]:
    """Return the words with which a script finds the root of its tree, or the prefix of its package."""
    up = 2 if script == "package" else 0
    return {
        "locate": f"scripts/locate.{shell}.j2",
        "file": f"{script}.{shell}",
        "variable": variable,
        "baked": shlex.quote(str(baked)),
        "up": {"path": "../" * up, "heads": ":h" * up},
    }


def _groups(edits: Sequence[tuple[Installed, Edit | Script]]) -> list[list[tuple[Installed, Edit | Script]]]:
    """Gather edits that one statement can make, without changing what they come to.

    Edits of different variables never disturb each other, so those of one variable are gathered
    until the operation changes; a script may look at every variable, so nothing passes it.
    """
    groups: list[list[tuple[Installed, Edit | Script]]] = []
    latest: dict[str, list[tuple[Installed, Edit | Script]]] = {}
    for package, edit in edits:
        if isinstance(edit, Script):
            latest.clear()
            groups.append([(package, edit)])
            continue
        group = latest.get(edit.variable)
        if group is None or not _joins(group[-1][1], edit):
            group = latest[edit.variable] = []
            groups.append(group)
        group.append((package, edit))
    return groups


def _joins(before: Edit | Script, edit: Edit) -> bool:
    """Tell if two edits of one variable fit in one statement: entries below the root do."""
    if isinstance(before, Script) or before.operation != edit.operation:
        return False
    return edit.operation in {"prepend", "append"} and before.below and edit.below


def _group_statement(shell: str, group: list[tuple[Installed, Edit | Script]]) -> Statement | None:
    """Return the statement of a local_setup script for a group of edits."""
    package, first = group[0]
    root = f"$_forge_root/{quoted(package.folder)}".rstrip("/")
    if isinstance(first, Script):
        return _script(shell, package.name, first, root)
    if first.operation in {"set", "default"}:
        return _assignment(first, root, f'[ -e "{_marker(root, package.name)}" ]')
    # Each entry once: what is there already stays where it is, so a second one would do nothing.
    entries = list(
        dict.fromkeys(_entry("$_forge_root", p.folder, e) for p, e in group if isinstance(e, Edit))
    )
    if first.operation == "prepend":
        entries.reverse()
    return {
        "template": "scripts/entry.sh.j2",
        "function": f"_forge_{first.operation}",
        "variable": first.variable,
        # One entry a line, where there are several.
        "entry": entries[0] if len(entries) == 1 else "\\\n" + ":\\\n".join(entries),
    }


def _edit_statement(shell: str, package: Installed, edit: Edit | Script) -> Statement | None:
    """Return the statement of a package script for one edit."""
    if isinstance(edit, Script):
        return _script(shell, package.name, edit, "$_forge_prefix")
    if edit.operation in {"set", "default"}:
        return _assignment(edit, "$_forge_prefix", "")
    return {
        "template": "scripts/entry.sh.j2",
        "function": "_forge_append" if edit.operation == "append" else "_colcon_prepend_unique_value",
        "variable": edit.variable,
        "entry": _entry("$_forge_prefix", "", edit),
    }


def _entry(root: str, folder: str, edit: Edit) -> str:
    """Return one entry of a list, ready for double quotes."""
    if not edit.below:
        return quoted(edit.value)
    return "/".join([root, *(quoted(part) for part in (folder, edit.value) if part)])


def _assignment(edit: Edit, prefix: str, installed: str) -> Statement:
    """Return the statement that sets a variable: always, or where it says nothing."""
    unset = f'[ -z "${{{edit.variable}-}}" ]' if edit.operation == "default" else ""
    return {
        "template": "scripts/set.sh.j2",
        "variable": edit.variable,
        "value": _entry(prefix, "", edit),
        "condition": " && ".join(filter(None, [installed, unset])),
    }


def _script(shell: str, name: str, script: Script, prefix: str) -> Statement | None:
    """Return the statement that sources a hook, or None when it is not for this shell."""
    path = script.path(shell)
    if path is None:
        return None
    statement = _sourced(f"A hook of '{name}'.", prefix, quoted(path))
    return statement | {"prefix_variables": ("COLCON_CURRENT_PREFIX", "AMENT_CURRENT_PREFIX")}


def _underlay(script: Path) -> Statement:
    """Return the statement that sources the script of an underlay."""
    return _sourced(f"The workspace {script.parent}.", quoted(str(script.parent)), script.name)


def _sourced(comment: str, prefix: str, path: str) -> Statement:
    """Return the statement that sources a script, which may ask for its prefix."""
    return {
        "template": "scripts/source.sh.j2",
        "comment": comment,
        "prefix": prefix,
        "file": path if path.startswith("/") else f"{prefix}/{path}",
        "prefix_variables": ("COLCON_CURRENT_PREFIX",),
    }


def _marker(prefix: str, name: str) -> str:
    """Return the file that is there as long as package `name` is installed."""
    return f"{prefix}/share/colcon-core/packages/{name}"
