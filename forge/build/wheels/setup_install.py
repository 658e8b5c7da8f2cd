"""Run `setup.py install` in the current folder as colcon does; argument: a JSON file with the request.

This module runs in the workspace's interpreter, which may not have forge. It has minimal imports and supports
Python 3.8. Python programs that the setup.py starts find the sitecustomize.py in the folder `children`.
"""

import contextlib
import json
import os
import sys
import warnings

TYPE_CHECKING = False  # importing typing would dominate the start-up time
if TYPE_CHECKING:
    from typing import Any

UNAVAILABLE = 100
"""The exit code without setuptools."""
OUTSIDE = "outside.txt"
"""The file next to the request that names a path outside the prefix to which the package would install."""
COMPILED = 101
"""The exit code for compiled modules of a package for another platform."""

_SCRIPT = """\
import sys
from {module} import {name}
if __name__ == "__main__":
    sys.exit({function}())
"""
_KINDS = ("lib", "scripts", "data", "headers")
_BUILD_COMMANDS = ("build", "build_py", "build_ext", "build_clib", "build_scripts")
_BUILD_FOLDERS = ("base", "lib", "purelib", "platlib", "temp", "scripts", "clib", "dir")
"""The options of these commands, without `build_`, that name folders of intermediate files."""


def main(path: str) -> None:
    """Run the setup.py, or setuptools alone if there is none."""
    with open(path, encoding="utf-8") as stream:
        request = json.load(stream)
    paths = (request["children"], os.environ.get("PYTHONPATH"))
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    # As with colcon, paths that setup.py computes from sys.prefix, and setuptools' defaults, are in the
    # prefix.
    sys.real_prefix = sys.prefix  # type: ignore[attr-defined]
    sys.prefix = sys.exec_prefix = request["prefix"]
    try:
        import setuptools
    except ImportError:
        sys.exit(UNAVAILABLE)
    if not getattr(setuptools, "__file__", None):  # a folder of this name
        sys.exit(UNAVAILABLE)
    warnings.filterwarnings("ignore", "setup.py install is deprecated")
    _adapt(request, os.path.join(os.path.dirname(path), OUTSIDE))
    sys.argv[:] = ["setup.py", *request["words"]]
    sys.path.insert(0, os.getcwd())
    setup = os.path.join(os.getcwd(), "setup.py")
    try:
        # As builds of wheels do, ignore setup_requires: its packages would be downloaded into the sources.
        from setuptools.build_meta import no_install_setup_requires  # type: ignore[attr-defined]
    except ImportError:
        no_install_setup_requires = contextlib.nullcontext
    with no_install_setup_requires():
        if not os.path.exists(setup):
            setuptools.setup()
            return
        with open(setup, "rb") as stream:
            code = compile(stream.read(), setup, "exec")
        module = type(sys)("__main__")
        module.__dict__.update(__file__=setup, __builtins__=__builtins__)
        sys.modules["__main__"] = module
        exec(code, module.__dict__)  # noqa: S102  (the purpose of this module)


def _adapt(request: "dict[str, Any]", outside: str) -> None:
    """Set the default folders, write fast scripts, and check where files are installed."""
    from distutils.cmd import Command
    from distutils.command.install import install
    from distutils.dist import Distribution
    from types import SimpleNamespace

    import setuptools.dist
    from setuptools.command import egg_info, install_egg_info, sdist

    select_scheme, run_command = install.select_scheme, Distribution.run_command
    ensure_finalized = Command.ensure_finalized
    moved: "dict[str, str]" = {}

    def select_own_scheme(self: "Any", name: str) -> None:
        """Set options that the package does not set: distributions' defaults vary (local/, dist-packages)."""
        site = os.path.join(self.install_base, request["site_packages"])
        python = "python{0}.{1}".format(*sys.version_info) + getattr(sys, "abiflags", "")
        headers = os.path.join(self.install_base, "include", python, self.distribution.get_name())
        folders = {"purelib": site, "platlib": site, "headers": headers, "data": self.install_base}
        folders["scripts"] = os.path.join(self.install_base, "bin")
        for kind, folder in folders.items():
            if getattr(self, "install_" + kind) is None:
                setattr(self, "install_" + kind, folder)
        select_scheme(self, name)

    def finalize_below_build_folder(self: "Any") -> None:
        """Move folders of intermediate files into the build folder, which has no files of an earlier build.

        In other commands, such options name inputs: they follow the build command that fills the folder.
        """
        ensure_finalized(self)
        # The package may name the class of a command freely.
        builds = any(self.distribution.command_obj.get(name) is self for name in _BUILD_COMMANDS)
        for option in _BUILD_FOLDERS:
            folder = getattr(self, "build_" + option, None)
            if not isinstance(folder, str) or folder.startswith(request["build"] + os.sep):
                continue
            folder = os.path.abspath(folder)
            if builds:
                moved.setdefault(folder, os.path.join(request["build"], "moved", str(len(moved))))
            if folder in moved:
                setattr(self, "build_" + option, moved[folder])

    def run_checked(self: "Any", command: str) -> None:
        """Run a command unless it would install files outside the prefix."""
        if command == "install" and request["pure"] and self.has_ext_modules():
            sys.exit(COMPILED)
        if command in {"install_" + kind for kind in _KINDS}:
            installing = self.get_command_obj(command)
            installing.ensure_finalized()
            base = installing.install_dir or ""
            files = (self.data_files or ()) if command == "install_data" else ()
            for folder in ("", *(entry[0] for entry in files if not isinstance(entry, str))):
                path = os.path.abspath(os.path.join(base, folder))
                if not (path + os.sep).startswith(request["prefix"] + os.sep):
                    with open(outside, "w", encoding="utf-8") as stream:
                        stream.write(path)
                    sys.exit(1)
        run_command(self, command)

    metadata = getattr(setuptools.dist, "metadata", None)
    if hasattr(metadata, "EntryPoints"):
        cached = _Metadata(metadata)
        for module in (setuptools.dist, egg_info, sdist):
            module.metadata = cached  # type: ignore[attr-defined]
    # The prefix has no files of an earlier build: files in the folder are unowned.
    install_egg_info.dir_util = SimpleNamespace(remove_tree=lambda *_, **__: None)  # type: ignore[attr-defined]
    Command.ensure_finalized = finalize_below_build_folder  # type: ignore[method-assign]
    install.select_scheme = select_own_scheme  # type: ignore[method-assign]
    Distribution.run_command = run_checked  # type: ignore[method-assign]
    try:
        from setuptools._scripts import ScriptWriter  # type: ignore[import-not-found]
    except ImportError:  # before 80
        from setuptools.command.easy_install import ScriptWriter  # type: ignore[attr-defined]
    ScriptWriter.template = _Template(ScriptWriter.template)


class _Metadata:
    """importlib.metadata for setuptools, which looks for plugins each time that it needs a command.

    Finding them means reading the metadata of all distributions on sys.path, which are the same each time.
    """

    def __init__(self, metadata: "Any") -> None:
        self._metadata = metadata
        self._found: "dict[tuple[str, ...], Any]" = {}

    def __getattr__(self, name: str) -> "Any":
        return getattr(self._metadata, name)

    def entry_points(self, **wanted: str) -> "Any":
        path = tuple(map(str, sys.path))
        if path not in self._found:
            self._found[path] = self._metadata.entry_points()
        return self._found[path].select(**wanted)


class _Template(str):
    """setuptools' template of scripts; the resulting scripts search for their distribution at each start."""

    __slots__ = ()

    def __mod__(self, variables: "Any") -> str:
        """Return a script that imports the function, or setuptools' own for a module without function."""
        # An EntryPoint of pkg_resources or of importlib.metadata.
        point = variables.get("ep")
        if point is None:  # releases before 80 that loop over the names, such as 79.0
            point = variables["dist"].get_entry_map(variables["group"])[variables["name"]]
        module = getattr(point, "module_name", None) or point.module
        names = point.attrs if hasattr(point, "attrs") else list(filter(None, (point.attr or "").split(".")))
        if not names:
            return str.__mod__(self, variables)
        return _SCRIPT.format(module=module, name=names[0], function=".".join(names))


if __name__ == "__main__":
    # Import nothing from the folder of this file.
    sys.path[:] = [entry for entry in sys.path if entry != os.path.dirname(os.path.abspath(__file__))]
    main(sys.argv[1])
