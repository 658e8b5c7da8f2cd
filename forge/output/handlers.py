"""The event handlers of --event-handlers, and the options for the output of builds and tests."""

from __future__ import annotations

import os
import sys

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.extensions import OWN, REPORTERS, is_installed, own_plugin
from forge.base.frozen import frozen
from forge.base.names import nearest
from forge.base.options import flag, option
from forge.output.reporters import Start, find_reporter

HANDLERS = {
    "console_start_end": True,
    "console_stderr": True,
    "summary": True,
    "status": True,
    "console_direct": False,
    "console_cohesion": False,
    "console_package_list": False,
    # Accepted for compatibility with colcon, without effect except for compile_commands.
    "log": True,
    "event_log": True,
    "log_command": True,
    "store_result": True,
    "compile_commands": True,
    "desktop_notification": False,
    "parallel_status": False,
    "terminal_title": False,
}
"""The event handlers of --event-handlers and their defaults."""

NONE = "none"
CI_SERVICES = {"github": "GITHUB_ACTIONS", "gitlab": "GITLAB_CI"}
"""Reporters for CI services, and the variables that the services set to 'true'."""

TEXT_HANDLERS = ("console_start_end", "console_cohesion", "console_direct", "console_package_list", "summary")
"""The event handlers that print text on stdout."""


@frozen
class ReportOptions:
    """The options for the output of a build or of tests."""

    GROUP = "output options"

    event_handlers: tuple[str, ...] = option(
        "enable (+) or disable (-) event handlers: 'console_direct+' prints output immediately, 'status-' "
        "disables the status line; 'forge extensions' lists all",
        default=(),
        metavar="NAME+",
    )
    json: bool = flag("print only one JSON object per line for each event")
    ci_output: str | None = option(
        "print errors, folded output and a summary for this CI service (default: the one that runs forge)",
        choices=(*CI_SERVICES, NONE),
    )
    flags: frozenset[str] = frozenset()
    """All options of the command, for hints."""

    @property
    def handlers(self) -> dict[str, bool]:
        """Return the state of each event handler; raises SelectionError for unknown ones."""
        problems = []
        for word in self.event_handlers:
            name, sign = word[:-1], word[-1:]
            # forge's own reporters have options.
            is_known = name in HANDLERS or (name not in OWN[REPORTERS] and find_reporter(name) is not None)
            if sign in {"+", "-"} and is_known:
                continue
            if (name := word.rstrip("+-")) in HANDLERS:
                message = f"--event-handlers expects names followed by '+' or '-', not '{word}'"
                hint = f"'{name}+' enables it, '{name}-' disables it"
            else:
                near = nearest(name, HANDLERS)
                question = f"did you mean '{near}{'-' if sign == '-' else '+'}'? " if near else ""
                message = f"--event-handlers: unknown event handler '{name}'"
                hint = f"{question}event handlers: {', '.join(HANDLERS)}"
            problems.append(Problem(message, hint=hint))
        raise_if_any(problems, SelectionError)
        return {**HANDLERS, **{word[:-1]: word.endswith("+") for word in self.event_handlers}}

    @property
    def status(self) -> Start | None:
        """Return the reporter of status lines, if they are enabled and stdout is a capable terminal."""
        on = self.handlers
        wanted = on["status"] and on["console_start_end"] and not on["console_direct"] and not self.json
        dumb = os.environ.get("TERM", "") in {"", "dumb"}
        plugin = own_plugin(REPORTERS, "status") if wanted and not dumb and sys.stdout.isatty() else None
        return plugin and plugin.start

    def reporters(self, *names: str) -> dict[str, Start]:
        """Return these reporters and those of --event-handlers; raises ForgeError if one is missing."""
        others = [name for name, is_on in self.handlers.items() if is_on and name not in HANDLERS]
        running = (name for name, variable in CI_SERVICES.items() if os.environ.get(variable) == "true")
        service = self.ci_output or next((name for name in running if is_installed(REPORTERS, name)), NONE)
        others += [service] if service != NONE else []
        starts = {name: find_reporter(name) for name in (*names, *others)}
        return {name: start for name, start in starts.items() if start}
