"""create a package from a template"""

from __future__ import annotations

import getpass
import subprocess
from pathlib import Path

from forge.base.errors import ForgeError, HostError, Problem, print_problem, reason_of
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.base.names import did_you_mean, is_email
from forge.base.options import option
from forge.plugins.create import package
from forge.workspace.model import Person


def _license(text: str) -> str:
    """Return a license; '?' prints the supported ones and exits, before other arguments are checked."""
    if text == "?":
        print("Supported licenses:", *package.LICENSES, sep="\n")
        raise SystemExit(0)
    return text


@frozen
class Options:
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
        default=package.UNDECLARED_LICENSE,
        parse=_license,
    )
    destination_directory: str = option(
        "folder to create the package in (default: .)", default=".", metavar="DIR"
    )
    build_type: str = option(
        "build type (default: ament_cmake)", default="ament_cmake", choices=tuple(package.BUILD_TYPES)
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


def run(options: Options) -> None:
    node, library = options.node_name, options.library_name
    if node is not None and node == library:
        node = f"{node}_node"
        _warn(f"node and library cannot both be named '{library}'")
        _warn(f"the node is named '{node}' instead")
    name = options.maintainer_name or _login()
    blueprint = package.NewPackage(
        options.name,
        Person(name, options.maintainer_email or _git_email() or package.placeholder_email(name)),
        options.build_type,
        options.package_format,
        options.description,
        options.license,
        tuple(dict.fromkeys(options.dependencies)),
        node,
        library,
        ()
        if options.interfaces is None
        else tuple(dict.fromkeys(options.interfaces)) or package.EXAMPLE_INTERFACES,
    )
    folder = Path(options.destination_directory, blueprint.name)
    if folder.exists() or folder.is_symlink():
        hint = "remove it, or choose another name or --destination-directory"
        raise ForgeError(Problem(f"'{folder}' already exists", hint=hint))
    items = package.render_package(blueprint)
    path = f"{options.destination_directory.rstrip('/')}/{blueprint.name}"
    facts = {
        "package name": blueprint.name,
        "destination directory": folder.parent.resolve(),
        "package format": blueprint.format,
        "version": package.VERSION,
        "description": blueprint.description,
        "maintainer": [f"{blueprint.maintainer.name} <{blueprint.maintainer.email}>"],
        "licenses": [blueprint.license],
        "build type": blueprint.build_type,
        "dependencies": list(blueprint.dependencies),
        "node_name": blueprint.node,
        "library_name": blueprint.library,
        "interfaces": list(blueprint.interfaces) or None,
    }
    # Lines of `ros2 pkg create`, printed at the end, so that a reader that closes the pipe early leaves no
    # partial package.
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
    if blueprint.license == package.UNDECLARED_LICENSE:
        print_problem(Problem("no license yet: choose one with --license, such as --license MIT"), "note")
    elif blueprint.license not in package.LICENSES:
        hint = (
            did_you_mean(blueprint.license, package.LICENSES)
            or f"supported licenses are {', '.join(package.LICENSES)}"
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
        result = subprocess.run(["git", "config", "user.email"], capture_output=True, text=True, check=False)
    except OSError:
        return None
    email = result.stdout.strip()
    return email if is_email(email) else None


def _warn(message: str, hint: str | None = None) -> None:
    print_problem(Problem(message, hint=hint), "warning")
