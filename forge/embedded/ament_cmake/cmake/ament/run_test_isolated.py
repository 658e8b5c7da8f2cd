"""Run a test as run_test.py does, in a ROS domain that no other test of this machine uses meanwhile.

The domain is held by a lock on a local port; DISABLE_ROS_ISOLATION leaves everything as it is, and a
ROS_DOMAIN_ID that is set already wins.
"""

# ruff: noqa: INP001  (a program that CMake runs, not a module)

from __future__ import annotations

import os
import socket
import sys
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import run_test

FIRST_PORT = 22119
DOMAINS = range(1, 101)  # domain 0 is where people work


def main(words: list[str]) -> int:
    """Run the test in a domain of its own."""
    with ExitStack() as stack:
        if not os.environ.get("DISABLE_ROS_ISOLATION") and not os.environ.get("ROS_DOMAIN_ID"):
            for domain in DOMAINS:
                lock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
                try:
                    lock.bind(("127.0.0.1", FIRST_PORT + domain))
                except OSError:
                    continue
                os.environ["ROS_DOMAIN_ID"] = str(domain)
                break
        return run_test.main(words)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
