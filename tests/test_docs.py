"""What the README and the docs tell the reader to type works as told."""

import json
import re
import shutil
from itertools import chain
from pathlib import Path

import pytest
import yaml

from tests.bench import page as benchmarks
from tests.reference import all_parsers
from tests.snippets import ROOT, TYPED, blocks, commands, run
from tests.upstream import figures as compatibility
from tests.upstream.page import page as compatibility_page

TRANSLATIONS = {
    path: path.with_name(path.name.replace(".zh-CN", ""))
    for path in sorted({*ROOT.glob("*.zh-CN.md"), *(ROOT / "docs").rglob("*.zh-CN.md")})
}
DOCUMENTS = sorted({ROOT / "README.md", *TRANSLATIONS, *(ROOT / "docs").rglob("*.md")})
TUTORIAL = ROOT / "docs/tutorial.md"  # tests/e2e/test_tutorial.py follows it, and goes on from where it ends
NEEDS = {
    ROOT / "docs/how-to/coverage.md": ("gcovr", "gcov"),
    ROOT / "docs/how-to/rust.md": ("cargo",),
}
RUN = [
    pytest.param(path, marks=pytest.mark.needs(*NEEDS.get(path, ())), id=path.relative_to(ROOT).as_posix())
    for path in DOCUMENTS
    if path != TUTORIAL and path not in TRANSLATIONS
]

READ = frozenset({"text", "cmake", "toml", "yaml", "xml", "python", "cpp", "c", "json", "dockerfile"})
"""Languages of blocks that may be there to be read only; commands are in 'console' or 'bash' blocks."""

PARSERS = dict(all_parsers())

_INLINE = re.compile(r"(?<!`)`(forge(?: [^`]+)?)`(?!`)")
_IN_FILE = re.compile(r"""(?:^|&& |- |run: |")\s*(forge [a-z][^&|"\n\\>]*)""", re.MULTILINE)
"""A command in a file for another tool."""
_FROM_INDEX = re.compile(r"\b(?:install|--with)\b.* '?ros-forge\b(?!.* @ git)")
_ANCHOR = re.compile(r'<a id="([^"]+)">')
_HEADING = re.compile(r"^(#+) ", re.MULTILINE)


def _name(document: Path) -> str:
    return document.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_a_block_that_is_not_run_gives_a_reason(document: Path) -> None:
    for block in blocks(document.read_text(encoding="utf-8")):
        if block.language in TYPED and not commands(block):
            assert block.mark.startswith("not run: "), f"{document}:{block.line}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_links_to_files_resolve(document: Path) -> None:
    assert [str(path) for path, _ in _links(document) if not path.exists()] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_links_to_headings_resolve(document: Path) -> None:
    assert [
        (str(page), heading) for page, heading in _links(document) if heading not in _headings(page)
    ] == []


@pytest.mark.needs("bash", "cmake", "make", "g++")
@pytest.mark.parametrize("document", RUN)
def test_documented_commands_work(document: Path, tmp_path: Path) -> None:
    if not any(map(commands, blocks(document.read_text(encoding="utf-8")))):
        return
    folder = tmp_path / "an empty folder"
    folder.mkdir()
    shutil.copytree(ROOT / "examples_ws/src", folder / "examples_ws/src")
    run(document, folder)


def test_the_index_lists_every_page() -> None:
    index = ROOT / "docs/README.md"
    targets = {part.split(")")[0] for part in index.read_text(encoding="utf-8").split("](")[1:]}
    pages = {path.relative_to(index.parent).as_posix() for path in index.parent.rglob("*.md")}
    assert pages - targets == {"README.md"}


def test_benchmarks_match_their_figures() -> None:
    """After a new measurement, run `python -m tests.bench.page`."""
    for path, text in benchmarks.files(benchmarks.read(benchmarks.DOCS / benchmarks.FIGURES)).items():
        assert (benchmarks.DOCS / path).read_text(encoding="utf-8") == text, path


def test_the_compatibility_page_matches_its_figures_and_explains_failures() -> None:
    """After a new count, run `python -m tests.upstream.page`."""
    counted = compatibility.read(ROOT / "docs/compatibility.json")
    page = (ROOT / "docs/reference/compatibility.md").read_text(encoding="utf-8")
    assert page == compatibility_page(counted)
    rows: tuple[compatibility.Suite | compatibility.Repository, ...]
    rows = (*counted.suites, *counted.repositories)
    for row in rows:
        assert row.notes or all(passed == total for passed, total in row.counts.values()), row.name


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_all_blocks_are_tested(document: Path) -> None:
    """Every fence is one that the tests read, and its language is known; so no command hides in 'sh'."""
    text = document.read_text(encoding="utf-8")
    assert {block.language for block in blocks(text)} <= {*TYPED, *READ}
    fences = re.findall(r"^\s*(?:```|~~~).*$", text, re.MULTILINE)
    assert len(fences) == 2 * len(blocks(text))


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_the_text_names_the_file_of_each_block(document: Path) -> None:
    """What a comment says to these tests, the words before a block say to people."""
    text, seen = document.read_text(encoding="utf-8"), 0
    for block in blocks(text):
        begin = text.index(f"```{block.language}\n{block.text}", seen)
        if file := re.match(r"(?:write|append|insert): (\S+)", block.mark):
            words = text[seen:begin].partition(f"<!-- {block.mark}")[0]
            assert file[1].rpartition("/")[2] in words, f"{document}:{block.line}"
        seen = begin + len(block.text)


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_no_page_installs_forge_from_pypi(document: Path) -> None:
    """Until forge is on PyPI, whatever is there by this name is a stranger's."""
    lines = document.read_text(encoding="utf-8").splitlines()
    assert not [line for line in lines if _FROM_INDEX.search(line)]


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_inline_commands_are_valid(document: Path) -> None:
    """Each command and option in running text exists."""
    text = _without_blocks(document.read_text(encoding="utf-8"))
    wrong = [typed for typed in _INLINE.findall(text.replace("\\|", "|")) if not _is_known(typed)]
    assert wrong == []


@pytest.mark.parametrize(("translation", "original"), TRANSLATIONS.items(), ids=map(_name, TRANSLATIONS))
def test_translations_have_the_same_commands_and_sections(translation: Path, original: Path) -> None:
    """So the commands of the translation need not be run a second time."""
    texts = [path.read_text(encoding="utf-8") for path in (original, translation)]
    typed, translated = (
        [(b.language, b.mark, b.text) for b in blocks(text) if b.language in TYPED or commands(b)]
        for text in texts
    )
    assert translated == typed
    headings = [[len(marks) for marks in _HEADING.findall(_without_blocks(text))] for text in texts]
    assert headings[0] == headings[1]
    pages = [{path for path, _ in _links(document)} for document in (original, translation)]
    assert {*pages[0], original} - {translation} == {TRANSLATIONS.get(page, page) for page in pages[1]}
    assert translation in pages[0]
    assert pages[1] & {*TRANSLATIONS.values()} == {original}, "link to the translations of the other pages"


@pytest.mark.parametrize("document", DOCUMENTS, ids=_name)
def test_files_for_other_tools_are_valid(document: Path) -> None:
    """Settings of editors and jobs of CI services, which the tests cannot run."""
    for block in blocks(document.read_text(encoding="utf-8")):
        if block.language == "yaml":
            list(yaml.safe_load_all(block.text))
        if block.language == "json" and block.mark.startswith("write: "):
            json.loads(block.text)
        if block.language in {"yaml", "json", "dockerfile"}:
            wrong = [typed for typed in _IN_FILE.findall(block.text) if not _is_known(typed.strip())]
            assert wrong == [], f"{document}:{block.line}"


@pytest.mark.parametrize(
    "name", ["README.md", "README.zh-CN.md", "docs/tutorial.md", "docs/tutorial.zh-CN.md"]
)
def test_the_listed_packages_suffice_for_the_commands(name: str) -> None:
    """A Debian with nothing else can then build interfaces, run cmake and test Python packages."""
    text = (ROOT / name).read_text(encoding="utf-8")
    typed = "\n".join(block.text for block in blocks(text) if commands(block))
    needed = {"python3-venv", "python3-numpy", "make", "g++"}
    needed |= {"cmake"} if "$ cmake " in typed else set()
    needed |= {"python3-pytest"} if "$ forge test" in typed else set()
    installed = re.search(r"`sudo apt install ([^`]+)`", text)
    assert installed is not None
    assert set(installed[1].split()) == needed


def test_the_tutorial_shows_complete_definitions() -> None:
    """What 'forge interface show' prints begins with the file that the reader has written, constants too."""
    parts = blocks(TUTORIAL.read_text(encoding="utf-8"))
    written = {
        block.mark.partition("src/")[2]: block.text for block in parts if block.mark.startswith("write: ")
    }
    shown = {
        command.text.split()[-1]: "\n".join(command.expected)
        for command in chain.from_iterable(map(commands, parts))
        if command.text.startswith("forge interface show ")
    }
    assert len(shown) == 3
    for name, text in shown.items():
        assert text.startswith(written[f"{name}.{name.split('/')[1]}"].rstrip()), name


def _links(document: Path) -> list[tuple[Path, str]]:
    """Return the files to which a document links, each with the heading or ''."""
    text = _without_blocks(document.read_text(encoding="utf-8"))
    targets = [part.split(")")[0].partition("#") for part in text.split("](")[1:]]
    return [
        ((document.parent / path).resolve() if path else document, heading)
        for path, _, heading in targets
        if "://" not in path
    ]


def _headings(page: Path) -> set[str]:
    """Return the names by which links lead to the headings of a page, and ''."""
    if page.suffix != ".md":
        return {""}
    text = _without_blocks(page.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {
        "",
        *_ANCHOR.findall(text),
        *(re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles),
    }


def _without_blocks(text: str) -> str:
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def _is_known(typed: str) -> bool:
    """Tell if forge knows the words and options of a command line, the values left aside."""
    words = typed.split()[1:]
    path = ""
    for word in words:
        if word.isupper() or word.startswith("-"):
            break
        if f"{path} {word}".strip() not in PARSERS:
            if not path or any(name.startswith(f"{path} ") for name in PARSERS):
                return False
            break
        path = f"{path} {word}".strip()
    known = {flag for name in ("", path) for flag in PARSERS[name]._option_string_actions}
    given = [word.partition("=")[0] for word in words if word.startswith("-") and "|" not in typed]
    return all(any(flag.startswith(option) for flag in known) for option in given)
