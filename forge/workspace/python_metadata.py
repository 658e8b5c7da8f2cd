"""Reads literals in setup.cfg, setup.py, whose syntax tree is parsed, and pyproject.toml; none is run."""

from __future__ import annotations

import ast
import configparser
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields
from typing import Any

from forge.base.frozen import frozen
from forge.workspace.model import Dependency, DependencyKind, Person

_REQUIREMENT = re.compile(r"\s*([A-Za-z0-9][A-Za-z0-9._-]*)")
_ASKED = re.compile(r"(~=(?=\s*\d+\.)|==|!=|<=|>=|<|>)\s*(\d{1,18}(?:\.\d{1,18})*)(?![\w.*+!-])")
_SYMBOLS = {"==": "eq", "!=": "neq", "<=": "lte", ">=": "gte", "<": "lt", ">": "gt"}
_TEST_EXTRAS = ("test", "tests", "testing")
_KINDS = {
    "setup_requires": frozenset({DependencyKind.BUILD}),
    "install_requires": frozenset({DependencyKind.EXEC}),
    "tests_require": frozenset({DependencyKind.TEST}),
}


@frozen
class PythonMetadata:
    """The metadata of a package; `name` is None without a literal."""

    name: str | None = None
    version: str = ""
    dependencies: tuple[Dependency, ...] = ()
    maintainers: tuple[Person, ...] = ()
    requirements: tuple[str, ...] = ()
    """Runtime requirements as written (PEP 508)."""

    def over(self, below: PythonMetadata) -> PythonMetadata:
        """Return this metadata with missing values taken from another."""
        names = (each.name for each in fields(self))
        return PythonMetadata(*(getattr(self, name) or getattr(below, name) for name in names))


class _Parser(configparser.RawConfigParser):
    """Stops at the first invalid line: collecting all errors takes quadratic time."""

    def _handle_error(self, _: object, fpname: str, lineno: int, line: str) -> None:
        error = configparser.ParsingError(fpname)
        error.append(lineno, line)
        raise error


def read_setup_cfg(text: str) -> PythonMetadata:
    """Return the contents of the sections metadata and options; empty if the file is malformed."""
    parser = _Parser()
    try:
        parser.read_string(text)
    except configparser.Error:
        return PythonMetadata()
    metadata = dict(parser["metadata"]) if parser.has_section("metadata") else {}
    options = dict(parser["options"]) if parser.has_section("options") else {}
    extras = "options.extras_require"
    extra = dict(parser[extras]) if parser.has_section(extras) else {}
    values: dict[str, Any] = {key: _listed(options.get(key, "")) for key in _KINDS}
    values["extras_require"] = {key: _listed(value) for key, value in extra.items()}
    for key in ("name", "version", "maintainer", "maintainer_email", "author", "author_email"):
        value = metadata.get(key) or metadata.get(key.replace("_", "-"))
        # 'attr: module.value' would require running the module.
        if value and not value.startswith(("attr:", "file:")):
            values[key] = value
    return _facts(values)


def read_setup_py(text: str) -> PythonMetadata | None:
    """Return the arguments of setup(), None without a call; raises SyntaxError like Python."""
    tree = ast.parse(text)
    for call in ast.walk(tree):
        match call:
            case ast.Call(func=ast.Name(id="setup") | ast.Attribute(attr="setup")):
                break
    else:
        return None
    names: dict[str, object] = {}
    for node in tree.body:
        match node:
            case (
                ast.Assign(targets=[ast.Name(id=name)], value=value)
                | ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value)
            ):
                names[name] = _literal(value, {})
    values = {word.arg: _literal(word.value, names) for word in call.keywords if word.arg}
    return _facts({key: value for key, value in values.items() if value is not None})


def read_pyproject(table: Mapping[str, Any]) -> PythonMetadata | None:
    """Return the project metadata of a pyproject.toml, None if it only configures tools (PEP 621)."""
    project = table.get("project")
    if not isinstance(project, dict):
        poetry = _below(_below(table, "tool"), "poetry")
        if isinstance(poetry.get("name"), str):
            return PythonMetadata(poetry["name"], str(poetry.get("version", "")))
        return None
    values: dict[str, Any] = {
        "name": project.get("name"),
        "version": project.get("version", ""),
        "setup_requires": _below(table, "build-system").get("requires", []),
        "install_requires": project.get("dependencies", []),
        "extras_require": project.get("optional-dependencies", {}),
    }
    people = project.get("maintainers") or project.get("authors") or []
    persons = tuple(
        Person(str(person.get("name", "")), person["email"])
        for person in (people if isinstance(people, list) else ())
        if isinstance(person, dict) and person.get("email") and isinstance(person["email"], str)
    )
    return PythonMetadata(maintainers=persons).over(_facts(values))


def _below(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = table.get(key)
    return value if isinstance(value, dict) else {}


def _facts(values: Mapping[str, Any]) -> PythonMetadata:
    """Convert setuptools' arguments; values of unexpected types are ignored."""
    name, version, extras = values.get("name"), values.get("version", ""), values.get("extras_require", {})
    lists = [(values.get(key, ()), kinds) for key, kinds in _KINDS.items()]
    if isinstance(extras, dict):
        lists += ((extras.get(extra, ()), _KINDS["tests_require"]) for extra in _TEST_EXTRAS)
    dependencies = [
        Dependency(required, kinds, versions)
        for requirements, kinds in lists
        for required, versions in _required(requirements)
    ]
    role = "maintainer" if "maintainer" in values else "author"
    names, emails = values.get(role), values.get(f"{role}_email")
    people: tuple[Person, ...] = ()
    if isinstance(names, str) and isinstance(emails, str):
        pairs = zip(names.split(","), emails.split(","), strict=False)
        people = tuple(Person(person.strip(), email.strip()) for person, email in pairs)
    return PythonMetadata(
        name if isinstance(name, str) and name else None,
        version if isinstance(version, str) else "",
        tuple(dependencies),
        people,
        tuple(_lines(values.get("install_requires", ()))),
    )


def _required(requirements: object) -> Iterator[tuple[str, tuple[tuple[str, str], ...]]]:
    """Yield name and versions of requirements such as 'name[extra]>=1; marker' (PEP 508)."""
    for line in _lines(requirements):
        if match := _REQUIREMENT.match(line):
            rest = line[match.end() :].partition(";")[0].partition(" #")[0]
            yield match[1], tuple(_versions(rest))


def _lines(requirements: object) -> Iterator[str]:
    lines = requirements.splitlines() if isinstance(requirements, str) else requirements
    yield from (each for each in lines if isinstance(each, str)) if isinstance(lines, list | tuple) else ()


def _versions(specifier: str) -> Iterator[tuple[str, str]]:
    """Yield the version constraints of a requirement as package.xml attributes; wildcards are ignored."""
    for symbol, version in _ASKED.findall(specifier):
        if symbol == "~=":
            yield "gte", version
            *leading, last, _ = map(int, version.split("."))
            yield "lt", ".".join(map(str, (*leading, last + 1)))
        else:
            yield _SYMBOLS[symbol], version


def _listed(value: str) -> list[str]:
    """Parse a setuptools list: one entry per line, or separated by semicolons on one line."""
    entries: Iterable[str] = value.splitlines() if "\n" in value else value.split(";")
    return [entry for raw in entries if (entry := raw.partition(" #")[0].strip()) and entry[0] != "#"]


def _literal(node: ast.expr, names: Mapping[str, object]) -> object:
    """Return the value of a literal, or of a name bound to one; None for anything else."""
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.List | ast.Tuple):
        values = [_literal(element, names) for element in node.elts]
        return [value for value in values if value is not None]
    try:
        return ast.literal_eval(node)
    except (ValueError, TypeError, MemoryError, RecursionError):
        return None
