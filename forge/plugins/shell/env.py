"""`forge env`: print the environment variables that sourcing the workspace sets."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from pathlib import Path

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import option
from forge.cli.options import install_base_option, profile_option
from forge.environment.sourcing import sourced_environment


@frozen
class Options:
    names: tuple[str, ...] = option(
        "print only these variables, changed or not", default=(), positional=True, metavar="VARIABLE"
    )
    format: str = option("output format (default: sh)", default="sh", choices=("sh", "json", "dotenv"))
    install_base: str = install_base_option()
    profile: str | None = profile_option()


def run(options: Options) -> int:
    before = dict(os.environ)
    after = sourced_environment(Path(options.install_base).absolute(), before)
    changed = {name: value for name, value in after.items() if before.get(name) != value}
    gone = before.keys() - after.keys()
    if options.names:
        unknown = (name for name in options.names if name not in after)
        problems = (
            Problem(f"variable '{name}' is not set after sourcing", hint=did_you_mean(name, after))
            for name in unknown
        )
        raise_if_any(problems, SelectionError)
        changed, gone = {name: after[name] for name in options.names}, set()
    elif not changed and not gone and sys.stdout.isatty():
        print("note: this shell has sourced the workspace: nothing changes", file=sys.stderr)
    match options.format:
        case "sh":
            lines = [f"export {name}={shlex.quote(value)}" for name, value in sorted(changed.items())]
            lines += (f"unset {name}" for name in sorted(gone))
            text = "".join(f"{line}\n" for line in lines)
        case "json":
            text = json.dumps({**changed, **dict.fromkeys(gone)}, indent=2, sort_keys=True) + "\n"
        case _:
            # For editors and containers; it cannot unset variables.
            escaped = {name: re.sub(r'([\\"$`])', r"\\\1", value) for name, value in changed.items()}
            text = "".join(f'{name}="{value}"\n' for name, value in sorted(escaped.items()))
    sys.stdout.write(text)
    return 0
