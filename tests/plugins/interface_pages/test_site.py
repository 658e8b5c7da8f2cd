"""Interface pages: complete, reproducible, and safe against hostile text."""

import shutil
from pathlib import Path

import pytest

from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from forge.plugins.interface_pages.site import PackageInfo, Paragraph, paragraphs, site, summary
from tests.conftest import GOLDEN, Forge, Golden, Tree
from tests.generated import catalog_of, reads_idl
from tests.sites import faults_of, read_page

MANIFEST = (
    '<package format="3"><name>{0}</name><version>1.2.3</version><description>About {0}.</description>'
    '<maintainer email="a@b.cc">A</maintainer><license>MIT</license>'
    "<build_depend>rosidl_default_generators</build_depend>"
    "<member_of_group>rosidl_interface_packages</member_of_group></package>"
)
HOSTILE = """</pre><script>alert(1)</script> "'><img src=x onerror=alert(2)> &lt;b&gt; {{ 7 * 7 }} --> ]]>"""
DOCS = ("interface", "docs")


def workspace(tree: Tree) -> Path:
    """Return a workspace with two packages of interfaces, one of which needs the other."""
    return tree(
        {
            "src/a_msgs/package.xml": MANIFEST.format("a_msgs"),
            "src/a_msgs/msg/Base.msg": "# The ground of it all.\nuint8 NONE=0\nuint8 kind\n",
            "src/a_msgs/msg/Later.msg": "builtin_interfaces/Time at\nBase base\n",
            "src/b_msgs/package.xml": MANIFEST.format("b_msgs"),
            "src/b_msgs/srv/Ask.srv": 'a_msgs/Base what\n---\nstring<=8 answer "no"\n',
            "src/b_msgs/action/Go.action": "---\n---\n",
            "src/other/package.xml": MANIFEST.format("other").replace("rosidl_", "ros1_"),
            "src/other/msg/Odd.msg": "this is none of ours",
        }
    )


def test_pages_match_the_golden_files(golden: Golden) -> None:
    """A message, a service and an action, with constants, defaults, units and links."""
    case = GOLDEN / "interfaces" / "html" / "robot"
    folder = GOLDEN / "interfaces" / "docs" / "robot"
    catalog = resolve("robot", parse_all(read_folder("robot", folder)), Library())
    files = site([catalog], {"robot": PackageInfo("1.0.0", "Robots.", "from the workspace")}, "Interfaces")
    golden(case, {file.path: file.text for file in files if file.path.endswith(".html")})


def test_hidden_and_bidirectional_characters_are_visible() -> None:
    doc = ("nul \x00 and escape \x1b[31m", "turned \u202e round", "joined \u200d here")
    (paragraph,) = paragraphs(doc)
    assert (
        paragraph.text == "nul ␀ and escape ␛[31m\nturned \N{REPLACEMENT CHARACTER} round\njoined \u200d here"
    )


def test_ascii_drawings_keep_their_columns() -> None:
    assert paragraphs(("words", "and words", "", "", "  +--+", "  |  |", "", "a  b", "")) == (
        Paragraph("words\nand words"),
        Paragraph("  +--+\n  |  |", preformatted=True),
        Paragraph("a  b", preformatted=True),
    )


@pytest.mark.parametrize(
    ("doc", "first"),
    [
        ((), ""),
        (
            (
                "",
                "One. Two.",
            ),
            "One.",
        ),
        (("Not yet", "over, e.g. here! Now."), "Not yet over, e.g."),
        (("No end",), "No end"),
        (("x" * 200,), "x" * 160 + " …"),
    ],
)
def test_lists_show_the_first_sentence(doc: tuple[str, ...], first: str) -> None:
    assert summary(doc) == first


def test_all_links_resolve(forge: Forge, tree: Tree) -> None:
    """Also where types of other packages are referred to: those have pages, too."""
    root = workspace(tree)
    ran = forge(*DOCS, cwd=root)
    out = root / "build/forge_interface_docs"
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.endswith("files written, start page: 'build/forge_interface_docs/index.html'\n")
    assert faults_of(out) == []
    assert (out / "builtin_interfaces/msg/Time.html").is_file()
    assert (out / "action_msgs/srv/CancelGoal.html").is_file()
    assert not (out / "other").exists()
    base = read_page((out / "a_msgs/msg/Base.html").read_text())
    assert {"../../a_msgs/msg/Later.html", "../../b_msgs/srv/Ask.html"} <= set(base.targets)
    package = read_page((out / "a_msgs/index.html").read_text()).text
    assert "1.2.3" in package
    assert "About a_msgs." in package
    assert "2 messages; from the workspace." in package
    assert "only referenced types" in (out / "builtin_interfaces/index.html").read_text()


def test_the_same_interfaces_give_the_same_bytes(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    """From another folder, in another order, at another time: pages contain no dates and no host paths."""
    root = workspace(tree)
    forge(*DOCS, "-o", str(tmp_path / "one"), cwd=root)
    (tmp_path / "elsewhere").mkdir()
    shutil.copytree(root / "src", tmp_path / "elsewhere/deep/src")
    forge(*DOCS, "b_msgs", "a_msgs", "-o", str(tmp_path / "two"), cwd=tmp_path / "elsewhere/deep/src/a_msgs")
    contents = [
        {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (tmp_path / "one", tmp_path / "two")
    ]
    assert contents[0] == contents[1]
    assert str(tmp_path).encode() not in b"".join(contents[0].values())


def test_only_changed_pages_are_written_and_stale_ones_removed(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    first = forge(*DOCS, "-o", "site", cwd=root).out
    count = int(first.split()[2])
    assert first.startswith(f"{count} of {count} files")
    assert forge(*DOCS, "-o", "site", cwd=root).out.startswith(f"0 of {count} files")
    (root / "src/a_msgs/msg/Later.msg").unlink()
    (root / "site/notes.html").write_text("mine")
    ran = forge(*DOCS, "-o", "site", cwd=root)
    assert not (root / "site/a_msgs/msg/Later.html").exists()
    assert "Later" not in (root / "site/a_msgs/msg/Base.html").read_text()
    assert (root / "site/notes.html").read_text() == "mine"
    assert int(ran.out.split()[0]) == 4  # of Base, of Time, of the package, the first
    shutil.rmtree(root / "src/b_msgs")
    forge(*DOCS, "-o", "site", cwd=root)
    assert not (root / "site/b_msgs").exists()
    assert faults_of(root / "site") == []


def test_a_foreign_index_page_is_kept(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    (root / "site").mkdir()
    (root / "site/index.html").write_text("mine")
    ran = forge(*DOCS, "-o", "site", cwd=root)
    assert ran.code == 2
    assert ran.err == (
        "site: error: 'index.html' exists, but forge did not write it\n"
        "hint: choose another folder with --output, or remove the file\n"
    )
    assert (root / "site/index.html").read_text() == "mine"


def test_a_corrupt_file_list_removes_no_files_elsewhere(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    forge(*DOCS, "-o", "site", cwd=root)
    (root / "precious").write_text("")
    listing = root / "site/.forge_site"
    listing.write_text(f"{listing.read_text()}../precious\n{root}/precious\n")
    assert forge(*DOCS, "-o", "site", cwd=root).code == 0
    assert (root / "precious").exists()


def test_an_unwritable_folder_is_reported(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    (root / "site").write_text("a file")
    ran = forge(*DOCS, "-o", "site", cwd=root)
    assert ran.code == 2
    assert ran.err.startswith("site")
    assert "cannot write: " in ran.err


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (
            ("geometry_msg",),
            "unknown interface package 'geometry_msg'\nhint: did you mean 'geometry_msgs'?",
        ),
        ((), "no interfaces to document\nhint: change to a workspace"),
        (("--include", "../up=."), "'../up' is not a valid name of an interface package"),
    ],
)
def test_packages_without_pages_are_reported(
    forge: Forge, tmp_path: Path, argv: tuple[str, ...], words: str
) -> None:
    ran = forge(*DOCS, *argv, cwd=tmp_path)
    assert ran.code == 2
    assert words in ran.err


@pytest.mark.parametrize("out", [".", "..", "src", "src/other"])
def test_generated_pages_do_not_hide_packages(forge: Forge, tree: Tree, out: str) -> None:
    """No tool looks for packages among pages: a folder that has some is none for pages."""
    root = workspace(tree)
    before = sorted(root.rglob("*"))
    ran = forge(*DOCS, "-o", out, cwd=root)
    assert ran.code == 2
    assert ran.err.startswith(
        f"{out}: error: the output folder contains packages, which discovery would then ignore\n"
    )
    assert sorted(root.rglob("*")) == before


def test_an_unreadable_manifest_gives_a_warning(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    (root / "src/other/package.xml").write_text("<package>")
    ran = forge(*DOCS, cwd=root)
    assert ran.code == 0
    assert "src/other/package.xml" in ran.err
    assert "warning: " in ran.err


def test_errors_in_all_packages_are_reported_together(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    (root / "src/a_msgs/msg/Base.msg").write_text("int9 kind\n")
    (root / "src/b_msgs/srv/Ask.srv").write_text("nowhere_msgs/What what\n---\n")
    ran = forge(*DOCS, cwd=root)
    assert ran.code == 2
    assert "src/a_msgs/msg/Base.msg:1:1: error: " in ran.err
    assert "src/b_msgs/srv/Ask.srv:1:1: error: " in ran.err
    assert ran.err.count("int9") == 2


def test_an_idl_file_next_to_another_definition_is_reported(forge: Forge, tree: Tree) -> None:
    root = workspace(tree)
    (root / "src/a_msgs/msg/Base.idl").write_text("module a_msgs {};\n")
    ran = forge(*DOCS, cwd=root)
    assert ran.code == 0, ran.err
    assert "src/a_msgs/msg/Base.idl: warning: this definition of 'a_msgs/msg/Base' is ignored" in ran.err


def test_underlays_and_named_folders_can_be_listed(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "under/share/u_msgs/msg/U.msg": "int8 u\n",
            "under/share/u_msgs/package.xml": MANIFEST.format("u_msgs"),
            "under/share/ament_index/resource_index/rosidl_interfaces/u_msgs": "msg/U.msg\n",
            "w/plain/msg/P.msg": "u_msgs/U u\n",
        }
    )
    under, root = root / "under", root / "w"
    sourced = {"AMENT_PREFIX_PATH": str(under)}
    forge(*DOCS, "--underlays", "-o", "site", cwd=root, env=sourced)
    text = read_page((root / "site/u_msgs/index.html").read_text()).text
    assert "1 message; from an underlay." in text
    ran = forge(*DOCS, "--include", "plain=plain", "-o", "site", cwd=root, env=sourced)
    assert ran.code == 0
    assert "u_msgs/msg/U.html" in (root / "site/plain/msg/P.html").read_text()
    assert faults_of(root / "site") == []


def test_a_field_named_like_a_page_section_has_its_own_anchor() -> None:
    parts = ("definition", "use", "wire", "users", "hash", "request", "response")
    catalog = catalog_of("p", {"srv/A.srv": "".join(f"int8 {part}\n" for part in parts) + "---\nint8 hash"})
    files = {file.path: file.text for file in site([catalog], {}, "Interfaces")}
    contents = read_page(files["p/srv/A.html"])
    assert contents.faults == []
    assert {"hash", "request.hash", "response.hash"} <= set(contents.ids)


@reads_idl
def test_definitions_of_other_folders_and_languages_have_pages(forge: Forge, tree: Tree) -> None:
    """An .idl file may lie in any folder; what it defines is used like a message."""
    module = "module a_msgs {{ module {0} {{ struct {1} {{ {2}; }}; }}; }};\n"
    root = tree(
        {
            "src/a_msgs/package.xml": MANIFEST.format("a_msgs"),
            "src/a_msgs/deep/Thing.idl": "// All of it.\n" + module.format("deep", "Thing", "double x"),
            "src/a_msgs/msg/Uses.idl": '#include "a_msgs/deep/Thing.idl"\n'
            + module.format("msg", "Uses", "a_msgs::deep::Thing thing"),
        }
    )
    assert forge(*DOCS, "-o", "site", cwd=root).code == 0
    assert faults_of(root / "site") == []
    assert (
        "../../a_msgs/deep/Thing.html" in read_page((root / "site/a_msgs/msg/Uses.html").read_text()).targets
    )
    assert "<i>// All of it.</i>" in (root / "site/a_msgs/deep/Thing.html").read_text()
    assert "In the folder deep" in (root / "site/a_msgs/index.html").read_text()


def test_an_empty_interface_has_a_page() -> None:
    catalog = catalog_of("p", {"msg/A.msg": ""})
    files = {file.path: file.text for file in site([catalog], {}, "Interfaces")}
    assert "No fields." in files["p/msg/A.html"]
    assert "Always 1 byte, excluding the 4-byte header" in files["p/msg/A.html"]
