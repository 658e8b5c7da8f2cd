"""Start forge without importing modules of the same name from PYTHONPATH.

The entry point of the command `forge` and of the processes that forge starts for itself:
`python .../_ros_forge.py [-m forge.MODULE] [ARGUMENT ...]`. In a sourced workspace, PYTHONPATH contains every
Python package, and one may be called `forge`, or `installer` like a library of forge. None can have the name
of this file, because package names begin with a letter. PYTHONPATH itself is left unchanged for the programs
that forge starts.
"""

import os
import sys

HOME = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120  (pathlib would double the start)


def main() -> int:
    """Run the command line of this process and return its exit code."""
    try:
        own_modules_first()
        from forge.__main__ import main as command

        return command()
    except KeyboardInterrupt:  # before the command handles interrupts
        return 130


def own_modules_first() -> None:
    """Put this forge and its libraries before PYTHONPATH and the current folder on the module search path."""
    sys.path.insert(0, HOME)
    import forge  # noqa: F401  (the one beside this file, wherever that is)

    sys.path[:] = _ordered(sys.path[1:])


def _ordered(paths: "list[str]") -> "list[str]":
    """Return the module search path without the program's own folder, with the PYTHONPATH folders last.

    The folder of this forge, which also contains its libraries, comes right after Python's own modules.
    """
    if paths[:1] and paths[0] in {"", os.path.dirname(os.path.realpath(sys.argv[0])), _current()}:  # noqa: PTH120
        paths = paths[1:]
    said = "" if sys.flags.ignore_environment else os.environ.get("PYTHONPATH", "")
    named = {os.path.abspath(path) for path in said.split(os.pathsep)} if said else set()  # noqa: PTH100
    python = os.path.dirname(os.__file__)  # noqa: PTH120
    own = [path for path in paths if path not in named or path == python]
    if HOME not in own:
        pythons = [index for index, path in enumerate(own) if path in {python, f"{python}/lib-dynload"}]
        own.insert(pythons[-1] + 1 if pythons else 0, HOME)
    return own + [path for path in paths if path not in own]


def _current() -> str:
    try:
        return os.getcwd()  # noqa: PTH109
    except OSError:
        return ""


if __name__ == "__main__":
    if sys.argv[1:2] == ["-m"]:
        own_modules_first()
        import runpy

        sys.argv = sys.argv[2:]
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    else:
        sys.exit(main())
