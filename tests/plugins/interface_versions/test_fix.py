"""`forge interface fix` makes valid definitions of those of ROS 1, and shows first what it would change."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.model import Source
from forge.interfaces.read.parsing import parse_leniently
from forge.plugins.interface_versions.rewriting import rewritten, type_name
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

LINES: Mapping[str, tuple[str, str]] = {
    "Header": ("Header header", "std_msgs/Header header"),
    "time and duration": (
        "time a\nduration[4]  b",
        "builtin_interfaces/Time a\nbuiltin_interfaces/Duration[4]  b",
    ),
    "a field": ("float64 linearVelX # m/s", "float64 linear_vel_x # m/s"),
    "underscores": ("int8 __a\nint8 b__c_", "int8 a\nint8 b_c"),
    "a keyword": ("bool class", "bool class_value"),
    "constants": ("int8 kMax=1\nint8 MODE_A_ = 2\nint8 OK=3", "int8 K_MAX=1\nint8 MODE_A = 2\nint8 OK=3"),
    "a text that looks like a field": ("string S=Header badName", "string S=Header badName"),
    "leading blanks": ("  int8\tX", "int8\tx"),
    "a renamed type": ("my_point[] p\nq/my_point r\np/my_point s", "MyPoint[] p\nq/my_point r\np/MyPoint s"),
    "what is valid": (
        "string<=5[<=2] a 'x'\n# Header b\nq/Header c",
        "string<=5[<=2] a 'x'\n# Header b\nq/Header c",
    ),
    "the prefix of an enumeration": (
        "# enum: MODE__*\nint8 m\nint8 n  # enum: kMode_*\nint8 MODE__A=1 # enum: X__*\nint8 kMode_B=2",
        "# enum: MODE_*\nint8 m\nint8 n  # enum: K_MODE_*\nint8 MODE_A=1 # enum: X__*\nint8 K_MODE_B=2",
    ),
    "a name that is taken": ("int8 aB\nint8 a_b", "int8 aB\nint8 a_b"),
    "two names that become one": ("int8 aB\nint8 AB", "int8 a_b\nint8 ab"),
}


@pytest.mark.parametrize("case", LINES)
def test_invalid_lines_are_corrected(case: str) -> None:
    text, expected = LINES[case]
    assert rewritten(text, "p", {"my_point"}, {"p/my_point": "MyPoint"})[0] == expected


def test_names_are_unique_per_section() -> None:
    text, renamed = rewritten("int8 X\r\n-----\r\nint8 X\r\nint8 x\r\n", "p", (), {})
    assert text == "int8 x\r\n---\r\nint8 X\r\nint8 x\r\n"
    assert [(each.old, each.new) for each in renamed] == [("X", "x")]


def test_a_header_type_of_the_package_takes_precedence() -> None:
    assert rewritten("Header h", "p", {"Header"}, {})[0] == "Header h"


@given(
    st.lists(
        st.from_regex(r"(u?int8|Header|time)(\[\])? [A-Za-z_]{1,6}( ?= ?1)?", fullmatch=True), max_size=5
    )
)
def test_fixing_is_idempotent(lines: list[str]) -> None:
    once, _ = rewritten("\n".join(lines), "p", (), {})
    assert rewritten(once, "p", (), {}) == (once, [])


@given(st.from_regex(r"[A-Za-z][A-Za-z_0-9]{0,9}", fullmatch=True))
def test_a_single_field_becomes_valid(name: str) -> None:
    text, _ = rewritten(f"int8 {name}\n", "p", (), {})
    assert parse_leniently(Source("p", "msg/M.msg", Path("M.msg"), text))[1] == []


@pytest.mark.parametrize(
    ("stem", "name"),
    [("foo_bar", "FooBar"), ("fooBar", "FooBar"), ("FOO", "FOO"), ("3d", "3d"), ("a-b", "AB")],
)
def test_files_get_the_names_of_types(stem: str, name: str) -> None:
    assert type_name(stem) == name


FILES = {
    "src/p/package.xml": manifest_text("p"),
    "src/p/CMakeLists.txt": "add_message_files(FILES my_point.msg Track.msg)\n",
    "src/p/msg/my_point.msg": "float32 X\n",
    "src/p/msg/Track.msg": "Header header\nmy_point[] points\n",
}


def test_changes_are_shown_before_they_are_written(forge: Forge, tree: Tree) -> None:
    root = tree(FILES)
    shown = forge("interface", "fix", "src", cwd=root)
    assert shown.code == 1
    assert "rename src/p/msg/my_point.msg => src/p/msg/MyPoint.msg\n" in shown.out
    assert "+std_msgs/Header header\n+MyPoint[] points\n" in shown.out
    assert (root / "src/p/msg/my_point.msg").read_text() == "float32 X\n"
    ran = forge("interface", "fix", "src", "--write", cwd=root)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == (
        "p: declare the dependencies of the definitions: forge add std_msgs\n"
        "p: in CMakeLists.txt, write MyPoint.msg instead of my_point.msg\n"
        "p: update code that uses MyPoint: X -> x\n"
        "changed 2 files of 2\n"
    )
    assert sorted(path.name for path in (root / "src/p/msg").iterdir()) == ["MyPoint.msg", "Track.msg"]
    assert (root / "src/p/msg/Track.msg").read_text() == "std_msgs/Header header\nMyPoint[] points\n"
    assert forge("interface", "generate", "--package", "p", "--output", "out", "src/p", cwd=root).code == 0
    assert forge("interface", "fix", "src", cwd=root).out.endswith("would change 0 files of 2\n")


def test_other_packages_of_the_workspace_use_the_new_names(forge: Forge, tree: Tree) -> None:
    """And nothing else of them changes, unless they are named, too."""
    user = "p/my_point[] points # p/my_point\nint8 X\nHeader h\n"
    other = {"src/q/package.xml": manifest_text("q"), "src/q/msg/User.msg": user}
    root = tree({**FILES, **other, "src/q/msg/Other.msg": "int8 Y\n"})
    ran = forge("interface", "fix", "src/p", cwd=root)
    assert "+p/MyPoint[] points # p/my_point\n" in ran.out
    assert ran.out.endswith("would change 3 files of 3\n")
    assert forge("interface", "fix", "src/p", "--write", cwd=root).code == 0
    assert (root / "src/q/msg/User.msg").read_text() == user.replace("p/my_point[]", "p/MyPoint[]")
    root = tree({f"again/{path}": text for path, text in {**FILES, **other}.items()}) / "again"
    assert forge("interface", "fix", "src", "--write", cwd=root).code == 0
    assert "p/MyPoint[] points # p/my_point\nint8 x\nstd_msgs" in (root / "src/q/msg/User.msg").read_text()


def test_strings_whose_value_differs_from_ros1_are_reported(forge: Forge, tree: Tree) -> None:
    """There, quotes and what looks like a comment belong to a value."""
    definition = "string A='x'\nstring B= b # c\nstring C=plain\nint8 D=1 # one\n"
    root = tree({"p/srv/do_it.srv": f"{definition}---\nstring kE=a\\\\b\n"})
    for words in ((), ("--write",)):
        said = forge("interface", "fix", "p", *words, cwd=root).out
        assert said.count("in ROS 1") == 3
        assert "p: the constant A of DoIt is 'x'; in ROS 1, it was \"'x'\"\n" in said
        assert "p: the constant B of DoIt is 'b'; in ROS 1, it was 'b # c'\n" in said
        assert "p: the constant K_E of DoIt is 'a\\\\b'; in ROS 1, it was 'a\\\\\\\\b'\n" in said
    assert "in ROS 1" not in forge("interface", "fix", "p", cwd=root).out


def test_remaining_errors_are_reported(forge: Forge, tree: Tree) -> None:
    root = tree({**FILES, "src/p/msg/Bad.msg": "int8 aB\nint8 a_b\nint99 x\n"})
    ran = forge("interface", "fix", "src", cwd=root)
    assert ran.code == 2
    assert "src/p/msg/Bad.msg:1:6: error: invalid field name 'aB'" in ran.err
    assert "src/p/msg/Bad.msg:3:1: error: unknown type 'int99'" in ran.err


def test_a_file_that_cannot_be_read_does_not_keep_others_from_being_fixed(forge: Forge, tree: Tree) -> None:
    root = tree({"p/msg/Good.msg": "int32 X\n", "p/msg/Latin.msg": ""})
    (root / "p/msg/Latin.msg").write_bytes(b"int32 x  # caf\xe9\n")
    ran = forge("interface", "fix", "p", "--write", cwd=root)
    assert ran.code == 2
    assert "changed 1 file of 1" in ran.out
    assert "p/msg/Latin.msg:1: error: the file is not valid UTF-8\nhint: save it as UTF-8" in ran.err
    assert (root / "p/msg/Good.msg").read_text() == "int32 x\n"


def test_no_file_is_overwritten(forge: Forge, tree: Tree) -> None:
    """A type of that name is not renamed; another file in the way stops everything."""
    root = tree({**FILES, "src/p/msg/MyPoint.msg": "int8 other\n"})
    assert forge("interface", "fix", "src", "--write", cwd=root).code == 2
    assert (root / "src/p/msg/MyPoint.msg").read_text() == "int8 other\n"
    (root / "src/p/msg/MyPoint.msg").unlink()
    (root / "src/p/msg/MyPoint.msg").symlink_to("nowhere")
    ran = forge("interface", "fix", "src", "--write", cwd=root)
    assert ran.code == 2
    assert "src/p/msg/MyPoint.msg" in ran.err
    assert (root / "src/p/msg/my_point.msg").is_file()


@pytest.mark.parametrize("other", ["fooBar.msg", "FooBar.idl"])
def test_two_definitions_never_get_one_name(other: str, forge: Forge, tree: Tree) -> None:
    root = tree({"p/msg/foo_bar.msg": "int8 a\n", f"p/msg/{other}": "int8 b\n"})
    before = {path.name: path.read_text() for path in (root / "p/msg").iterdir()}
    for words in (("p",), ("p", "--write")):
        ran = forge("interface", "fix", *words, cwd=root)
        assert (ran.code, ran.out) == (2, "")
        assert "FooBar" in ran.err
        assert {path.name: path.read_text() for path in (root / "p/msg").iterdir()} == before


def test_nothing_is_changed_if_one_file_cannot_be_written(
    forge: Forge, tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree({"p/msg/foo_bar.msg": "int8 A\n", "p/srv/do_it.srv": "foo_bar f\n---\n"})
    write = Path.write_bytes

    def fail(path: Path, content: bytes) -> int:
        if path.parent.name == "srv":
            raise OSError(28, "No space left on device", str(path))
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", fail)
    assert forge("interface", "fix", "p", "--write", cwd=root).code == 2
    monkeypatch.undo()
    assert {path.name for path in (root / "p").rglob("*.*")} == {"foo_bar.msg", "do_it.srv"}
    assert forge("interface", "fix", "p", "--write", cwd=root).code == 0
    assert (root / "p/srv/DoIt.srv").read_text() == "FooBar f\n---\n"


def test_links_and_hidden_files_are_kept(forge: Forge, tree: Tree) -> None:
    root = tree({"p/msg/Real.msg": "int8 x\n", "p/msg/.hidden.msg": "nonsense", "real.msg": "int8 A\n"})
    (root / "p/msg/Link.msg").symlink_to("../../real.msg")
    ran = forge("interface", "fix", "p", "--write", cwd=root)
    assert (ran.code, "a symbolic link to a definition is not changed" in ran.err) == (2, True)
    assert (root / "p/msg/Link.msg").is_symlink()
    assert (root / "p/msg/.hidden.msg").is_file()


def test_built_in_types_keep_their_names(forge: Forge, tree: Tree) -> None:
    root = tree({"p/msg/string.msg": "int8 x\n", "p/msg/User.msg": "string name\np/string other\n"})
    forge("interface", "fix", "p", "--write", cwd=root)
    assert (root / "p/msg/User.msg").read_text() == "string name\np/String other\n"


def test_a_folder_without_definitions_is_reported(forge: Forge, tmp_path: Path) -> None:
    ran = forge("interface", "fix", cwd=tmp_path)
    assert ran.code == 2
    assert "found no interfaces in '.'" in ran.err
