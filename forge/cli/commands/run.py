"""`forge run`: run an executable of an installed package."""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType

from forge.base.errors import ForgeError, HostError, Problem, reason_of
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.frozen import frozen
from forge.base.layout import forge_command
from forge.base.options import option
from forge.environment import installed
from forge.environment.install_state import python_of
from forge.workspace.root import find_install, source_packages

_SHOWN_NAMES = 10
_BY_ENV = ([b"#!/usr/bin/env", b"python3"], [b"#!/usr/bin/env", b"python"])


@frozen
class Options:
    USAGE = "%(prog)s [-h] [--prefix COMMAND] [--profile NAME] PACKAGE EXECUTABLE [ARGUMENT ...]"
    EPILOG = "All arguments after the name of the executable are passed to it, including options."
    prefix: str | None = option(
        "command to run the executable with, such as 'gdb --args'; must precede the package name",
        metavar="COMMAND",
    )
    profile: str | None = option(
        "run the program built with this profile, whatever is sourced; must precede the package name",
        metavar="NAME",
    )
    # A single positional argument, because argparse would remove a '--' between two.
    words: tuple[str, ...] = option(None, default=(), positional=True, nargs=argparse.REMAINDER)


def run(options: Options) -> int:
    """Run the executable; returns its exit code, or the negative number of the signal that ended it."""
    words = options.words[1:] if options.words[:1] == ("--",) else options.words
    if not words:
        hint = "list them with 'forge pkg executables'"
        raise ForgeError(Problem("missing arguments PACKAGE and EXECUTABLE", hint=hint))
    package, name, *arguments = words if len(words) > 1 else (*words, "")
    install = find_install(Path.cwd(), Path.home(), options.profile)
    variables: Mapping[str, str] = os.environ
    if options.profile:
        if install is None:
            message = f"nothing was built with the profile '{options.profile}'"
            raise ForgeError(Problem(message, hint=forge_command("build", options.profile)))
        variables = _sourced(install, variables)
    # `ros2 run` does not find the packages of the enclosing workspace that do not use ament.
    plain = None
    if not installed.is_registered(package, variables, install) and installed.unregistered_prefix(
        package, install
    ):
        plain = installed.plain_prefix(package, install, source_packages(install))
    prefix = plain or installed.find_package(package, variables, install, lambda: source_packages(install))
    if install is not None and (plain or not installed.is_registered(package, variables, None)):
        variables = _sourced(install, variables)
    paths = (installed.plain_executables if plain else installed.executables)(package, prefix)
    names = sorted({path.name for path in paths})
    if not name and names:
        shown = ", ".join(f"'{each}'" for each in names[:_SHOWN_NAMES])
        more = f"; 'forge pkg executables {package}' lists all {len(names)}"
        hint = f"'{package}' has {shown}{more if len(names) > _SHOWN_NAMES else ''}"
        raise ForgeError(Problem("missing argument EXECUTABLE", hint=hint))
    matches = [path for path in paths if path.name == (name or "x")]
    if not matches:
        advice = own_plugin(OPTIONS, "advice-executables")
        remedy = advice.missing_executable_hint(package, name or "x", prefix, paths) if advice else None
        raise ForgeError(Problem("no executable found", hint=remedy))
    if len(matches) > 1:
        listing = "".join(f"\n- {path}" for path in matches)
        raise ForgeError(Problem(f"multiple executables found:{listing}"))
    path = matches[0]
    first = b""
    with suppress(OSError), path.open("rb") as stream:
        first = stream.readline(512)
    if first.startswith(b"#!") and first.endswith(b"\r\n"):
        message = f"'{path}' has Windows line endings, so that its interpreter cannot be found"
        hint = f"fix the source: sed -i 's/\\r$//' {shlex.quote(path.name)}, and build again"
        raise ForgeError(Problem(message, hint=hint))
    program = [str(path)]
    # `env` finds the python3 of an active virtual environment.
    if not any(variables.get(each) for each in ("VIRTUAL_ENV", "CONDA_PREFIX")) and first.split() in _BY_ENV:
        program[:0] = filter(None, (python_of(prefix),))
    try:
        command = shlex.split(options.prefix or "")
    except ValueError as error:
        raise ForgeError(Problem(f"cannot parse --prefix: {str(error).lower()}")) from None
    code = _wait_for((*command, *program, *arguments), variables)
    if code:
        ending = f"Process exited with failure {code}" if code > 0 else signal.strsignal(-code)
        print(f"[ros2run]: {ending}", file=sys.stderr)
    return code


def _sourced(install: Path, variables: Mapping[str, str]) -> Mapping[str, str]:
    from forge.environment.sourcing import sourced_environment

    return sourced_environment(install, variables)


def _wait_for(argv: Sequence[str], variables: Mapping[str, str]) -> int:
    """Run a program with this process's streams and working directory; forward signals."""
    sys.stdout.flush()
    children: list[subprocess.Popen[bytes]] = []

    def forward(number: int, _frame: FrameType | None) -> None:
        # The terminal sends Ctrl-C to the child as well. SIG_IGN would be inherited by the child.
        for child in children if number != signal.SIGINT else ():
            child.send_signal(number)

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, forward) for number in numbers}
    try:
        children.append(subprocess.Popen(argv, env=variables))
        return children[0].wait()
    except OSError as error:
        hint = "scripts need a line such as '#!/usr/bin/env python3' at the beginning"
        with suppress(OSError), Path(argv[0]).open("rb") as stream:
            if stream.read(4) == b"\x7fELF":
                hint = (
                    "it was compiled for another platform; with qemu-user, run it with "
                    "--prefix 'qemu-aarch64 -L /usr/aarch64-linux-gnu' or similar"
                )
        raise HostError(Problem(f"cannot run '{argv[0]}': {reason_of(error)}", hint=hint)) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
