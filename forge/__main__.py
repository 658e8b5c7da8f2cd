"""`python -m forge` and the `forge` command."""

import gc
import os
import sys


def main() -> int:
    """Run the command line of this process and return its exit code."""
    _insist_on_utf8()
    # Commands create many objects and few cycles; searching for them in large builds takes noticeable time.
    gc.set_threshold(200_000)
    # Import late: the module search path is complete only now.
    from forge.base.signals import open_standard_streams
    from forge.cli import main

    open_standard_streams()
    code = main.main()
    # At exit, the interpreter would search all remaining objects for cycles: 20 ms after a large build. All
    # resources are already closed.
    gc.freeze()
    return code


def _insist_on_utf8() -> None:
    """Restart in UTF-8 mode if Python uses another encoding for paths: all output of forge is UTF-8.

    This happens in old locales, and in the C locale with PYTHONUTF8=0.
    """
    if sys.getfilesystemencoding() == "utf-8" or sys.flags.utf8_mode:
        return
    environment = {**os.environ, "PYTHONUTF8": "1"}
    os.execve(sys.executable, [sys.executable, "-X", "utf8", *sys.orig_argv[1:]], environment)  # noqa: S606


if __name__ == "__main__":
    import _ros_forge

    _ros_forge.own_modules_first()
    sys.exit(main())
