"""No command empties, renames or removes folders that forge did not make, whatever the options."""

import shutil
import tarfile
from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.layout import Layout
from forge.build.folder_marks import create_output_folders, mark_layout
from tests.conftest import Forge, Tree
from tests.testable import cmake_package

COMMANDS = {
    "build": ("build",),
    "test": ("test",),
    "clean": ("clean", "workspace", "-y"),
    "clean packages": ("clean", "packages", "a", "-y"),
    "clean stale": ("clean", "stale", "-y"),
    "bundle": ("bundle",),
    "prune": ("cache", "prune", "--size", "0"),
    "verify": ("cache", "verify"),
}
BASES = {"bundle": ("install",), "prune": ("cache",), "verify": ("cache",)}
WAYS = ("option", "link", "forge.toml", "defaults", "variable")
SLIPS = ("src", "src/a", "src/a/out", ".", "..", "docs", "repository", "~")

MINE = dict.fromkeys(
    [
        *("src/a/notes.txt", "src/a/.git/HEAD", "src/a/out/mine", "src/mine", "mine", "docs/thesis.txt"),
        *("docs/a/thesis.txt", "docs/ac/no/te", "docs/cas/no/te", "repository/.git/HEAD", "repository/a/x"),
        *("build/a/mine", "install/a/mine", "log/mine", "log/build_2024-01-01_00-00-00/mine"),
        *("a/CMakeCache.txt", "home/a/mine", "home/packages/cas/mine"),
    ],
    "mine",
)


def everything(root: Path) -> dict[str, tuple[int, str]]:
    """Return modes and contents of all files, links and folders."""
    found = {}
    for path in root.rglob("*"):
        text = str(path.readlink()) if path.is_symlink() else ""
        if path.is_file() and not text:
            text = path.read_text(encoding="utf-8", errors="replace")
        found[str(path.relative_to(root))] = (path.lstat().st_mode, text)
    return found


def cases() -> list[tuple[str, str, str, str]]:
    """Return each command and base with slips, and with one of the ways that are possible for them in turn.

    What writes and removes most gets all slips, the others get three in turn.
    """
    found: list[tuple[str, str, str, str]] = []
    for command in COMMANDS:
        for base in BASES.get(command, ("build", "install", "log")):
            turn = len(found) % len(SLIPS)
            slips = SLIPS if command in {"build", "clean"} else (SLIPS * 2)[turn : turn + 3]
            for slip in slips:
                ways = {"cache": ("option", "link", "variable"), "log": WAYS}.get(base, WAYS[:-1])
                way = ways[len(found) % len(ways)]
                found.append((command, base, "option" if (slip, way) == (".", "link") else way, slip))
    return found


@pytest.mark.parametrize("case", cases(), ids="-".join)
def test_a_mistyped_base_option_changes_no_user_files(
    forge: Forge, tree: Tree, case: tuple[str, str, str, str]
) -> None:
    command, base, way, slip = case
    root = tree({f"ws/{name}": text for name, text in {**cmake_package("a"), **MINE}.items()}) / "ws"
    for name in ("build/a", "install/a", "log/build_2024-01-01_00-00-00"):
        shutil.rmtree(root / name)  # the usual bases are free in this test
    (root / "log/mine").unlink()
    words, variables = [*COMMANDS[command]], {"HOME": str(root / "home"), "COLCON_HOME": str(root / "none")}
    folder = slip.replace("~", str(root / "home"))
    if way == "link":
        (root / "link").symlink_to(root / folder)
        folder = "link"
    if way == "variable":
        variables["FORGE_CACHE_DIR" if base == "cache" else "COLCON_LOG_PATH"] = folder
    elif way == "forge.toml":
        (root / "forge.toml").write_text(f"[{words[0]}]\n{base}-base = '{folder}'\n")
    elif way == "defaults":
        (root / "defaults.yaml").write_text(f"{words[0]}: {{{base}-base: '{folder}'}}\n")
        variables["COLCON_DEFAULTS_FILE"] = str(root / "defaults.yaml")
    else:
        words += ["--cache" if base == "cache" else f"--{base}-base", folder]
    before = everything(root.parent)
    ran = forge(*words, cwd=root, env=variables)
    assert "Traceback" not in ran.err
    after = everything(root.parent)
    made = after.keys() - before.keys()
    assert {name: state for name, state in after.items() if name not in made} == before
    if ran.code == 2:
        assert not made, ran.err
    if slip.startswith("src") or slip in {".", "..", "repository", "~"}:
        assert ran.code == 2 or words[0] == "cache", (ran.out, ran.err)


@pytest.mark.parametrize("kind", ["build", "install"])
@pytest.mark.parametrize("name", ["notes.txt", ".git/HEAD", "package.xml", "CMakeCache.txt", "deep/er/x"])
def test_a_conflicting_folder_is_reported_before_anything_is_written(
    forge: Forge, tree: Tree, kind: str, name: str
) -> None:
    root = tree({**cmake_package("a"), f"{kind}/a/{name}": "mine"})
    before = everything(root)
    ran = forge("build", cwd=root)
    assert ran.code == 2
    assert f"the {kind} folder '{root}/{kind}/a' of 'a' was not created by forge or colcon: it " in ran.err
    assert f"contains '{name.partition('/')[0]}'" in ran.err
    assert f"hint: move it away, or choose another folder with '--{kind}-base'" in ran.err
    assert everything(root) == before


def test_all_conflicting_folders_are_reported_together(forge: Forge, tree: Tree) -> None:
    mine = dict.fromkeys(("build/a/x", "build/b/x", "install/b/x"), "")
    root = tree({**cmake_package("a"), **cmake_package("b"), **mine})
    assert forge("build", cwd=root).err.count("was not created by forge or colcon") == len(mine)


@pytest.mark.needs("cmake", "ninja")
def test_folders_are_recognized_after_a_failed_build(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a"))
    text = (root / "src/a/CMakeLists.txt").read_text()
    (root / "src/a/CMakeLists.txt").write_text(f"{text}\nmessage(FATAL_ERROR stop)\n")
    assert forge("build", cwd=root).code == 1
    assert forge("build", cwd=root).code == 1
    (root / "src/a/CMakeLists.txt").write_text(text)
    assert forge("build", cwd=root).code == 0


@pytest.mark.needs("cmake", "ninja")
def test_sources_in_conflicting_folders_are_reported_after_a_build(
    forge: Forge, tree: Tree, built: Tree
) -> None:
    root = built(cmake_package("a"))
    tree({"build/a/.git/HEAD": "mine"})
    before = everything(root / "build/a")
    for words in (("build", "--force"), ("test",)):
        assert "it contains '.git'" in forge(*words, cwd=root).err
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert everything(root / "build/a") == before


@pytest.mark.needs("cmake", "ninja")
def test_a_manifest_generated_by_cmake_is_not_a_source(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a"))
    with (root / "src/a/CMakeLists.txt").open("a") as stream:
        stream.write("configure_file(package.xml package.xml)\n")
    assert forge("build", cwd=root).code == 0
    assert forge("build", "--force", cwd=root).code == 0
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert not (root / "build").exists()


@pytest.mark.needs("cmake", "ninja")
def test_a_damaged_marker_of_a_known_folder_is_rewritten(forge: Forge, built: Tree) -> None:
    root = built(cmake_package("a"))
    for name in ("build/.built_by", "install/.colcon_install_layout"):
        before = (root / name).read_text()
        for text in ("", "garbage \0\1", "col"):
            (root / name).write_text(text)
            ran = forge("build", cwd=root)
            assert (ran.code, ran.err) == (0, ""), (name, text)
            assert (root / name).read_text() == before


def test_builds_that_begin_at_the_same_time_do_not_mix_layouts(tmp_path: Path) -> None:
    isolated = Layout(tmp_path / "b1", tmp_path / "install", None)
    merged = Layout(tmp_path / "b2", tmp_path / "install", None, merged=True)
    for layout in (isolated, merged):
        create_output_folders(layout)
    mark_layout(merged)
    with pytest.raises(WorkspaceError, match="has the merged layout, not the isolated one"):
        mark_layout(isolated)


@pytest.mark.needs("cmake", "ninja")
def test_a_cache_is_recognized_by_the_name_of_its_mark(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a"))
    assert forge("build", "--cache", "cache", cwd=root).code == 0
    mark = root / "cache/.forge_cache"
    mark.unlink()
    mark.mkdir()
    ran = forge("build", "--force", "--cache", "cache", cwd=root)
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.needs("cmake", "ninja")
def test_a_package_at_the_root_is_not_removed_with_its_results(forge: Forge, built: Tree) -> None:
    root = built({name.removeprefix("src/a/"): text for name, text in cmake_package("a").items()})
    assert forge("build", "--build-base", ".", cwd=root).code == 2
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert sorted(path.name for path in root.iterdir()) == ["CMakeLists.txt", "package.xml"]


@pytest.mark.needs("cmake", "ninja")
def test_a_shared_build_and_install_folder_is_rejected(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a"))
    assert "are the same" in forge("build", "--install-base", "build", cwd=root).err
    assert "is inside the build folder of 'a'" in forge("build", "--install-base", "build/a/i", cwd=root).err


@pytest.mark.parametrize("options", [(), ("--merge-install",)], ids=["isolated", "merged"])
@pytest.mark.parametrize(
    ("option", "name"),
    [("install", "setup.bash"), ("install", "local_setup.sh"), ("build", "compile_commands.json")],
)
def test_files_named_like_forge_files_are_kept(
    forge: Forge, tree: Tree, options: tuple[str, ...], option: str, name: str
) -> None:
    """A prefix of another tool, such as ROS itself, has setup scripts, too."""
    root = tree({**cmake_package("a"), f"mine/{name}": "mine"})
    before = everything(root)
    for command in ("build", "test"):
        ran = forge(command, f"--{option}-base", "mine", *(options if command == "build" else ()), cwd=root)
        assert (ran.code, everything(root)) == (2, before)
        assert f"mine' contains '{name}', which forge did not create" in ran.err
    assert forge("clean", "workspace", "-y", f"--{option}-base", "mine", cwd=root).code == 0
    assert everything(root) == before


@pytest.mark.needs("cmake", "ninja")
@pytest.mark.parametrize("kind", ["build", "install"])
def test_a_link_into_another_workspace_is_rejected(forge: Forge, tree: Tree, kind: str) -> None:
    """A link to a folder that was moved, for example to another disk, is none into a workspace."""
    there = {f"there/{name}": text for name, text in cmake_package("a").items()}
    here = {f"here/{name}": text for name, text in cmake_package("a").items()}
    root = tree({**there, **here, "here/src/a/new": ""})
    assert forge("build", cwd=root / "there").code == 0
    assert forge("build", cwd=root / "here").code == 0
    link = root / f"here/{kind}/a"
    link.rename(root / "disk")
    link.symlink_to(root / "disk")
    assert forge("build", "--force", cwd=root / "here").code == 0
    link.unlink()
    link.symlink_to(root / f"there/{kind}/a")
    before = everything(root / "there")
    ran = forge("build", "--force", cwd=root / "here")
    assert (ran.code, everything(root / "there")) == (2, before)
    assert f"is a link to '{root}/there/{kind}/a', which belongs to another {kind} folder" in ran.err


@pytest.mark.needs("cmake", "ninja")
def test_a_tilde_with_an_unknown_user_is_a_folder_name(forge: Forge, tree: Tree) -> None:
    """As in a shell, for every option with a folder."""
    root = tree({"src/.keep": ""})
    for option in ("--build-base", "--install-base", "--test-result-base", "--cache", "--mixin-files"):
        ran = forge("build", option, "~nobody-of-this-name", cwd=root)
        assert ran.code in {0, 2}, ran.err
    assert forge("--log-base", "~nobody-of-this-name", "build", cwd=root).code in {0, 2}


def test_a_bundle_overwrites_only_bundles(forge: Forge, built: Tree) -> None:
    root = built({**cmake_package("a"), "mine": "mine"})
    assert forge("bundle", "-o", "b.tar.gz", cwd=root).code == 0
    assert forge("bundle", "-o", "b.tar.gz", cwd=root).code == 0
    with tarfile.open(root / "mine.tgz", "w:gz") as archive:
        member = tarfile.TarInfo("mine")
        member.mtime = 315532800  # as other tools that write reproducible archives set it
        archive.addfile(member)
    before = everything(root)
    for name in ("mine", "mine.tgz", "src", "nowhere/b.tgz", "mine/b.tgz"):
        ran = forge("bundle", "-o", name, cwd=root)
        assert (ran.code, everything(root)) == (2, before)
        assert "--output" in ran.err
        assert "disappeared" not in ran.err


SHA = "ab" + "0" * 62


@pytest.mark.parametrize(
    ("verb", "way"),
    [
        *((verb, way) for verb in ("stats", "prune", "verify") for way in ("option", "variable")),
        *(("build", way) for way in ("option", "variable", "forge.toml", "defaults")),
    ],
)
def test_a_folder_that_only_resembles_a_cache_is_rejected(
    forge: Forge, tree: Tree, verb: str, way: str
) -> None:
    """Such as a disk cache of Bazel, however it is named."""
    mine = {f"c/packages/{kind}/ab/{SHA}": "mine" for kind in ("ac", "cas")}
    root = tree({**cmake_package("a"), **mine, "c/packages/CACHEDIR.TAG": "mine"})
    folder, variables = str(root / "c/packages"), {}
    words = ["build", "--cache-size", "1K"] if verb == "build" else ["cache", verb]
    words += ["--size", "0"] if verb == "prune" else []
    if way == "variable":
        variables = {"FORGE_CACHE_DIR": str(root / "c")}
        words += ["--cache"] if verb == "build" else []
    elif way == "option":
        words += ["--cache", folder]
    elif way == "forge.toml":
        (root / "forge.toml").write_text(f'[build]\ncache = "{folder}"\n')
    else:
        (root / "defaults.yaml").write_text(f"build: {{cache: {folder}}}\n")
        variables = {"COLCON_DEFAULTS_FILE": str(root / "defaults.yaml")}
    before = everything(root)
    ran = forge(*words, cwd=root, **({"env": variables} if variables else {}))
    assert (ran.code, everything(root)) == (2, before), ran.out + ran.err
    assert "is not a package cache of forge" in ran.err
    assert "--cache" in ran.err


@pytest.mark.needs("cmake", "ninja")
def test_a_cache_is_recognized_and_keeps_unowned_files(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), "c/mine": "mine"})
    cache = ("--cache", str(root / "c"))
    assert forge("build", *cache, cwd=root).code == 0
    for name in ("cas/notes", "cas/ab/notes", "ac/ab/notes", f"ac/{SHA}"):
        (root / "c" / name).parent.mkdir(exist_ok=True)
        (root / "c" / name).write_text("mine")
    assert forge("cache", "verify", *cache, cwd=root).code == 0
    assert "removed 0 bytes" not in forge("cache", "prune", "--size", "0", *cache, cwd=root).out
    files = {str(path.relative_to(root / "c")) for path in (root / "c").rglob("*") if path.is_file()}
    mine = {"mine", "cas/notes", "cas/ab/notes", "ac/ab/notes", f"ac/{SHA}"}
    assert files - {"counts.json", ".lock", ".forge_cache"} == mine
    shutil.rmtree(root / "build")
    assert forge("build", *cache, "--cache-size", "0", cwd=root).code == 0
    assert (root / "c/.forge_cache").is_file()
    assert (root / "c/cas/notes").is_file()


@pytest.mark.needs("cmake", "ninja")
def test_a_renamed_package_is_reported_as_stale(forge: Forge, built: Tree) -> None:
    root = built(cmake_package("a"))
    for name in ("package.xml", "CMakeLists.txt"):
        path = root / "src/a" / name
        path.write_text(path.read_text().replace("<name>a<", "<name>z<"))
    assert "'a' is no longer in the workspace" in forge("build", cwd=root).err


def test_a_log_folder_keeps_links_and_markers_of_the_user(forge: Forge, tree: Tree) -> None:
    """Links are forge's if they lead to a run; the mark is, if it is empty, and hides nothing that stays."""
    root = tree({**cmake_package("a"), "theirs/COLCON_IGNORE": "why: no packages", "theirs/notes": "mine"})
    own = tree({"own/COLCON_IGNORE": "", "own/notes": "mine"}) / "own"
    linked = tree({"linked/notes": "mine", "elsewhere/mark": "mine"}) / "linked"
    (linked / "COLCON_IGNORE").symlink_to("../elsewhere/mark")
    (root / "dangling").mkdir()
    (root / "dangling/COLCON_IGNORE").symlink_to("../elsewhere/nothing")
    for folder in (root / "theirs", own, linked, root / "dangling"):
        (folder / "latest").symlink_to("notes")
        (folder / "latest_build").symlink_to("/nowhere")
        (folder / "latest_data").symlink_to("build_2024")
    before = everything(root)
    times = {path: path.lstat().st_mtime_ns for path in root.rglob("*") if path.name != "own"}
    for name in ("theirs", "own", "linked", "dangling"):
        assert forge("build", "--log-base", name, cwd=root).code == 0
        assert list((root / name).glob("build_*-*"))
        ran = forge("clean", "workspace", "-y", "--log-base", name, cwd=root)
        assert ran.code == 0
        for path in (root / "dangling").glob("build_*"):
            shutil.rmtree(path)  # a base without a mark
        assert everything(root) == before
        assert not [
            path for path, time in times.items() if path.lstat().st_mtime_ns != time and not path.is_dir()
        ]


def test_a_marker_with_content_is_not_a_forge_marker(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), "build/COLCON_IGNORE": "mine", "install/COLCON_IGNORE": "mine"})
    before = everything(root)
    assert forge("build", cwd=root).code == 0
    for _ in range(2):
        ran = forge("clean", "workspace", "-y", cwd=root)
        assert ran.code == 0
        assert everything(root) == before
    assert "nothing to remove" in ran.out


def test_a_log_folder_inside_a_package_folder_is_rejected(forge: Forge, built: Tree) -> None:
    """A build would empty it."""
    root = built(cmake_package("a"))
    (root / "link").symlink_to("build/a")
    before = everything(root)
    for command in ("build", "test"):
        for base in ("build/a", "build/a/log", "install/a/log", "link/log"):
            ran = forge(command, "--log-base", base, cwd=root)
            assert ran.code == 2
            assert "is inside the" in ran.err
            assert "--log-base" in ran.err
            assert everything(root) == before
