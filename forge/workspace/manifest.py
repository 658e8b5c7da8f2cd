"""Parses package.xml formats 1, 2 and 3 (REP 127, 140, 149) into a Manifest, with all errors at once."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from forge.base.errors import ForeignManifestError, Location, Problem, WorkspaceError, raise_if_any
from forge.base.frozen import frozen
from forge.base.names import did_you_mean, is_email, is_package_name, is_safe_name
from forge.base.xml import Element, parse_xml
from forge.workspace.model import Dependency, DependencyKind, Export, Manifest, Person

DEPENDENCY_KINDS: dict[str, frozenset[DependencyKind]] = {
    "build_depend": frozenset({DependencyKind.BUILD}),
    "buildtool_depend": frozenset({DependencyKind.BUILDTOOL}),
    "build_export_depend": frozenset({DependencyKind.BUILD_EXPORT}),
    "buildtool_export_depend": frozenset({DependencyKind.BUILDTOOL_EXPORT}),
    "exec_depend": frozenset({DependencyKind.EXEC}),
    "depend": frozenset({DependencyKind.BUILD, DependencyKind.BUILD_EXPORT, DependencyKind.EXEC}),
    "run_depend": frozenset({DependencyKind.BUILD_EXPORT, DependencyKind.EXEC}),
    "test_depend": frozenset({DependencyKind.TEST}),
    "doc_depend": frozenset({DependencyKind.DOC}),
}
VERSION_WORDS = ("lt", "lte", "eq", "gte", "gt")

_USUAL_NAME = re.compile(r"[a-z][a-z0-9_-]*")
_VERSION = re.compile(r"\d+\.\d+\.\d+", re.ASCII)
_VERSIONED = frozenset(f"version_{word}" for word in VERSION_WORDS)


@frozen
class _Tag:
    """Constraints on a child of <package>, according to the REP of its format."""

    formats: frozenset[int] = frozenset({1, 2, 3})
    least: int = 0
    most: int = 10**6
    attributes: frozenset[str] = frozenset()
    nested: bool = False


_LATER = frozenset({2, 3})
_TAGS: dict[str, _Tag] = {
    "name": _Tag(least=1, most=1),
    "version": _Tag(least=1, most=1, attributes=frozenset({"compatibility"})),
    "description": _Tag(least=1, most=1, nested=True),
    "maintainer": _Tag(least=1, attributes=frozenset({"email"})),
    "license": _Tag(least=1),
    "url": _Tag(attributes=frozenset({"type"})),
    "author": _Tag(attributes=frozenset({"email"})),
    **dict.fromkeys(
        ("build_depend", "buildtool_depend", "test_depend", "conflict", "replace"),
        _Tag(attributes=_VERSIONED),
    ),
    "run_depend": _Tag(frozenset({1}), attributes=_VERSIONED),
    **dict.fromkeys(
        ("build_export_depend", "buildtool_export_depend", "exec_depend", "depend", "doc_depend"),
        _Tag(_LATER, attributes=_VERSIONED),
    ),
    "group_depend": _Tag(frozenset({3})),
    "member_of_group": _Tag(frozenset({3})),
    "export": _Tag(most=1, nested=True),
}
_CONDITIONAL = frozenset({*DEPENDENCY_KINDS, "conflict", "replace", "group_depend", "member_of_group"})
_HINTS = {"run_depend": "use <exec_depend>", "exec_depend": 'use <run_depend>, or format="3"'}
_LICENSE_3 = frozenset({"file", "type", "source-files"})


def parse_manifest(content: bytes, path: Path, variables: Mapping[str, str]) -> Manifest:
    """Return the manifest with its conditions evaluated under `variables`.

    Raises WorkspaceError with all structural or else all semantic errors, ForeignManifestError if the
    document also declares a namespace, as PEAR's files do.
    """
    root = parse_xml(content, path)
    try:
        return _Reader(root, path, variables).read()
    except WorkspaceError as error:
        if namespace := root.attributes.get("xmlns"):
            message = f"the file is not a manifest of ROS, but belongs to '{namespace}'; it is ignored"
            raise ForeignManifestError(Problem(message, Location(path))) from error
        raise


def declaration(path: Path, name: str) -> Location:
    """Return the position at which a manifest first declares a dependency, else the manifest."""
    try:
        children = parse_xml(path.read_bytes(), path).children
    except (OSError, WorkspaceError):
        return Location(path)
    tags = (child for child in children if child.tag in DEPENDENCY_KINDS and child.text.strip() == name)
    element = next(tags, None)
    return element.place(path) if element else Location(path)


def tags_of(manifest_format: int) -> tuple[str, ...]:
    """Return the elements that <package> may contain."""
    return tuple(name for name, tag in _TAGS.items() if manifest_format in tag.formats)


class _Reader:
    def __init__(self, root: Element, path: Path, variables: Mapping[str, str]) -> None:
        self.root = root
        self.path = path
        self.variables = variables
        self.format = 1
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []

    def read(self) -> Manifest:
        written = self.root.attributes.get("format", "1")
        if self.root.tag != "package":
            self.fault(self.root, f"the root element is '{self.root.tag}', not 'package'")
        elif written not in {"1", "2", "3"}:
            self.fault(self.root, f"unknown package format '{written}'", 'write <package format="3">')
        raise_if_any(self.problems, WorkspaceError)
        self.format = int(written)
        self.check_structure()
        self.check_texts()
        raise_if_any(self.problems, WorkspaceError)
        manifest = self.manifest()
        self.check_meaning(manifest)
        raise_if_any(self.problems, WorkspaceError)
        return manifest

    def check_structure(self) -> None:
        counts: dict[str, int] = {}
        for child in self.root.children:
            counts[child.tag] = counts.get(child.tag, 0) + 1
            tag = _TAGS.get(child.tag)
            if tag is None:
                self.fault(child, f"unknown element '{child.tag}'", did_you_mean(child.tag, _TAGS))
            elif self.format not in tag.formats:
                message = f"element '{child.tag}' is not part of format {self.format}"
                self.fault(child, message, _HINTS.get(child.tag))
            else:
                allowed = tag.attributes | {"xmlns"}
                if self.format == 3 and child.tag in _CONDITIONAL:
                    allowed |= {"condition"}
                if self.format == 3 and child.tag == "license":
                    allowed |= _LICENSE_3
                for attribute in child.attributes:
                    if attribute not in allowed and ":" not in attribute:
                        self.fault(child, f"element '{child.tag}' has an unknown attribute '{attribute}'")
                if child.children and not tag.nested:
                    self.fault(child.children[0], f"element '{child.tag}' must contain only text")
        for name, tag in _TAGS.items():
            if counts.get(name, 0) < tag.least:
                self.fault(self.root, f"element '{name}' is missing")
            if counts.get(name, 0) > tag.most:
                self.fault(list(self.root.all(name))[1], f"element '{name}' appears more than once")

    def check_texts(self) -> None:
        for child in self.root.children:
            text, email = child.text.strip(), child.attributes.get("email")
            match child.tag:
                case "name" if not is_package_name(text):
                    hint = "use lower-case letters, digits, '_' and '-', and start with a letter"
                    self.fault(child, f"invalid package name '{text}'", hint)
                case "name" if not _USUAL_NAME.fullmatch(text):
                    self.warn(
                        child, f"package name '{text}' does not follow the convention of lower-case names"
                    )
                case "description" if not child.inner.strip():
                    self.fault(child, "element 'description' is empty")
                case "license" if not text:
                    self.fault(child, "element 'license' is empty")
                case "version":
                    for version in filter(None, (text, child.attributes.get("compatibility"))):
                        if not _VERSION.fullmatch(version):
                            what = "does not consist of three numbers separated by dots"
                            self.fault(child, f"version '{version}' {what}", "for example 1.2.3")
                    if not text:
                        self.fault(child, "element 'version' is empty", "for example 1.2.3")
                case "maintainer" | "author":
                    if not text:
                        self.fault(child, f"element '{child.tag}' has no name")
                    if child.tag == "maintainer" and not email:
                        self.fault(child, "element 'maintainer' needs an attribute 'email'")
                    elif email is not None and not is_email(email):
                        self.fault(child, f"invalid email address '{email}'", "for example name@example.com")

    def manifest(self) -> Manifest:
        exports = tuple(
            Export(child.tag, tuple(sorted(child.attributes.items())), child.inner.strip())
            for export in self.root.all("export")
            for child in export.children
            if self.active(child)
        )
        build_types = [export.content for export in exports if export.tag == "build_type"]
        if len(build_types) > 1:
            self.warn(self.root, f"several build types are active; using the last one, '{build_types[-1]}'")
        return Manifest(
            name=next(self.texts("name")),
            version=next(self.texts("version")),
            description=" ".join(next(self.root.all("description")).inner.split()),
            build_type=build_types[-1] if build_types else "catkin",
            dependencies=tuple(self.dependencies()),
            path=self.path,
            format=self.format,
            maintainers=tuple(
                Person(child.text.strip(), child.attributes.get("email"))
                for child in self.root.all("maintainer")
            ),
            licenses=tuple(self.texts("license")),
            group_dependencies=tuple(self.texts("group_depend")),
            groups=tuple(self.texts("member_of_group")),
            exports=exports,
            warnings=tuple(self.warnings),
        )

    def texts(self, tag: str) -> Iterator[str]:
        return (child.text.strip() for child in self.root.all(tag) if self.active(child))

    def dependencies(self) -> Iterator[Dependency]:
        for child in self.root.children:
            kinds = DEPENDENCY_KINDS.get(child.tag)
            # Conditions of <conflict> and <replace> are also validated.
            if child.tag not in _CONDITIONAL or not self.active(child) or kinds is None:
                continue
            name, given = child.text.strip(), child.attributes
            if not name:
                self.warn(child, f"element '{child.tag}' is empty")
            elif not is_safe_name(name):
                hint = "names cannot contain blanks or quotes"
                self.fault(child, f"invalid dependency name '{name}'", hint)
            else:
                words = [word for word in VERSION_WORDS if f"version_{word}" in given]
                yield Dependency(name, kinds, tuple((word, given[f"version_{word}"]) for word in words))

    def active(self, child: Element) -> bool:
        condition = child.attributes.get("condition")
        if condition is None:
            return True
        try:
            return holds(condition, self.variables)
        except ConditionError as error:
            message = f"cannot parse the condition '{condition}' at column {error.column}: {error}"
            self.fault(child, message, 'for example condition="$ROS_VERSION == 2"')
            return False

    def check_meaning(self, manifest: Manifest) -> None:
        for child in self.root.children:
            if child.tag in DEPENDENCY_KINDS and child.text.strip() == manifest.name:
                self.fault(child, f"package '{manifest.name}' depends on itself")
        member, wanted = (
            {child.text.strip() for child in self.root.all(tag)}
            for tag in ("member_of_group", "group_depend")
        )
        for group in sorted(member & wanted):
            self.fault(self.root, f"the package depends on group '{group}' and is a member of it")
        if self.format == 1:
            self.check_repeated("test_depend", ("build_depend", "run_depend"))
        else:
            self.check_repeated("depend", ("build_depend", "build_export_depend", "exec_depend"))
            seen = set()
            for child in self.root.all("depend"):
                if (identity := _identity(child)) in seen:
                    self.fault(
                        child, f"<depend>{identity[0]}</depend> appears twice", "remove one of the two"
                    )
                seen.add(identity)

    def check_repeated(self, tag: str, others: tuple[str, ...]) -> None:
        present = {_identity(child): other for other in others for child in self.root.all(other)}
        for child in self.root.all(tag):
            if other := present.get(_identity(child)):
                message = f"<{tag}>{child.text.strip()}</{tag}> repeats <{other}>"
                self.fault(child, message, "remove one of the two")

    def fault(self, element: Element, message: str, hint: str | None = None) -> None:
        self.problems.append(Problem(message, element.place(self.path), hint))

    def warn(self, element: Element, message: str) -> None:
        self.warnings.append(Problem(message, element.place(self.path)))


def _identity(child: Element) -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return the properties that identify a dependency element: name, version attributes, condition."""
    attributes = (pair for pair in child.attributes.items() if ":" not in pair[0] and pair[0] != "xmlns")
    return child.text.strip(), tuple(sorted(attributes))


_TOKEN = re.compile(r"""\s*(?:(\()|(\))|(==|!=|<=|>=|<|>)|(\$?[\w-]+)|"([^"]*)"|'([^']*)')""", re.ASCII)
_COMPARISONS: dict[str, Callable[[str, str], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    "<": operator.lt,
    ">=": operator.ge,
    ">": operator.gt,
}
_BARE_WORD = re.compile(r"[A-Za-z0-9_-]+")
_VARIABLE = re.compile(r"\$[A-Za-z0-9_]+")
_DEEPEST = 50


class ConditionError(ValueError):
    """An invalid condition; `column` counts from 1."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


def holds(condition: str, variables: Mapping[str, str]) -> bool:
    """Return whether a condition of format 3 holds, such as `$ROS_VERSION == 2 and $ROS_DISTRO != "foxy"`.

        expression  := conjunction ('or' conjunction)*
        conjunction := atom ('and' atom)*
        atom        := '(' expression ')' | operand ('==' | '!=' | '<=' | '<' | '>=' | '>') operand
        operand     := $NAME | bare word | "quoted" | 'quoted'

    Values are compared as strings; an unset variable is an empty string. Raises ConditionError for malformed
    conditions.
    """
    tokens = _tokens(condition)[::-1]

    def expression(depth: int) -> bool:
        alternatives = [[atom(depth)]]
        while tokens[-1][:2] in {("word", "and"), ("word", "or")}:
            if tokens.pop()[1] == "or":
                alternatives.append([])
            alternatives[-1].append(atom(depth))
        return any(map(all, alternatives))

    def atom(depth: int) -> bool:
        kind, _, column = tokens[-1]
        if kind != "(":
            left = operand()
            compare = _COMPARISONS[take("comparison", "one of == != <= < >= >")]
            return compare(left, operand())
        if depth == _DEEPEST:
            raise ConditionError("too many nested parentheses", column)
        tokens.pop()
        value = expression(depth + 1)
        take(")", "a closing parenthesis")
        return value

    def operand() -> str:
        kind, text, column = tokens.pop()
        if kind == "quoted" or (kind == "word" and _BARE_WORD.fullmatch(text)):
            return text
        if kind == "word" and _VARIABLE.fullmatch(text):
            return variables.get(text[1:], "")
        raise ConditionError("expected a $VARIABLE, a word or a quoted string", column)

    def take(kind: str, description: str) -> str:
        token_kind, text, column = tokens.pop()
        if token_kind != kind:
            raise ConditionError(f"expected {description}", column)
        return text

    value = expression(0)
    take("end", "'and', 'or' or the end")
    return value


def _tokens(text: str) -> list[tuple[str, str, int]]:
    """Return (kind, text, column) of each token, with a final 'end'."""
    tokens: list[tuple[str, str, int]] = []
    at = 0
    end = len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None:
            rest = text[at:].lstrip()
            raise ConditionError(f"unexpected {rest[:20].rstrip()!r}", len(text) - len(rest) + 1)
        column = match.start(match.lastindex or 0) + 1
        kind = ("(", ")", "comparison", "word", "quoted", "quoted")[(match.lastindex or 1) - 1]
        value = match.group(match.lastindex or 0)
        tokens.append((kind, value, column))
        at = match.end()
    tokens.append(("end", "", len(text) + 1))
    return tokens
