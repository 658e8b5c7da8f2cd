"""`forge shell`: start a shell or a command in the environment of the workspace."""

from __future__ import annotations

import argparse
import os
import re
import shlex
import sys
from pathlib import Path

from forge.base.errors import HostError, Problem, reason_of
from forge.base.frozen import frozen
from forge.base.layout import templates_folder
from forge.base.options import option
from forge.cli.options import install_base_option, profile_option
from forge.environment.install_state import recorded_python
from forge.environment.sourcing import sourced_environment
from forge.toolchain.interpreter import ENVIRONMENT_FOLDER


@frozen
class Options:
    install_base: str = install_base_option()
    profile: str | None = profile_option()
    words: tuple[str, ...] = option(
        "command to run instead of a shell",
        default=(),
        nargs=argparse.REMAINDER,
        positional=True,
        metavar="COMMAND",
    )
    origin: str = os.curdir


def run(options: Options) -> int:
    """Replace this process by the user's shell or the command.

    Raises HostError if it cannot be started.
    """
    words = options.words[1:] if options.words[:1] == ("--",) else options.words
    install = Path(options.install_base).absolute()
    variables = dict(sourced_environment(install, os.environ))
    environment = Path(recorded_python(install) or "").parent.parent
    if environment.name == ENVIRONMENT_FOLDER and not (variables.keys() & {"VIRTUAL_ENV", "CONDA_PREFIX"}):
        # The environment of 'forge fetch', with the modules that the packages need.
        variables["VIRTUAL_ENV"] = str(environment)
        variables["PATH"] = f"{environment}/bin{os.pathsep}{variables.get('PATH', os.defpath)}"
    argv = list(words) or _shell_with_prompt(os.environ.get("SHELL") or "/bin/sh", variables)
    if not words and sys.stderr.isatty():
        print(f"started a shell with '{install}' sourced; type 'exit' to leave it", file=sys.stderr)
    os.chdir(options.origin)
    sys.stdout.flush()
    try:
        os.execvpe(argv[0], argv, variables)  # noqa: S606  (the user asked for a shell)
    except OSError as error:
        raise HostError(Problem(f"cannot run '{argv[0]}': {reason_of(error)}")) from None


def _shell_with_prompt(shell: str, variables: dict[str, str]) -> list[str]:
    """Return the command of an interactive shell; add variables so that its prompt names the workspace."""
    # Prompts expand some characters.
    name = re.sub(r"[^\w.+-]", "_", Path.cwd().name)
    variables["FORGE_SHELL"] = name
    if variables.get("FORGE_DISABLE_PROMPT"):
        return [shell]
    files = templates_folder() / "shell"
    match Path(shell).name:
        case "bash":
            return [shell, "--rcfile", str(files / "bashrc")]
        case "fish":
            return [shell, "--init-command", f"source {shlex.quote(str(files / 'prompt.fish'))}"]
        case "zsh":
            variables["FORGE_ZDOTDIR"] = variables.get("ZDOTDIR") or variables.get("HOME", "")
            variables["ZDOTDIR"] = str(files / "zsh")
        case "sh" | "ash" | "dash" | "ksh" | "mksh":
            variables["PS1"] = f"({name}) {variables.get('PS1') or '$ '}"
        case _:
            pass
    return [shell]
