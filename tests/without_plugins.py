"""Run `make quick` and an e2e build without plugins and their tests.

`python -m tests.without_plugins` leaves out all plugins, then one group after the other; names choose plugins
or groups. The plugins are numbered, and a group has those whose numbers have the same value of one bit. Two
numbers differ in at least one bit, so for each pair of plugins one run has the second without the first: a
plugin that needs another one is found in twelve runs.
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
GROUPS = {
    f"bit_{bit}_is_{value}": [name for number, name in enumerate(PLUGINS) if number >> bit & 1 == value]
    for bit in range((len(PLUGINS) - 1).bit_length())
    for value in (0, 1)
}
BUILD = "tests/e2e/test_examples.py::test_python_reads_messages_printed_by_cpp[isolated]"
"""Builds the example workspace and runs its programs."""


def left_out(name: str) -> list[str]:
    """Return the plugins that the name of a plugin, of a group, or ALL stands for."""
    return PLUGINS if name == ALL else GROUPS.get(name, [name])


def copy_without(name: str, copy: Path, *entries: str) -> Path:
    """Copy files and folders of the repository, without a plugin, a group or ALL; return the copy.

    The tests of these plugins are left out, too.
    """
    for entry in entries:
        if (ROOT / entry).is_dir():
            shutil.copytree(ROOT / entry, copy / entry)
        else:
            shutil.copy2(ROOT / entry, copy)
    for folder in ("forge/plugins", "tests/plugins"):
        for plugin in left_out(name):
            shutil.rmtree(copy / folder / plugin, ignore_errors=True)
    return copy


def passes_without(name: str) -> bool:
    """Tell whether the tests pass in a copy of the repository without a plugin, a group or ALL."""
    with tempfile.TemporaryDirectory(prefix=f"without-{name}-") as folder:
        entries = [path.name for path in ROOT.iterdir() if not path.name.startswith(".")]
        copy = copy_without(name, Path(folder).resolve(), *entries)
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
        print(f"\n=== without {name}: {' '.join(left_out(name))}", flush=True)
        commands = ["make", "quick"], [str(copy / ".venv/bin/python"), "-m", "pytest", BUILD]
        return not any([subprocess.run(argv, cwd=copy, check=False).returncode for argv in commands])


def main(names: list[str]) -> int:
    """Print the plugins without which tests fail; return 1 if there are any."""
    failed = [name for name in names or [ALL, *GROUPS] if not passes_without(name)]
    print(f"\nfailed without: {', '.join(failed)}" if failed else "\npassed without these plugins")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
