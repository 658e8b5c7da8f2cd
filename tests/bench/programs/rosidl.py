"""Let Debian's rosidl write C and C++ of a package: PREFIX DEFINITIONS OUT PACKAGE...

A program of its own, run by the Python that Debian's packages are for: .msg to .idl, then each generator, in
one process, which is less than what rosidl's CMake code starts.
"""

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def main(prefix: str, definitions: str, out: str, *packages: str) -> None:
    """Convert and generate each package."""
    adapter: Any = import_module("rosidl_adapter.msg")
    for package in packages:
        source, idl = Path(definitions) / package, Path(out).absolute() / "idl" / package
        names = sorted(path.name for path in (source / "msg").glob("*.msg"))
        for name in names:
            adapter.convert_msg_to_idl(source, package, Path("msg") / name, idl / "msg")
        for language in ("c", "cpp"):
            output = Path(out) / language / package
            output.mkdir(parents=True)
            arguments = {
                "package_name": package,
                "output_dir": str(output),
                "template_dir": f"{prefix}/share/rosidl_generator_{language}/resource",
                "idl_tuples": [f"{idl}:msg/{name[:-4]}.idl" for name in names],
                "ros_interface_dependencies": [],
                "target_dependencies": [],
            }
            path = Path(out) / f"{package}_{language}.json"
            path.write_text(json.dumps(arguments), encoding="utf-8")
            generator: Any = import_module(f"rosidl_generator_{language}")
            getattr(generator, f"generate_{language}")(str(path))


if __name__ == "__main__":
    main(*sys.argv[1:])
