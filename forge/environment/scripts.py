"""Generates setup scripts for each shell; dsv files are evaluated then, and sourcing starts no program."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

from forge.base.templating import render
from forge.environment.dsv import Edit, PackageEdits, Script
from forge.environment.shells import SHELLS, Shell

Statement = dict[str, object]
"""A paragraph of a script: its template, and the template's values."""

Group = list[tuple[PackageEdits, Edit | Script]]
"""The edits of one statement."""

_ASSIGNING = frozenset({"set", "default"})


def setup(name: str, root: Path, underlays: Sequence[Path]) -> str:
    """Return the script that sources the scripts `underlays`, lowest first, and its own local_setup."""
    shell = SHELLS[name]
    sourced = [
        _sourced(shell, f"The workspace {script.parent}.", shell.quoted(str(script.parent)), script.name)
        for script in underlays
    ]
    own = _sourced(shell, "This workspace.", "$_forge_setup_root", f"local_setup.{name}")
    borrowing = any(shell.runs_in_sh(script.name) for script in underlays)
    return render(
        f"scripts/{shell.family}/setup.j2",
        statements=[*sourced, own],
        present="_forge_setup_present",
        options="_forge_setup_options",
        borrowed="_forge_setup_sh",
        borrowing=borrowing,
        runner=_runner() if borrowing else "",
        **_location("setup", shell, "_forge_setup_root", root),
    )


def local_setup(name: str, root: Path, packages: Sequence[PackageEdits]) -> str:
    """Return the script that adds an install tree; plain sh, which cannot find the script, uses `root`."""
    shell = SHELLS[name]
    edits = [(package, edit) for package in packages for edit in package.edits]
    return render(
        f"scripts/{shell.family}/local_setup.j2",
        names=sorted(package.name for package in packages if package.folder),
        marker=_marker("$_forge_root/$_forge_name", "$_forge_name"),
        select=f"scripts/sh/select.{name}.j2",
        function="_forge_first",
        statements=[s for group in _groups(edits) if (s := _group_statement(shell, group))],
        **_words(shell, (edit for _, edit in edits)),
        **_location("local_setup", shell, "_forge_root", root),
    )


def package_setup(name: str, prefix: Path, package: PackageEdits) -> str:
    """Return the script that adds a single package with its entries first."""
    shell = SHELLS[name]
    return render(
        f"scripts/{shell.family}/package.j2",
        name=package.name,
        function="_colcon_prepend_unique_value",  # hooks of packages of other tools call it
        statements=[
            statement
            for edit in package.edits
            if (statement := _statement(shell, package, edit, "$_forge_prefix", in_workspace=False))
        ],
        **_words(shell, package.edits),
        **_location("package", shell, "_forge_prefix", prefix),
    )


def render_dsv(lines: Sequence[str]) -> str:
    return render("scripts/dsv.j2", lines=lines)


def hook_runner() -> str:
    """Return a sh script that sources the hook `$1` and prints the environment before NUL and after it."""
    return render("scripts/sh/run_hook.j2", function="_colcon_prepend_unique_value")


def _words(shell: Shell, edits: Iterable[Edit | Script]) -> dict[str, object]:
    all_edits = list(edits)
    paths = [edit.path(shell.name) for edit in all_edits if isinstance(edit, Script)]
    borrowing = any(path and shell.runs_in_sh(path) for path in paths)
    return {
        "appending": any(isinstance(edit, Edit) and edit.operation == "append" for edit in all_edits),
        "sourcing": any(paths),
        "borrowing": borrowing,
        "runner": _runner() if borrowing else "",
        "present": "_forge_present",
        "options": "_forge_options",
        "borrowed": "_forge_sh",
    }


def _runner() -> str:
    """Return the sh program that sources a hook, escaped for fish's single quotes."""
    return re.sub(r"\\(?=[\\']|$)|'", r"\\\g<0>", hook_runner().rstrip("\n"))


def _location(script: str, shell: Shell, variable: str, baked: Path) -> dict[str, object]:
    up = 2 if script == "package" else 0
    pattern = f"(/[^/]*){{{up + 1}}}$" if up else "/[^/]*$"
    return {
        "shell": shell.name,
        "locate": f"scripts/{shell.family}/locate{shell.own}.j2",
        "script": script,
        "file": f"{script}.{shell.name}",
        "variable": variable,
        "baked": shlex.quote(str(baked)),
        "up": {"path": "../" * up, "heads": ":h" * up, "pattern": pattern},
    }


def _groups(edits: Sequence[tuple[PackageEdits, Edit | Script]]) -> list[Group]:
    """Group edits into statements without changing their effect.

    Edits of different variables are independent. Edits of one variable fit in one statement if they have the
    same operation and are paths below the root, or duplicates. Scripts may read any variable, so nothing is
    moved across them.
    """
    groups: list[Group] = []
    latest: dict[str, Group] = {}
    for package, edit in edits:
        if isinstance(edit, Script):
            latest.clear()
            groups.append([(package, edit)])
            continue
        group = latest.get(edit.variable)
        joins = False
        if group is not None:
            last_package, last = group[-1]
            joins = isinstance(last, Edit) and last.operation == edit.operation
            if last == edit and last_package.folder == package.folder:
                joins = joins and edit.operation in {"prepend", "append"}
            else:
                joins = joins and bool(_below(last_package.folder, last) and _below(package.folder, edit))
        if group is None or not joins:
            group = latest[edit.variable] = []
            groups.append(group)
        group.append((package, edit))
    return groups


def _below(folder: str, edit: Edit | Script) -> str:
    """Return the path to add to a list, relative to the root; '' if there is none."""
    if isinstance(edit, Script) or not edit.below or edit.operation in _ASSIGNING or ":" in edit.value:
        return ""
    return "/".join(filter(None, (folder, edit.value)))


def _group_statement(shell: Shell, group: Group) -> Statement | None:
    package, first = group[0]
    paths = [_below(package.folder, edit) for package, edit in group]
    if isinstance(first, Script) or not all(paths):
        root = f"$_forge_root/{shell.quoted(package.folder)}".rstrip("/")
        return _statement(shell, package, first, root, in_workspace=True)
    # Omit duplicates: they would have no effect.
    entries = [f"{shell.list_root}{shell.quoted(path)}" for path in dict.fromkeys(paths)]
    if first.operation == "prepend":
        entries.reverse()
    return _entries(shell, first, f"_forge_{first.operation}", entries, "")


def _statement(
    shell: Shell, package: PackageEdits, edit: Edit | Script, prefix: str, *, in_workspace: bool
) -> Statement | None:
    """Return the statement of one edit, None for other shells; `in_workspace` depends on the package."""
    if isinstance(edit, Script):
        path = edit.path(shell.name)
        if path is None:
            return None
        statement = _sourced(shell, f"A hook of '{package.name}'.", prefix, shell.quoted(path))
        return statement | {"prefix_variables": ("COLCON_CURRENT_PREFIX", "AMENT_CURRENT_PREFIX")}
    value = shell.quoted(edit.value)
    if edit.below:
        value = "/".join(filter(None, (prefix, value)))
    marker = _marker(prefix, package.name) if in_workspace else ""
    if edit.operation in _ASSIGNING:
        return {
            "template": f"scripts/{shell.family}/set.j2",
            "variable": edit.variable,
            "value": value,
            "installed": marker,
            "default": edit.operation == "default",
        }
    function = f"_forge_{edit.operation}"
    if edit.operation == "prepend" and not in_workspace:
        function = "_colcon_prepend_unique_value"
    return _entries(shell, edit, function, [value], marker if package.folder else "")


def _entries(shell: Shell, edit: Edit, function: str, entries: list[str], installed: str) -> Statement:
    return {
        "template": f"scripts/{shell.family}/entry.j2",
        "function": function,
        "variable": edit.variable,
        "entries": entries,
        "installed": installed,
    }


def _sourced(shell: Shell, comment: str, prefix: str, path: str) -> Statement:
    return {
        "template": f"scripts/{shell.family}/{'borrow' if shell.runs_in_sh(path) else 'source'}.j2",
        "comment": "".join(sign if sign.isprintable() else "?" for sign in comment),
        "prefix": prefix,
        "file": path if path.startswith("/") else f"{prefix}/{path}",
        "prefix_variables": ("COLCON_CURRENT_PREFIX",),
    }


def _marker(prefix: str, name: str) -> str:
    return f"{prefix}/share/colcon-core/packages/{name}"
