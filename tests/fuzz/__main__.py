"""Fuzz parsers with coverage guidance: python -m tests.fuzz SECONDS [NAME...].

This needs atheris, which is not among the test dependencies. Inputs that break a harness are kept in the
folder 'fuzz'.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
from pathlib import Path

FOLDER = Path("fuzz")


def main() -> int:
    """Run each harness for an equal share of the time; return 1 if one of them failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        print("atheris is not installed: pip install atheris")
        return 0
    if len(options.names) == 1:
        run(options.names[0], int(options.seconds) or 1)
    from tests.fuzz.harnesses import HARNESSES

    names = options.names or list(HARNESSES)
    argv = [sys.executable, "-m", "tests.fuzz", str(options.seconds / len(names))]
    failed = [name for name in names if subprocess.run([*argv, name], check=False).returncode]
    print(f"{len(names) - len(failed)} of {len(names)} parsers passed; failed: {', '.join(failed) or 'none'}")
    return int(bool(failed))


def run(name: str, seconds: int) -> None:
    """Run one harness with atheris, which ends the process."""
    import atheris  # type: ignore[import-not-found,import-untyped,unused-ignore]

    with atheris.instrument_imports(include=["forge"]):
        from tests.fuzz.food import SEEDS
        from tests.fuzz.harnesses import HARNESSES
    corpus = FOLDER / name
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(SEEDS[name]):
        (corpus / f"seed_{number}").write_bytes(seed)
    words = [f"-max_total_time={seconds}", "-timeout=20", "-rss_limit_mb=2048", "-max_len=4096"]
    atheris.Setup([sys.argv[0], *words, f"-artifact_prefix={FOLDER}/{name}-", str(corpus)], HARNESSES[name])
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
