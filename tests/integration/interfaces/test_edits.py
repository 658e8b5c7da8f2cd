"""Whatever changed since the last run, the generated files are those of a run into an empty folder."""

import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.evolving import look

Edit = Callable[[Path, random.Random], object]

SHAPES = {
    "src/msg/Base.msg": "float64 x\n",
    "src/msg/User.msg": "Base base  # a word\nlow/Low low\n",
    "src/msg/UserOfUser.msg": "User[] users\n",
    "src/msg/Alone.msg": "# A comment\nstring text\n",
    "src/srv/Ask.srv": "Base base\n---\nbool ok\n",
    "low/msg/Low.msg": "int32 x\n",
    "options": "",
}
LANGUAGES = ("python", "cpp", "c", "idl", "json")


def names(root: Path) -> list[str]:
    return sorted(path.relative_to(root / "src").as_posix() for path in (root / "src").rglob("*.*"))


def any_message(root: Path, rng: random.Random) -> Path:
    return rng.choice(sorted((root / "src/msg").iterdir()))


def any_output(root: Path, rng: random.Random) -> Path:
    files = sorted(
        path for path in (root / "out").rglob("*") if path.is_file() and ".forge" not in path.parts
    )
    return rng.choice(files)


def append(path: Path, text: str) -> None:
    path.write_text(path.read_text() + text)


def add(root: Path, rng: random.Random) -> None:
    (root / f"src/msg/New{rng.randrange(3)}.msg").write_text(f"Base base\nint32 N={rng.randrange(9)}\n")


def remove(root: Path, rng: random.Random) -> None:
    new = sorted((root / "src/msg").glob("New*.msg"))
    rng.choice([*new, root / "src/msg/Alone.msg", root / "src/srv/Ask.srv"]).unlink(missing_ok=True)


def rename(root: Path, rng: random.Random) -> None:
    if (root / "src/msg/User.msg").exists():
        (root / "src/msg/User.msg").rename(root / "src/msg/Owner.msg")
    for path in (root / "src/msg").iterdir():
        path.write_text(path.read_text().replace("User[]", "Owner[]"))
    del rng


def change_field(root: Path, rng: random.Random) -> None:
    append(any_message(root, rng), f"int32 field{rng.randrange(10**9)}\n")


def change_comment(root: Path, rng: random.Random) -> None:
    path = any_message(root, rng)
    path.write_text(f"# {rng.random()}\n{path.read_text()}")


def change_nested(root: Path, rng: random.Random) -> None:
    (root / "src/msg/Base.msg").write_text(f"float64 y{rng.randrange(9)}\n")


def change_dependency(root: Path, rng: random.Random) -> None:
    append(root / "low/msg/Low.msg", f"int32 field{rng.randrange(10**9)}\n")


def change_languages(root: Path, rng: random.Random) -> None:
    (root / "options").write_text(rng.choice(["", "idl", "cpp"]))


def edit_output(root: Path, rng: random.Random) -> None:
    append(any_output(root, rng), "edited\n")


def remove_output(root: Path, rng: random.Random) -> None:
    any_output(root, rng).unlink()


def change_mode(root: Path, rng: random.Random) -> None:
    any_output(root, rng).chmod(0o640)


def replace_output(root: Path, rng: random.Random) -> None:
    path = any_output(root, rng)
    path.rename(root / "elsewhere")
    path.symlink_to(root / "elsewhere")


def break_definition(root: Path, rng: random.Random) -> None:
    del rng
    (root / "src/msg/Broken.msg").write_text("Nothing nothing\n")


def touch(root: Path, rng: random.Random) -> None:
    any_output(root, rng).touch()


EDITS: tuple[Edit, ...] = (
    *(add, remove, rename, change_field, change_comment, change_nested, change_dependency, change_languages),
    *(edit_output, remove_output, change_mode, replace_output, break_definition, touch),
)


def generate(forge: Forge, root: Path, out: str) -> int:
    without = (root / "options").read_text()
    languages = [word for each in LANGUAGES if each != without for word in ("--lang", each)]
    files = [word for name in names(root) for word in ("--file", f"{root}/src:{name}")]
    words = ["--package", "p", "--output", out, "--no-runtime", "--include", "low=low", *languages, *files]
    return forge("interface", "generate", *words, cwd=root).code


def outputs(root: Path, out: str) -> dict[str, tuple[str, ...]]:
    found = look(root / out)
    without = (root / "options").read_text()
    return {name: entry for name, entry in found.items() if not name.startswith((".forge", without or "-"))}


def times(root: Path) -> dict[Path, tuple[int, int]]:
    files = {
        path: path.lstat()
        for path in (root / "out").rglob("*")
        if path.is_file() and path.parent.name != ".forge"
    }
    return {path: (status.st_ino, status.st_mtime_ns) for path, status in files.items()}


@pytest.mark.parametrize("seed", range(4))
def test_edits_give_the_same_files_as_a_clean_run(forge: Forge, tree: Tree, seed: int) -> None:
    rng = random.Random(seed)
    root = tree(SHAPES)
    assert generate(forge, root, "out") == 0
    for _ in range(8):
        edits = rng.sample(EDITS, rng.choice([1, 1, 2]))
        for edit in edits:
            edit(root, rng)
        if generate(forge, root, "out"):
            (root / "src/msg/Broken.msg").unlink()
            assert generate(forge, root, "out") == 0
        shutil.rmtree(root / "clean", ignore_errors=True)
        assert generate(forge, root, "clean") == 0
        assert outputs(root, "out") == outputs(root, "clean"), [edit.__name__ for edit in edits]


def test_only_files_of_the_definition_and_its_users_are_written(forge: Forge, tree: Tree) -> None:
    root = tree(SHAPES)
    assert generate(forge, root, "out") == 0
    before = times(root)
    append(root / "src/msg/User.msg", "int32 more\n")
    assert generate(forge, root, "out") == 0
    after = times(root)
    changed = {path.name for path in before if before[path] != after[path]}
    assert "user__struct.hpp" in changed
    assert all("user" in name.lower() for name in changed), changed
    assert generate(forge, root, "out") == 0
    assert times(root) == after


def test_a_missing_or_damaged_ledger_regenerates_all_files(forge: Forge, tree: Tree) -> None:
    root = tree(SHAPES)
    assert generate(forge, root, "clean") == 0
    assert generate(forge, root, "out") == 0
    for text in (None, "", "{}", '{"version": 5, "parts": {"cpp p": ["x", {"a": []}]}}'):
        ledger = root / "out/.forge/p.json"
        ledger.unlink()
        if text is not None:
            ledger.write_text(text)
        (root / "out/cpp/p/msg/base.hpp").write_text("edited")
        assert generate(forge, root, "out") == 0
        assert outputs(root, "out") == outputs(root, "clean"), text
