"""Fuzz parsers for as long as one likes: python -m tests.fuzz SECONDS [NAME...].

Each harness is run in turn, and an input that breaks it is shown and kept in the folder 'fuzz'. With
atheris, which is not among what tests need (pip install atheris), new inputs are made from those that
reach new code; without it from accidents alone.
"""

from __future__ import annotations

import argparse
import importlib.util
import random
import subprocess
import sys
import time
from pathlib import Path

FOLDER = Path("fuzz")


def main() -> int:
    """Give every harness its share of the time; returns 1 when one of them broke."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    if len(options.names) == 1:
        return _guided(options.names[0], options.seconds)
    # Imported here, since a guided run must watch forge being imported.
    from tests.fuzz.harnesses import HARNESSES

    names = options.names or list(HARNESSES)
    broken = [name for name in names if not _run(name, options.seconds / len(names))]
    print(f"{len(names) - len(broken)} of {len(names)} parsers held; broken: {', '.join(broken) or 'none'}")
    return int(bool(broken))


def _run(name: str, seconds: float) -> bool:
    """Run one harness in a process of its own: a guided run ends its process."""
    if importlib.util.find_spec("atheris") is None:
        return _at_random(name, seconds)
    argv = [sys.executable, "-m", "tests.fuzz", str(seconds), name]
    return subprocess.run(argv, check=False).returncode == 0


def _guided(name: str, seconds: float) -> int:
    """Let atheris make inputs; it ends the process itself."""
    import atheris  # type: ignore[import-not-found,import-untyped,unused-ignore]

    with atheris.instrument_imports(include=["forge"]):
        from tests.fuzz.food import SEEDS
        from tests.fuzz.harnesses import HARNESSES
    corpus = FOLDER / name
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(SEEDS[name]):
        (corpus / f"seed_{number}").write_bytes(seed)
    words = [f"-max_total_time={int(seconds) or 1}", "-timeout=20", "-rss_limit_mb=2048", "-max_len=4096"]
    atheris.Setup([sys.argv[0], *words, f"-artifact_prefix={FOLDER}/{name}-", str(corpus)], HARNESSES[name])
    atheris.Fuzz()
    return 0


def _at_random(name: str, seconds: float) -> bool:
    from tests.fuzz.food import spoilt
    from tests.fuzz.harnesses import HARNESSES

    chance = random.Random(time.time_ns())
    end, count = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        data = spoilt(name, chance)
        try:
            HARNESSES[name](data)
        except BaseException as error:
            FOLDER.mkdir(exist_ok=True)
            (FOLDER / f"{name}-crash").write_bytes(data)
            print(f"{name}: {type(error).__name__}: {error}, given {data!r}")
            return False
        count += 1
    print(f"{name}: {count} inputs")
    return True


if __name__ == "__main__":
    sys.exit(main())
