"""`python -m forge` and the `forge` command."""

import sys

from forge.cli import main

if __name__ == "__main__":
    sys.exit(main())
