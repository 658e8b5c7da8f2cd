"""Skip packages for which a build would only relink and produce identical files.

This is the case if a shared library changed but its ABI did not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.layout import SCRATCH_DIR
from forge.build.build_dir import dependency_changes
from forge.build.build_notes import BEGUN, ENDED, read_json
from forge.build.inputs.native_graph import read_native_graph
from forge.build.observed_commands import COMMANDS
from forge.build.reuse import would_only_link
from forge.build.up_to_date import changed_input
from forge.engine.commands import read_commands
from forge.toolchain.programs import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.build.build_dir import FileChecks
    from forge.build.model import BuildRecord
    from forge.build.tasks import Task


def relinking_is_redundant(
    task: Task, record: BuildRecord, needs: Mapping[str, str], checks: FileChecks
) -> bool:
    """Return True if building a task would only link it with shared libraries whose interfaces are unchanged.

    All that the package has installed would stay the same, byte for byte. `record` is that of its last build,
    which succeeded. `needs` has a digest of what each dependency has installed.
    """
    only_needs_changed = changed_input(replace(task.inputs, needs=record.inputs.needs), record.inputs) is None
    if task.package.build_type not in CMAKE_TYPES or not only_needs_changed:
        return False
    build = task.build_dir
    note, ended = read_json(build / SCRATCH_DIR / BEGUN), read_json(build / SCRATCH_DIR / ENDED)
    then = note.get("needs")
    if not ended or ended.get("saved") or not isinstance(then, dict) or then.keys() != needs.keys():
        return False
    changed = [(name, then[name], needs[name]) for name in needs if then[name] != needs[name]]
    if not changed or not all(checks.only_library_code_changed(*each) for each in changed):
        return False
    needed = dependency_changes(then, needs, checks)
    seen = read_commands(build / SCRATCH_DIR / COMMANDS)
    return needed is not None and would_only_link(read_native_graph(build), needed, seen)
