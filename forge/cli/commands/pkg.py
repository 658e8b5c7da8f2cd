"""`forge pkg`: create packages and query installed ones."""

from __future__ import annotations

import getpass
import os
import subprocess
from pathlib import Path

from forge.base.errors import ForgeError, HostError, Problem, print_problem, reason_of
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.base.names import did_you_mean, is_email
from forge.base.options import flag, option
from forge.base.xml import parse_xml
from forge.cli.main import Parser
from forge.cli.options import NoOptions, add_verb
from forge.environment.installed import executables, find_package, known_packages
from forge.workspace import creation
from forge.workspace.model import Person
from forge.workspace.root import find_install, source_packages


def _license(text: str) -> str:
    """Return a license; '?' prints the supported ones and exits, before other arguments are checked."""
    if text == "?":
        print("Supported licenses:", *creation.LICENSES, sep="\n")
        raise SystemExit(0)
    return text


@frozen
class _CreateOptions:
    name: str = option("name of the package, such as 'my_robot'", positional=True, metavar="NAME")
    package_format: int = option(
        "format version of package.xml (default: 3)",
        default=3,
        parse=int,
        choices=(2, 3),
        short="--package-format",
        flag="--package_format",
    )
    description: str = option(
        "description for package.xml (default: a line with TODO)", default="TODO: Package description"
    )
    license: str = option(
        "license as an SPDX identifier; '?' lists those with a LICENSE template (default: a line with TODO)",
        default=creation.UNDECLARED_LICENSE,
        parse=_license,
    )
    destination_directory: str = option(
        "folder to create the package in (default: .)", default=".", metavar="DIR"
    )
    build_type: str = option(
        "build type (default: ament_cmake)", default="ament_cmake", choices=tuple(creation.BUILD_TYPES)
    )
    dependencies: tuple[str, ...] = option("dependencies of the package", default=(), metavar="NAME")
    maintainer_email: str | None = option(
        "email address of the maintainer (default: from git's configuration)", metavar="EMAIL"
    )
    maintainer_name: str | None = option("name of the maintainer (default: your login name)", metavar="NAME")
    node_name: str | None = option("create an executable with this name", metavar="NAME")
    library_name: str | None = option("create a library with this name", metavar="NAME")
    interfaces: tuple[str, ...] | None = option(
        "create a package of interfaces with these files, such as 'Pose.msg GetMap.srv' (default: one "
        "example of each kind)",
        nargs="*",
        metavar="FILE",
    )


@frozen
class _ExecutablesOptions:
    package: str | None = option(
        "list executables of this package (default: of all)", positional=True, nargs="?", metavar="PACKAGE"
    )
    full_path: bool = flag("print paths instead of names")


@frozen
class _PrefixOptions:
    package: str = option("name of the package", positional=True, metavar="PACKAGE")
    share: bool = flag("print the package's share folder instead of the prefix")


@frozen
class _XmlOptions:
    package: str = option("name of the package", positional=True, metavar="PACKAGE")
    tag: str | None = option("print only the text of elements with this tag", short="-t", metavar="TAG")


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    add_verb(verbs, "create", "create a package from a template", _CreateOptions, _create)
    add_verb(verbs, "list", "list installed packages", NoOptions, _list)
    summary = "list executables of installed packages"
    add_verb(verbs, "executables", summary, _ExecutablesOptions, _executables)
    add_verb(verbs, "prefix", "print the prefix of an installed package", _PrefixOptions, _prefix)
    summary = "print the manifest (package.xml) of an installed package"
    add_verb(verbs, "xml", summary, _XmlOptions, _xml)


def _create(options: _CreateOptions) -> None:
    node, library = options.node_name, options.library_name
    if node is not None and node == library:
        node = f"{node}_node"
        _warn(f"node and library cannot both be named '{library}'")
        _warn(f"the node is named '{node}' instead")
    name = options.maintainer_name or _login()
    blueprint = creation.NewPackage(
        options.name,
        Person(name, options.maintainer_email or _git_email() or creation.placeholder_email(name)),
        options.build_type,
        options.package_format,
        options.description,
        options.license,
        tuple(dict.fromkeys(options.dependencies)),
        node,
        library,
        ()
        if options.interfaces is None
        else tuple(dict.fromkeys(options.interfaces)) or creation.EXAMPLE_INTERFACES,
    )
    folder = Path(options.destination_directory, blueprint.name)
    if folder.exists() or folder.is_symlink():
        hint = "remove it, or choose another name or --destination-directory"
        raise ForgeError(Problem(f"'{folder}' already exists", hint=hint))
    items = creation.render_package(blueprint)
    path = f"{options.destination_directory.rstrip('/')}/{blueprint.name}"
    facts = {
        "package name": blueprint.name,
        "destination directory": folder.parent.resolve(),
        "package format": blueprint.format,
        "version": creation.VERSION,
        "description": blueprint.description,
        "maintainer": [f"{blueprint.maintainer.name} <{blueprint.maintainer.email}>"],
        "licenses": [blueprint.license],
        "build type": blueprint.build_type,
        "dependencies": list(blueprint.dependencies),
        "node_name": blueprint.node,
        "library_name": blueprint.library,
        "interfaces": list(blueprint.interfaces) or None,
    }
    # Lines of `ros2 pkg create`, printed at the end: a reader that leaves early must not stop halfway.
    lines = ["going to create a new package"]
    lines += (f"{name}: {value}" for name, value in facts.items() if value is not None)
    lines.append(f"creating folder {path}")
    headline = "source folder" if blueprint.build_type == "ament_python" else "source and include folder"
    headline = "folders of interfaces" if blueprint.interfaces else headline
    try:
        Path(path).mkdir(parents=True)
        for item, text in items.items():
            if text is None:
                lines += (f"creating {headline}",) if headline else ()
                headline = ""
                lines.append(f"creating folder {path}/{item}")
                Path(path, item).mkdir(parents=True)
            else:
                lines.append(f"creating {path}/{item}")
                write_if_changed(Path(path, item), text)
    except OSError as error:
        raise HostError(Problem(f"cannot create '{error.filename or folder}': {reason_of(error)}")) from None
    finally:
        print(*lines, sep="\n")
    name = blueprint.name
    if not name[0].isalpha() or name != name.lower():
        _warn(f"'{name}' is an unusual name: package names start with a letter and are lower case")
    if blueprint.license == creation.UNDECLARED_LICENSE:
        print_problem(Problem("no license yet: choose one with --license, such as --license MIT"), "note")
    elif blueprint.license not in creation.LICENSES:
        hint = (
            did_you_mean(blueprint.license, creation.LICENSES)
            or f"supported licenses are {', '.join(creation.LICENSES)}"
        )
        _warn(f"no LICENSE file created: unknown license '{blueprint.license}'", hint)


def _login() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a user without an entry in the password database, as in containers
        return "maintainer"


def _git_email() -> str | None:
    """Return the email address configured in git, None if it is missing or invalid."""
    try:
        found = subprocess.run(["git", "config", "user.email"], capture_output=True, text=True, check=False)
    except OSError:
        return None
    email = found.stdout.strip()
    return email if is_email(email) else None


def _warn(message: str, hint: str | None = None) -> None:
    print_problem(Problem(message, hint=hint), "warning")


def _install() -> Path | None:
    return find_install(Path.cwd(), Path.home())


def _find(package: str) -> Path:
    """Return the prefix of an installed package; raises ForgeError with a hint."""
    install = _install()
    return find_package(package, os.environ, install, lambda: source_packages(install))


def _list(_: NoOptions) -> None:
    for name in known_packages(os.environ, _install()):
        print(name)


def _executables(options: _ExecutablesOptions) -> None:
    if options.package is None:
        packages = known_packages(os.environ, _install())
    else:
        packages = {options.package: _find(options.package)}
    for name, prefix in packages.items():
        for path in executables(name, prefix):
            print(path if options.full_path else f"{name} {path.name}")


def _prefix(options: _PrefixOptions) -> None:
    prefix = _find(options.package)
    print(prefix / "share" / options.package if options.share else prefix)


def _xml(options: _XmlOptions) -> None:
    path = _find(options.package) / "share" / options.package / "package.xml"
    try:
        content = path.read_bytes()
    except OSError:
        problem = Problem("package XML manifest not found", hint=f"expected '{path}'")
        raise ForgeError(problem) from None
    root = parse_xml(content, path)
    if options.tag is None:
        print(content[root.start :].decode(errors="replace").rstrip())
        return
    elements = tuple(root.all(options.tag))
    if not elements:
        hint = did_you_mean(options.tag, (child.tag for child in root.children))
        raise ForgeError(Problem("XML tag not found", hint=hint))
    for element in elements:
        print(element.text.strip())
