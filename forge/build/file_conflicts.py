"""Decide which package owns a file that several install into a merged tree: the last one in build order.

Digests of each package's own files are in its last installed state.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.build.events import Event, Finished, Started
from forge.build.inputs.fingerprints import FileTable, contents_of, fingerprint_files
from forge.build.installed_lists import InstalledStates
from forge.build.model import BuildRecord, Fingerprint

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from forge.base.layout import Layout
    from forge.build.journal import Journal
    from forge.build.tasks import BuildPlan, Task


class MergedPrefix:
    """The files that several packages of a merged prefix install; isolated prefixes have none."""

    def __init__(self, layout: Layout, journal: Journal) -> None:
        self._layout = layout
        self._journal = journal
        self._states = InstalledStates(layout.build)
        self._before: dict[str, frozenset[str]] = {}
        """The packages that had ended when each one started."""
        self._ended: set[str] = set()

    def note(self, event: Event) -> None:
        """Record the start or end of a package, to find out which ones were installed in order."""
        if isinstance(event, Started) and self._layout.merged:
            self._ended.discard(event.task)
            self._before[event.task] = frozenset(self._ended)
        elif isinstance(event, Finished):
            self._ended.add(event.task)

    def _common_files(self, names: Collection[str]) -> Mapping[str, list[str]]:
        """Return, by path, the packages that install the same file, if one of `names` is among them."""
        if not self._layout.merged or not names:
            return {}
        records = self._journal.records
        owners: dict[str, list[str]] = {}
        for name in sorted(records):
            if records[name].complete:
                for path in records[name].files:
                    owners.setdefault(path, []).append(name)
        return {
            path: owners
            for path, owners in sorted(owners.items())
            if len(owners) > 1 and not frozenset(names).isdisjoint(owners)
        }

    def conflicting_files(self, names: Collection[str]) -> Mapping[str, list[str]]:
        """Return, by path, the packages that install different contents, if one of `names` is among them."""
        records, shared = self._journal.records, self._common_files(names)
        contents = {
            name: self._states.contents(name, records[name].installed.digest) or {}
            for name in {name for owners in shared.values() for name in owners}
        }
        return {
            path: owners
            for path, owners in shared.items()
            # Only the content digest, without mode and link target.
            if len({contents[name].get(path, "").rpartition(" ")[2] for name in owners}) > 1
        }

    def conflicts(self, names: Collection[str]) -> Iterator[Problem]:
        """Yield a problem for each file that one of `names` and another package install differently."""
        for path, owners in self.conflicting_files(names).items():
            packages = f"{', '.join(map(repr, owners[:-1]))} and {owners[-1]!r}"
            relative = path.removeprefix(f"{self._layout.install}/")
            hint = "the last one wins; rename the file in one of them, or build without '--merge-install'"
            yield Problem(f"{packages} install '{relative}' with different contents", hint=hint)

    def shared_files(self, task: Task) -> frozenset[str]:
        earlier = frozenset(task.earlier if self._layout.merged else ())
        return owned_by_others(task.name, earlier, self._journal.records) if earlier else earlier

    def packages_to_reinstall(self, plan: BuildPlan) -> frozenset[str]:
        """Return the packages that install a file differently from one that is built, and might not be built.

        They must be installed again in order, so that the result matches a clean build.
        """
        owner_lists = self.conflicting_files(plan.tasks).values()
        unsure = {*plan.fresh, *(name for name, task in plan.tasks.items() if task.conditional)}
        return frozenset(name for owners in owner_lists for name in owners) & unsure

    def in_order(self, plan: BuildPlan) -> BuildPlan:
        """Return the plan with each package after those that are known to install the same file."""
        tasks = dict(plan.tasks)
        for owners in self._common_files(plan.tasks).values():
            built = [name for name in plan.tasks if name in owners]
            for before, name in pairwise(built):
                tasks[name] = replace(tasks[name], after=tasks[name].after | {before})
        return replace(plan, tasks=tasks)

    def refresh_stamps(self, plan: BuildPlan, table: FileTable) -> bool:
        """Accept files that a later package has just overwritten: only the stamp of the package is updated.

        Its digest still covers its own files. The next build compares the content of a file that the later
        package no longer installs. Return True if packages installed or removed the same file in an arbitrary
        order; the next build repeats this in the right one, and builds the readers of such a file again.
        """
        if not self._layout.merged:
            return False
        records = self._journal.records
        overwritten, deprived = set[str](), set[str]()
        states = cache(lambda name: self._states.contents(name, records[name].installed.digest) or {})
        for owners in self._common_files(plan.tasks).values():
            built = [name for name in plan.tasks if name in owners and records[name].complete]
            for before, name in pairwise(built):
                have_run = name in self._before and before in self._before
                if have_run and before not in self._before[name]:
                    # Either may have recorded the other one's file.
                    deprived.update((before, name))
        for path, owners in self.conflicting_files(plan.tasks).items():
            built = [name for name in plan.tasks if name in owners and records[name].complete]
            overwritten.update(
                name
                for name in owners
                if name in built or any(name in plan.tasks[each].needs for each in built)
            )
            contents = states(built[-1]) if built else {}
            if contents and contents_of([path], table)[path] != contents.get(path):
                deprived.add(built[-1])
                self._outdate_readers(path, owners, plan)
        for name in sorted(deprived):
            self._journal.set_record(name, replace(records[name], installed=Fingerprint()))
        overwritten -= deprived
        for name in sorted(overwritten):
            record = records[name]
            stamp = fingerprint_files((*record.files, *record.folders), table)[0].stamp
            if stamp != record.installed.stamp:
                self._journal.set_record(
                    name, replace(record, installed=replace(record.installed, stamp=stamp))
                )
        left = {
            path
            for name, task in plan.tasks.items()
            if name in records
            for path in frozenset(task.earlier).difference(records[name].files)
        }
        for name, record in sorted(records.items() if left else ()):
            taken = left.intersection(record.files)
            if record.installed.stamp and taken:
                self._journal.set_record(name, replace(record, installed=replace(record.installed, stamp="")))
            # The previous owner may have removed the file afterwards.
            if name in plan.tasks and any(
                content != states(name).get(path)
                for path, content in contents_of(sorted(taken), table).items()
            ):
                deprived.add(name)
        return bool(deprived)

    def _outdate_readers(self, path: str, owners: Collection[str], plan: BuildPlan) -> None:
        """Have the dependents of `owners` that may have read the file of another owner built from empty."""
        from forge.build.records import add_saved, read_record

        for name, task in plan.tasks.items():
            record = self._journal.records.get(name)
            # Results from the cache were built elsewhere.
            if record is None or not (record.complete and record.began):
                continue
            if frozenset(owners).isdisjoint(task.needs):
                continue
            last = read_record(task.build_dir)
            accesses = last.commands.all if last else ()
            if not accesses or any(each.blind or path in each.read | each.found for each in accesses):
                add_saved(task.build_dir, frozenset({path}))
                self._journal.set_record(name, replace(record, saved=(path, *record.saved)))


def owned_by_others(name: str, paths: frozenset[str], records: Mapping[str, BuildRecord]) -> frozenset[str]:
    others = (record for other, record in list(records.items()) if other != name)
    return frozenset[str]().union(*(paths.intersection(record.files) for record in others))
