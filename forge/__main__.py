"""`python -m forge` and the `forge` command."""

import gc
import sys


def main() -> int:
    """Carry out the command of this process, which ends then; returns its exit code."""
    from forge import cli  # noqa: PLC0415  (once it is known where modules come from)

    code = cli.main()
    # At the end the interpreter looks for cycles among all that is left, for 20 ms after a large build. What
    # has to be closed is closed by now.
    gc.freeze()
    return code


if __name__ == "__main__":
    import _ros_forge

    _ros_forge.own_modules_first()
    sys.exit(main())
