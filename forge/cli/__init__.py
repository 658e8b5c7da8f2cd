"""The `forge` command: the only package that uses argparse.

`main` selects the command, `commands` contains a module for each, `session` runs a build plan. May import all
other packages.
"""

__all__ = [
    "build_options",
    "colcon_options",
    "commands",
    "config",
    "main",
    "options",
    "preparation",
    "worker",
]
