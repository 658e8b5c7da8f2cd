"""Workspaces of any shape, the same for the same seed: odd names, marks, conditions, loops and gaps."""

import random
from dataclasses import dataclass, field
from pathlib import Path

from tests.packages import manifest_text

NAMES = ("a", "b", "c", "bb", "B2", "x-y", "a__b", "ab_msgs", "zz9", "q_lib", "m1", "m2", "n_a", "o")
_TAGS = ("depend", "build_depend", "exec_depend", "test_depend", "build_export_depend", "buildtool_depend")
_FOLDERS = ("", "src/", "src/deep/er/", "src/other/", "two/")
_CONDITIONS = (
    "$ROS_VERSION == 2",
    "$ROS_VERSION == 1",
    "$ROS_DISTRO >= foxy",
    "$NOBODY == ''",
    "a == b or a == a",
)


@dataclass(slots=True)
class Shape:
    """What a workspace may have beyond packages in folders."""

    cycles: bool = False
    duplicates: bool = False
    plain: bool = True
    faults: bool = True


@dataclass(slots=True)
class _Writer:
    """Writes one workspace."""

    root: Path
    chance: random.Random
    shape: Shape
    names: list[str] = field(default_factory=list)

    def write(self) -> None:
        self.root.mkdir(parents=True, exist_ok=True)
        for name in self.chance.sample(NAMES, self.chance.randrange(1, 11)):
            self.package(name)
            self.names.append(name)
        if self.shape.duplicates and self.names:
            # One that needs nothing: colcon lets a package need its own name over others, forge does not.
            name = self.chance.choice(self.names)
            self.text(self.root / "again" / "package.xml", [manifest_text(name)])
        if self.shape.cycles and self.names:
            self.close_a_circle()
        if self.shape.faults:
            self.traps()

    def package(self, name: str, parent: str | None = None) -> None:
        folder = self.root / ((parent or self.chance.choice(_FOLDERS)) + f"{name}_dir")
        folder.mkdir(parents=True, exist_ok=True)
        kind = self.chance.choice(
            ("ros", "ros", "ros", "cmake", "cfg", "pkg") if self.shape.plain else ("ros",)
        )
        needs = [need for need in self.needs() if need != name]
        if kind == "cmake":
            lines = [
                f"project({name} NONE)  # project(no)",
                *(f"find_package({need} QUIET)" for need in needs),
            ]
            self.text(folder / "CMakeLists.txt", lines)
        elif kind == "cfg":
            self.text(folder / "setup.py", ["from setuptools import setup", "setup()"])
            requires = ["install_requires =", *(f"    {need}>=1" for need in needs)] if needs else []
            lines = ["[metadata]", f"name = {name}", "version = 1.2.3", "[options]", *requires]
            self.text(folder / "setup.cfg", lines)
        else:
            self.text(folder / "package.xml", [self.manifest(name, needs)])
            if kind == "pkg":
                said = [f"cmake-args: [-DX={name}]", "dependencies: [zz9, nobody]", "hooks: [share/x/h.sh]"]
                self.text(
                    folder / "colcon.pkg", said[: self.chance.randrange(1, 4)] if name != "zz9" else said[:1]
                )

    def manifest(self, name: str, needs: list[str]) -> str:
        lines = []
        for need in needs:
            tag = self.chance.choice(_TAGS)
            condition = self.chance.choice(_CONDITIONS)
            attribute = f' condition="{condition}"' if self.chance.random() < 0.3 else ""
            lines.append(f"<{tag}{attribute}>{need}</{tag}>")
        if self.chance.random() < 0.2:
            lines.append("<member_of_group>a_group</member_of_group>")
        elif self.chance.random() < 0.1 and not self.names:
            lines.append("<group_depend>a_group</group_depend>")
        build_type = self.chance.choice(("ament_cmake", "ament_cmake", "ament_python", "cmake"))
        return manifest_text(name, *dict.fromkeys(lines), build_type=build_type)

    def needs(self) -> list[str]:
        """Return names of earlier packages, so that nothing needs itself over others, and of nobody."""
        known = [*self.names, "nobody", "also-nobody"]
        return self.chance.sample(known, min(len(known), self.chance.randrange(4)))

    def close_a_circle(self) -> None:
        first, last = self.names[0], self.names[-1]
        self.text(
            self.root / "circle1" / "package.xml", [manifest_text("circle1", "<depend>circle2</depend>")]
        )
        needs = ("<depend>circle1</depend>", f"<depend>{first}</depend>")
        self.text(self.root / "circle2" / "package.xml", [manifest_text("circle2", *needs)])
        self.text(
            self.root / "after" / "package.xml",
            [manifest_text("after", "<test_depend>circle1</test_depend>")],
        )
        self.names += ["circle1", last]

    def traps(self) -> None:
        """Write folders that look like packages, some of which are hidden in one of many ways."""
        marks = ("COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE", "_setup_util.py", "manifest.xml")
        mark = self.chance.choice(marks)
        self.text(self.root / "hidden" / mark, [""])
        self.text(self.root / "hidden" / "below" / "package.xml", [manifest_text("hidden")])
        self.text(self.root / "src" / ".dot" / "package.xml", [manifest_text("dot")])
        self.text(self.root / "outer" / "package.xml", [manifest_text("outer")])
        self.text(self.root / "outer" / "inner" / "package.xml", [manifest_text("inner")])
        (self.root / "outer_again").symlink_to(self.root / "outer")
        (self.root / "round").symlink_to(self.root)
        (self.root / "gone").symlink_to(self.root / "nowhere")
        dangling = self.root / "src" / "dangling"
        self.text(dangling / "package.xml", [manifest_text("dangling")])
        (dangling / self.chance.choice(("COLCON_IGNORE", "AMENT_IGNORE"))).symlink_to("nowhere")
        self.text(self.root / "broken" / "package.xml", ["<package>"])

    def text(self, path: Path, lines: list[str]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_random_workspace(root: Path, chance: random.Random, shape: Shape) -> Path:
    """Write a workspace below `root` and return that."""
    _Writer(root, chance, shape).write()
    return root


def random_options(chance: random.Random) -> list[str]:
    """Return up to three selection options with names that are often there."""
    options: list[str] = []
    names = (*NAMES, "outer", "circle1", "nobody")
    for option in chance.sample(_OPTIONS, chance.randrange(4)):
        words = chance.sample(names, chance.randrange(1, 4))
        if option.endswith("-regex"):
            words = [chance.choice((".*", "a", "[a-m]", ".*_", "B", "nothing"))]
        elif option in {"--packages-start", "--packages-end"}:
            words = words[:1]
        elif option == "--packages-above-depth":
            words = [str(chance.randrange(3)), *words]
        elif chance.random() < 0.1:
            words = []
        options += [option, *words]
    return options


_OPTIONS = tuple(
    f"--packages-{word}"
    for word in (
        *("select", "skip", "select-regex", "skip-regex", "up-to", "up-to-regex", "above", "above-depth"),
        *("above-and-dependencies", "select-by-dep", "skip-by-dep", "skip-up-to", "start", "end", "ignore"),
        "ignore-regex",
    )
)
