"""Packages of all build types that install something of every sort and cost little to build.

The same for the same seed. What each package installs decides which hooks its environment gets.
"""

import random
from collections.abc import Iterator, Sequence

from tests.packages import manifest_text

NAMES = ("a", "bb", "B2", "x-y", "ab_msgs", "zz9", "q_lib", "m1")
TYPES = ("cmake", "ament_cmake", "ament_python")

SETUP = """from setuptools import setup

setup(
    name="{name}",
    version="0.1.0",
    packages=["{module}"],
    py_modules=[{modules}],
    package_data={{"{module}": ["words.txt"]}},
    data_files=[{data}],
    entry_points={{"console_scripts": [{scripts}]}},
    scripts=[{files}],
    zip_safe=True,
)
"""


def random_installs(chance: random.Random, types: Sequence[str] = TYPES) -> Iterator[tuple[str, str]]:
    """Yield the files of some packages of these build types, each needing some of those before it."""
    names = chance.sample(NAMES, chance.randrange(3, 6))
    # All build types in each workspace: together they show what one prefix for all does.
    kinds = [*types, *chance.choices(types, k=5)]
    for number, name in enumerate(names):
        needs = [
            f"<{chance.choice(('depend', 'exec_depend', 'build_depend', 'build_export_depend'))}>{need}</"
            for need in chance.sample(names[:number], chance.randrange(min(number, 2) + 1))
        ]
        lines = [f"{line}{line[1 : line.index('>')]}>" for line in needs]
        if chance.random() < 0.3:
            lines.append("<exec_depend>nobody-has-this</exec_depend>")
        home, kind = f"src/{name}_dir", kinds[number]
        tool = ["<buildtool_depend>ament_cmake</buildtool_depend>"] if kind == "ament_cmake" else []
        yield f"{home}/package.xml", manifest_text(name, *tool, *lines, build_type=kind)
        if kind == "ament_python":
            yield from _python(home, name, chance)
        else:
            yield from _cmake(home, name, chance, ament=kind == "ament_cmake")


def _cmake(home: str, name: str, chance: random.Random, *, ament: bool) -> Iterator[tuple[str, str]]:
    """Yield the files of a package without anything to compile."""
    choices = [
        ("libsome.so", f"lib{name}.so", "lib"),
        ("libother.so", f"lib{name}64.so", "lib64"),
        ("tool", f"{name}_tool", "bin"),
        ("tool", f"{name}_node", f"lib/{name}"),
        ("some.hpp", f"{name}.hpp", f"include/{name}"),
        ("Config.cmake", f"{name}-config.cmake", f"lib/cmake/{name}"),
        ("Find.cmake", f"Find{name}.cmake", f"share/{name}/cmake"),
        ("some.pc", f"{name}.pc", "lib/pkgconfig"),
        ("module.py", f"{name.replace('-', '_')}_extra.py", "lib/python${VERSION}/site-packages"),
    ]
    chosen = chance.sample(choices, chance.randrange(2, len(choices)))
    lines = ["cmake_minimum_required(VERSION 3.18)", f"project({name} NONE)"]
    lines.append("find_package(Python3 REQUIRED COMPONENTS Interpreter)")
    lines.append("set(VERSION ${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR})")
    if ament:
        lines.append("find_package(ament_cmake REQUIRED)")
    else:
        lines.append(f"install(FILES package.xml DESTINATION share/{name})")
    for source, target, folder in chosen:
        verb = "PROGRAMS" if source == "tool" else "FILES"
        lines.append(f"install({verb} {source} DESTINATION {folder} RENAME {target})")
        text = "#!/bin/sh\necho tool\n" if source == "tool" else "# text\n"
        yield f"{home}/{source}", text
    if chance.random() < 0.5:
        lines.append(f"install(DIRECTORY launch DESTINATION share/{name})")
        yield f"{home}/launch/deep/x.launch.py", "# launch\n"
    if ament:
        yield from _ament(home, name, chance, lines)
    if chance.random() < 0.4:
        lines.append(f"install(FILES mine.sh mine.dsv DESTINATION share/{name})")
        yield f"{home}/mine.sh", f"export MINE_{name.upper().replace('-', '_')}=sh\n"
        yield f"{home}/mine.dsv", f"set;MINE_{name.upper().replace('-', '_')};a word\n"
        ending = chance.choice(["sh", "dsv"])
        yield f"{home}/colcon.pkg", f"hooks: [share/{name}/mine.{ending}]\n"
    yield f"{home}/CMakeLists.txt", "\n".join([*lines, "ament_package()" if ament else ""])


def _ament(home: str, name: str, chance: random.Random, lines: list[str]) -> Iterator[tuple[str, str]]:
    """Add what only ament_cmake packages have; yields the files for that."""
    module = name.replace("-", "_")
    if chance.random() < 0.5:
        lines += ["find_package(ament_cmake_python REQUIRED)", f"ament_python_install_package({module})"]
        yield f"{home}/{module}/__init__.py", "VALUE = 1\n"
    if chance.random() < 0.5:
        lines.append("ament_environment_hooks(hook/own.dsv.in)")
        yield f"{home}/hook/own.dsv.in", f"prepend-non-duplicate;OWN_PATH;share/{name}\nset;OWN_WORD;w\n"
    if chance.random() < 0.5:
        lines.append("ament_environment_hooks(hook/script.sh)")
        yield f"{home}/hook/script.sh", f'export SCRIPT_{module.upper()}="$AMENT_CURRENT_PREFIX"\n'
    if chance.random() < 0.5:
        lines.append(f'ament_index_register_resource(kinds CONTENT "{name} has")')
    if chance.random() < 0.5:
        lines.append(f"ament_export_libraries({name})")


def _python(home: str, name: str, chance: random.Random) -> Iterator[tuple[str, str]]:
    """Yield the files of an ament_python package, some of which forget what the others say."""
    module = name.replace("-", "_")
    data = ['("share/{0}/launch", ["launch/x.launch.py"])']
    if chance.random() < 0.7:
        data.append('("share/ament_index/resource_index/packages", ["resource/{0}"])')
        data.append('("share/{0}", ["package.xml"])')
    told = {
        "modules": f'"{module}_single"' if chance.random() < 0.4 else "",
        "data": ", ".join(data).format(name),
        "scripts": f'"{name}_main = {module}:main"' if chance.random() < 0.7 else "",
        "files": '"scripts/plain"' if chance.random() < 0.4 else "",
    }
    yield f"{home}/setup.py", SETUP.format(name=name, module=module, **told)
    folders = f"[develop]\nscript_dir=$base/lib/{name}\n[install]\ninstall_scripts=$base/lib/{name}\n"
    if told["modules"] or not told["scripts"]:
        # Without it programs go to bin.
        yield f"{home}/setup.cfg", folders
    yield f"{home}/{module}/__init__.py", "def main():\n    print('main')\n"
    yield f"{home}/{module}/words.txt", "words\n"
    yield f"{home}/{module}_single.py", "VALUE = 1\n"
    yield f"{home}/launch/x.launch.py", "# launch\n"
    yield f"{home}/resource/{name}", ""
    yield f"{home}/scripts/plain", "#!/usr/bin/env python3\nprint('plain')\n"
