"""`forge init`: write forge.toml, and files for editors, CI services and containers."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement

from forge.base.distributions import OLDEST, check_distribution, distribution_option
from forge.base.errors import HostError, Location, Problem, WorkspaceError, print_warnings, reason_of
from forge.base.files import text_if_exists
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.base.templating import render
from forge.base.text import quoted_names
from forge.cli.options import displayed
from forge.cli.preparation import known_rosdistro
from forge.workspace.forge_toml import FORGE_TOML

_FILES: Mapping[str, Mapping[str, str]] = {
    "vscode": {
        ".vscode/settings.json": "vscode/settings.json",
        ".vscode/tasks.json": "vscode/tasks.json",
        ".vscode/launch.json": "vscode/launch.json",
        ".vscode/extensions.json": "vscode/extensions.json",
    },
    "github": {".github/workflows/build.yml": "github.yml.j2"},
    "gitlab": {".gitlab-ci.yml": "gitlab.yml.j2"},
    "devcontainer": {
        ".devcontainer/devcontainer.json": "devcontainer/devcontainer.json.j2",
        ".devcontainer/Dockerfile": "devcontainer/Dockerfile.j2",
    },
}
"""The files of each option, and their templates."""
_GITIGNORE = ".gitignore"
_VARIABLES = ".env"
_INSTALL_FORGE = frozenset({"github", "gitlab", "devcontainer"})
PLACEHOLDER = "ros-forge[cmake] @ git+URL_OF_FORGE@COMMIT"


def _requirement(text: str) -> str:
    """Return a requirement of pip that installs forge; raises ValueError."""
    try:
        Requirement(text)
    except InvalidRequirement as error:
        raise ValueError(f"'{text}' is not a requirement: {str(error).partition(chr(10))[0]}") from None
    if not text.isprintable() or "'" in text:
        raise ValueError(f"'{text}' contains a quote or a line break")
    return text


@frozen
class Options:
    vscode: bool = flag(
        ".vscode: tasks that build and test, launch configurations for gdb and Python, settings for clangd"
    )
    github: bool = flag(".github/workflows/build.yml: a job that builds and tests on GitHub Actions")
    gitlab: bool = flag(".gitlab-ci.yml: the same for GitLab CI")
    devcontainer: bool = flag(".devcontainer: a container with ROS, forge, clangd and gdb")
    rosdistro: str | None = distribution_option()
    forge: str | None = option(
        "pip requirement that installs forge in the jobs and the container (default: the repository and "
        "commit that this forge was installed from)",
        parse=_requirement,
        metavar="REQUIREMENT",
    )
    dry_run: bool = flag("print the files instead of writing them")
    origin: str = os.curdir


def run(options: Options) -> int:
    """Write the files; if one of them exists, write none and raise WorkspaceError."""
    root = Path.cwd()
    check_distribution(options.rosdistro)
    rosdistro = known_rosdistro(options.rosdistro, root, root / "install") or ""
    wanted = [name for name in _FILES if getattr(options, name)]
    requirement = options.forge or _installed_from() or PLACEHOLDER
    names = {
        "forge": requirement,
        "rosdistro": rosdistro,
        "image_distro": rosdistro or OLDEST,
        "sources": "src" if (root / "src").is_dir() or not any(root.glob("*/package.xml")) else ".",
        "name": json.dumps(root.name),
    }
    templates = {path: template for name in wanted for path, template in _FILES[name].items()}
    if not (wanted and (root / FORGE_TOML).exists()):
        ignored = {} if (root / _GITIGNORE).exists() else {_GITIGNORE: "gitignore"}
        templates = {FORGE_TOML: "forge.toml.j2", **ignored, **templates}
    texts = {path: render(f"init/templates/{template}", **names) for path, template in templates.items()}
    if options.dry_run:
        print(*(f"--- {displayed(path, options.origin)}\n{text}" for path, text in texts.items()), sep="\n")
    else:
        _write(root, texts, options.origin)
        print(*(f"creating {displayed(path, options.origin)}" for path in texts), sep="\n")
    print_warnings(_warnings(root, wanted, requirement))
    return 0


def _write(root: Path, texts: Mapping[str, str], origin: str) -> None:
    """Write all files or none; raises WorkspaceError if one exists, HostError if one cannot be written."""
    existing = [displayed(path, origin) for path in texts if os.path.lexists(root / path)]
    if existing:
        verb, pronoun = ("exists", "it") if len(existing) == 1 else ("exist", "them")
        hint = f"move {pronoun} away; '--dry-run' prints what would be written"
        raise WorkspaceError(Problem(f"{quoted_names(existing)} {verb}: nothing was written", hint=hint))
    written: list[Path] = []
    folders: list[Path] = []
    try:
        for path, text in texts.items():
            file = root / path
            absent = [each for each in file.parents if not os.path.lexists(each)]
            file.parent.mkdir(parents=True, exist_ok=True)
            folders = [*absent, *folders]
            with file.open("x", encoding="utf-8") as stream:
                written.append(file)
                stream.write(text)
    except OSError as error:
        for file in written:
            file.unlink(missing_ok=True)
        for folder in folders:
            with suppress(OSError):
                folder.rmdir()
        message = f"cannot write '{displayed(path, origin)}': {reason_of(error)}; nothing was written"
        raise HostError(Problem(message)) from None


def _warnings(root: Path, wanted: list[str], requirement: str) -> list[Problem]:
    problems = []
    ignored = text_if_exists(root / _GITIGNORE)
    if ignored is not None and "build" not in ignored:
        lines = render("init/templates/gitignore").split()
        problems.append(
            Problem(
                "git does not ignore forge's output folders",
                Location(Path(_GITIGNORE)),
                f"add {', '.join(lines)}",
            )
        )
    if "vscode" in wanted and os.path.lexists(root / _VARIABLES):
        message = "the task 'forge: environment', which runs before debugging, will replace this file"
        hint = "keep your variables in another file, or change '.env' in .vscode to another name"
        problems.append(Problem(message, Location(Path(_VARIABLES)), hint))
    if requirement == PLACEHOLDER and not _INSTALL_FORGE.isdisjoint(wanted):
        message = "replace URL_OF_FORGE and COMMIT: this forge was not installed from a repository"
        hint = "or pass a pip requirement: --forge 'ros-forge[cmake] @ git+https://...@COMMIT'"
        problems.append(Problem(message, hint=hint))
    top = next((folder for folder in (root, *root.parents) if (folder / ".git").exists()), None)
    at_top = [path for name in wanted for path in _FILES[name] if name in {"github", "gitlab"}]
    if top not in {None, root} and at_top:
        message = f"{quoted_names(at_top)} must be in '{top}', the top folder of the repository"
        hint = f"move it there, and let the job change to '{root.relative_to(str(top))}' first"
        problems.append(Problem(message, hint=hint))
    return problems


def _installed_from() -> str | None:
    """Return a requirement for the repository and commit that forge was installed from (PEP 610), or None."""
    from importlib.metadata import PackageNotFoundError, distribution

    with suppress(PackageNotFoundError, ValueError, KeyError, TypeError):
        origin = json.loads(distribution("ros-forge").read_text("direct_url.json") or "")
        vcs = origin["vcs_info"]
        return _requirement(f"ros-forge[cmake] @ {vcs['vcs']}+{origin['url']}@{vcs['commit_id']}")
    return None
