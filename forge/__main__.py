"""`python -m forge` and the `forge` command."""

import gc
import os
import sys


def main() -> int:
    """Carry out the command of this process, which ends then; returns its exit code."""
    _insist_on_utf8()
    # A start makes many objects and no garbage: looking for it would take a tenth of a short command.
    gc.set_threshold(50_000)
    # Here, once it is known where modules come from.
    from forge.base.signals import open_standard_streams
    from forge.cli import main

    open_standard_streams()
    code = main.main()
    # At the end the interpreter looks for cycles among all that is left, for 20 ms after a large build. What
    # has to be closed is closed by now.
    gc.freeze()
    return code


def _insist_on_utf8() -> None:
    """Start anew in UTF-8 mode where Python encodes paths otherwise: all that forge writes is UTF-8.

    That is so in old locales, and in the C locale when PYTHONUTF8 is 0.
    """
    if sys.getfilesystemencoding() == "utf-8" or sys.flags.utf8_mode:
        return
    environment = {**os.environ, "PYTHONUTF8": "1"}
    os.execve(sys.executable, [sys.executable, "-X", "utf8", *sys.orig_argv[1:]], environment)  # noqa: S606


if __name__ == "__main__":
    import _ros_forge

    _ros_forge.own_modules_first()
    sys.exit(main())
