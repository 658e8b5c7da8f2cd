"""Run `make quick` without plugins and their tests: `python -m tests.without_plugins [NAME ...]`.

Without names, all plugins are left out first, then each.
"""

import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLUGINS = sorted(path.parent.name for path in (ROOT / "forge/plugins").glob("*/__init__.py"))
ALL = "any_plugin"
"""Stands for all plugins at once."""


def copy_without(plugin: str, copy: Path, *entries: str) -> Path:
    """Copy files and folders of the repository, without a plugin or ALL, and its tests; return the copy."""
    for entry in entries:
        if (ROOT / entry).is_dir():
            shutil.copytree(ROOT / entry, copy / entry)
        else:
            shutil.copy2(ROOT / entry, copy)
    for folder in ("forge/plugins", "tests/plugins"):
        for name in PLUGINS if plugin == ALL else [plugin]:
            shutil.rmtree(copy / folder / name, ignore_errors=True)
    return copy


def passes_without(plugin: str) -> bool:
    """Tell whether `make quick` passes in a copy of the repository without a plugin."""
    with tempfile.TemporaryDirectory(prefix=f"without-{plugin}-") as folder:
        entries = [path.name for path in ROOT.iterdir() if not path.name.startswith(".")]
        copy = copy_without(plugin, Path(folder).resolve(), *entries)
        for peers in ROOT.glob(".*-peers"):
            (copy / peers.name).symlink_to(peers)
        # An environment with the packages of this one, but with forge from the copy.
        venv.create(copy / ".venv", symlinks=True)
        (packages,) = copy.glob(".venv/lib/python*/site-packages")
        (packages / "packages.pth").write_text(f"{copy}\n{sysconfig.get_path('purelib')}\n", encoding="utf-8")
        for program in Path(sysconfig.get_path("scripts")).iterdir():
            here = copy / ".venv/bin" / program.name
            if program.name == "forge":
                text = program.read_text(encoding="utf-8")
                here.write_text(text.replace(sys.executable, str(here.with_name("python"))), encoding="utf-8")
                here.chmod(0o755)
            elif not here.exists():
                here.symlink_to(program)
        (copy / ".venv/.ready").touch()
        print(f"\n=== without {plugin}", flush=True)
        return subprocess.run(["make", "quick"], cwd=copy, check=False).returncode == 0


def main(names: list[str]) -> int:
    """Print the plugins without which tests fail; return 1 if there are any."""
    failed = [name for name in names or [ALL, *PLUGINS] if not passes_without(name)]
    print(f"\nfailed without: {', '.join(failed)}" if failed else "\npassed without each plugin")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
