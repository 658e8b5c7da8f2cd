"""A local index of Python modules for tests: wheels in a folder, which pip and uv read instead of PyPI."""

import base64
import hashlib
import os
import shutil
import zipfile
from pathlib import Path

from uv import find_uv_bin

INSTALLERS = ("pip", "uv")


class Index:
    """Wheels below a folder, and the environment in which an installer has no other ones."""

    def __init__(self, root: Path, installer: str) -> None:
        self._root, self.installer = root, installer
        self.files = root / "files"
        self.files.mkdir(parents=True)

    def add(self, name: str, version: str, *requires: str, text: str = "", program: str = "") -> str:
        """Write a wheel with one module, whose `main` may be a program; return its hash."""
        module, info = name.lower(), f"{name}-{version}.dist-info"
        metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        files = {
            f"{module}.py": f"version = '{version}'\n{text}",
            f"{info}/METADATA": metadata + "".join(f"Requires-Dist: {each}\n" for each in requires),
            f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        }
        if program:
            files[f"{info}/entry_points.txt"] = f"[console_scripts]\n{program} = {module}:main\n"
        record = "".join(f"{path},{_hash(content)},{len(content)}\n" for path, content in files.items())
        files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n"
        path = self.files / f"{name}-{version}-py3-none-any.whl"
        with zipfile.ZipFile(path, "w") as archive:
            for file, content in files.items():
                archive.writestr(file, content)
        return f"sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}"

    def variables(self) -> dict[str, str | None]:
        """Return the environment, without an active one."""
        programs, empty = self._root / "programs", self._root / "no index"
        programs.mkdir(exist_ok=True)
        empty.mkdir(exist_ok=True)
        path = [each for each in os.environ["PATH"].split(os.pathsep) if not (Path(each) / "uv").exists()]
        if self.installer == "uv" and not (programs / "uv").exists():
            (programs / "uv").symlink_to(find_uv_bin())
        folder = str(self.files)
        return {
            **{"PIP_CONFIG_FILE": os.devnull, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": folder},
            **{"UV_NO_CONFIG": "1", "UV_DEFAULT_INDEX": empty.as_uri(), "UV_FIND_LINKS": folder},
            "UV_CACHE_DIR": str(self._root / "uv cache"),
            "PATH": os.pathsep.join([str(programs), *path]),
            **dict.fromkeys(("VIRTUAL_ENV", "CONDA_PREFIX", "PIP_CONSTRAINT")),
        }

    def remove(self) -> None:
        """Remove all wheels: there is no network anymore."""
        shutil.rmtree(self.files)
        self.files.mkdir()


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return "sha256=" + base64.urlsafe_b64encode(digest).decode().rstrip("=")
