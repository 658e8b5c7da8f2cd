"""Write the entry points of a setup.cfg as entry_points.txt, and its console scripts as programs.

Called as `entry_points.py SETUP_CFG EGG_INFO_FOLDER SCRIPTS_FOLDER`. Uses only the standard library.
"""

from __future__ import annotations

import configparser
import sys
from pathlib import Path

PROGRAM = """\
#!{python}
import sys

from {module} import {attribute}

if __name__ == "__main__":
    sys.exit({function}())
"""


def main(setup_cfg: str, egg_info: str, scripts: str) -> int:
    """Read setup.cfg, write entry_points.txt and the programs."""
    parser = configparser.ConfigParser(delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # names keep their case
    parser.read(setup_cfg, encoding="utf-8")
    groups = dict(parser["options.entry_points"]) if parser.has_section("options.entry_points") else {}
    lines = []
    for group, text in groups.items():
        entries = [line.strip() for line in text.splitlines() if line.strip()]
        lines += [f"[{group}]", *entries, ""]
        if group == "console_scripts":
            for entry in entries:
                _write_program(Path(scripts), entry)
    if lines:
        Path(egg_info, "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
    return 0


def _write_program(folder: Path, entry: str) -> None:
    name, _, target = (part.strip() for part in entry.partition("="))
    module, _, function = target.partition(":")
    if not name or not module or not function:
        sys.exit(f"setup.cfg: the console script '{entry}' is not of the form 'name = module:function'")
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / name
    attribute = function.partition(".")[0]
    text = PROGRAM.format(python=sys.executable, module=module, attribute=attribute, function=function)
    program.write_text(text, encoding="utf-8")
    program.chmod(0o755)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
