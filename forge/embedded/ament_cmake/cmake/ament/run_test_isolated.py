"""Run a test as run_test.py does, in a ROS domain that no concurrent test on this host uses.

A local port locks the domain. DISABLE_ROS_ISOLATION disables this, and an existing ROS_DOMAIN_ID has
precedence.
"""

from __future__ import annotations

import os
import socket
import sys
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import run_test

FIRST_PORT = 22119
DOMAINS = range(1, 101)  # domain 0 is the default for users


def main(words: list[str]) -> int:
    """Run the test in an unused domain."""
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
