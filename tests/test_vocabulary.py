"""Names that only their authors understood do not come back: each has a word of the field in its place."""

from __future__ import annotations

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

IDENTIFIERS = {
    "Undertaking": "Session",
    "undertaking": "session",
    "carry_out": "run_plan",
    "Kitchen": "BuildContext",
    "kitchen": "context",
    "Bench": "TestContext",
    "Manner": "BuildMode",
    "manner": "mode",
    "_Turns": "WatchLoop",
    "Standing": "GlobalInputs",
    "Parts": "BuildInputs",
    "Mark": "Fingerprint",
    "Traces": "BuildDirState",
    "Outlook": "DependencyHashes",
    "outlook": "hashes",
    "Audience": "Session",
    "audience": "session",
    "Transcript": "LogWriter",
    "transcript": "log_writer",
    "Feed": "JsonEvents",
    "Board": "Scheduler",
    "Frame": "TaskLifecycle",
    "Jobs": "TaskSetup",
    "desk": "scratch_dir",
    "handover": "initial_cache",
    "Provision": "DependencyResolution",
    "Saves": "FileWatcher",
    "Interest": "WatchSpec",
    "scenes": "failure_context",
    "fallback": "rollback",
    "ownership": "file_conflicts",
    "unfound": "executable_hints",
    "lending": "bundled_setuptools",
    "Circle": "CacheContext",
    "Lineage": "DependencyKeys",
    "Outside": "ExternalInputs",
    "Places": "Relocator",
    "loosened": "relativize",
    "Planter": "TreeWriter",
    "Bound": "NonRelocatable",
    "Post": "Router",
    "Box": "Mailbox",
    "Knock": "TaskRequest",
    "Errand": "RemoteTask",
    "errand": "remote_task",
    "Visit": "Attempt",
    "attendant": "step_runner",
    "Account": "LauncherStats",
    "Farm": "HostPool",
    "farm": "host_pool",
    "Patience": "Deadline",
    "patience": "deadline",
    "Errands": "TimeoutExecutor",
    "examining": "checks",
    "Checkup": "CheckResult",
    "pictures": "charts",
}
"""What must not be the name of anything in forge, and what it is called."""

SPECIFICATIONS = re.compile(r"\b(workspace|interface) spec\b")
"""Documents that the repository does not have: public ones are cited, such as REP 149."""


def sources() -> list[Path]:
    """Return forge's own modules."""
    return [path for path in sorted((ROOT / "forge").rglob("*.py")) if "embedded" not in path.parts]


def modules_of_tests() -> list[Path]:
    """Return the modules of the tests, but this one."""
    found = [path for path in sorted((ROOT / "tests").rglob("*.py")) if "golden" not in path.parts]
    return [path for path in found if path != Path(__file__)]


@pytest.mark.parametrize(
    "path", [*sources(), *modules_of_tests()], ids=lambda path: str(path.relative_to(ROOT))
)
def test_no_name_is_a_private_metaphor(path: Path) -> None:
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    names = {token.string for token in tokens if token.type == tokenize.NAME}
    if path.is_relative_to(ROOT / "tests"):
        names.discard("Bound")  # a message of the tests
    assert {name: IDENTIFIERS[name] for name in names & IDENTIFIERS.keys()} == {}


def test_no_module_is_called_so() -> None:
    assert [
        path for path in (*sources(), *modules_of_tests()) if path.stem.removeprefix("test_") in IDENTIFIERS
    ] == []


def test_only_public_documents_are_cited() -> None:
    pages = [
        *sources(),
        *modules_of_tests(),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "templates").rglob("*.j2"),
    ]
    assert [path for path in pages if SPECIFICATIONS.search(path.read_text(encoding="utf-8"))] == []
