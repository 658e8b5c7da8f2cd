"""Unpack Debian's ament, rosidl and Fast-CDR into a folder of their own: `python debian.py FOLDER`.

Nothing is installed: below /usr they would be an underlay of every workspace. Needs apt-get and dpkg and no
rights; on a machine without them it says so, and the bench goes on without these peers.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PACKAGES = """
    ament-cmake ament-cmake-core ament-cmake-python python3-ament-cmake-test python3-ament-package
    rosidl-cmake rosidl-generator-c-cpp python3-rosidl librosidl-runtime-c-cpp-dev librosidl-runtime-c0d
    librosidl-typesupport-interface-dev librosidl-typesupport-introspection-c-cpp-dev
    librcutils-dev librcutils1d libfastcdr-dev libfastcdr1
    python3-catkin-pkg python3-dateutil python3-docutils python3-empy python3-lark python3-pkg-resources
    python3-pyparsing python3-six
""".split()
"""The generators and what they need, by Debian's names; what every machine has is left out."""


def unpack(folder: Path) -> None:
    """Fetch and unpack all packages; raises CalledProcessError when one cannot be had."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as archives:
        subprocess.run(
            ["apt-get", "download", "-qq", "-o", "APT::Sandbox::User=root", *PACKAGES],
            cwd=archives,
            check=True,
        )
        for archive in sorted(Path(archives).glob("*.deb")):
            subprocess.run(["dpkg", "-x", archive, folder], check=True)


def main(folder: str) -> int:
    """Unpack, or say why not; never an error, as the bench runs without."""
    if not (shutil.which("apt-get") and shutil.which("dpkg")):
        print("this machine has no apt-get and dpkg: Debian's rosidl and ament stay away", file=sys.stderr)
        return 0
    try:
        unpack(Path(folder))
    except subprocess.CalledProcessError as error:
        print(f"Debian's rosidl and ament stay away: {error}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
