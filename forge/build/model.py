"""Inputs of package builds, and the records that the journal keeps of them."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

from forge.base.frozen import Pairs, frozen

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.build.up_to_date import InputChange


@frozen
class Fingerprint:
    """Digests of a set of files at one moment.

    `stamp` covers their stats ('' if these cannot be trusted), `digest` covers names, modes and contents.
    """

    stamp: str = ""
    digest: str = ""


@frozen
class BuildInputs:
    """The inputs of a package build, as strings and digests. Equal inputs produce an equal package.

    `options` affect the arguments of its steps, `tools` are program identities by name, `environment` the
    variables that builds may read, `sources` a digest. `needs` maps each direct dependency to a digest of its
    installed files and those of its transitive dependencies. `underlays` is a digest of the package names
    available in the underlays.
    """

    forge: str = ""
    options: tuple[str, ...] = ()
    tools: Pairs = ()
    environment: Pairs = ()
    sources: str = ""
    needs: Pairs = ()
    underlays: str = ""


@frozen
class BuildRecord:
    """The journal's record of a package's last build.

    `complete` is False from the start of the build until it succeeds. `files` are the installed files, as
    absolute paths; `externals` are the files outside the workspace that the build read or looked for, and
    its questions for a `World`; `external` is the digest of their contents and answers. Times are seconds
    since the epoch; `began` is 0 for a package restored from the cache. `tree` is a path-independent digest
    of the files for the package cache, '' if not yet computed.
    `saved` are inputs that were written while the build ran; the outputs may reflect any of their states.
    `from_empty` is True if the build started in an empty build folder. `read_from` are undeclared
    dependencies: packages whose build folder or prefix the build read. `folders` are the empty folders that
    it installed, as absolute paths ending with '/'.
    """

    inputs: BuildInputs
    complete: bool = False
    sources: Fingerprint = Fingerprint()
    installed: Fingerprint = Fingerprint()
    files: tuple[str, ...] = ()
    externals: tuple[str, ...] = ()
    external: str = ""
    seconds: float = 0.0
    began: float = 0.0
    tree: str = ""
    saved: tuple[str, ...] = ()
    from_empty: bool = False
    read_from: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()

    @property
    def source(self) -> str:
        """The source folder of the last build, '' if no build recorded it."""
        return self.inputs.options[1] if self.inputs.options[1:] else ""


@frozen
class Snapshot:
    """The current state on disk, beside the records of earlier builds.

    `sources` and `installed` are current fingerprints, the latter of the files listed in the record.
    `present` are the packages whose prefix is marked as complete. `changed_externals`, `source_changes` and
    `installed_changes` name the changes of a package: inputs outside it, its sources, its installed files.
    """

    records: Mapping[str, BuildRecord] = field(default_factory=dict)
    sources: Mapping[str, Fingerprint] = field(default_factory=dict)
    installed: Mapping[str, Fingerprint] = field(default_factory=dict)
    changed_externals: Mapping[str, InputChange] = field(default_factory=dict)
    present: frozenset[str] = frozenset()
    source_changes: Mapping[str, str] = field(default_factory=dict)
    installed_changes: Mapping[str, str] = field(default_factory=dict)
