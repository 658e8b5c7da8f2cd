"""Replace workspace paths in installed files by placeholders before caching, and insert them when restoring.

This alone does not make a result valid at another path: paths are written in many ways, and a result may
depend on a path without containing it. Builds at different paths reveal this, see
`forge.plugins.package_cache.package_cache`.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from forge.base.env_vars import expand_home

if TYPE_CHECKING:
    from mmap import mmap
    from pathlib import Path

    from forge.base.layout import Layout

_MARK = b"@FORGE_"
"""The prefix of all placeholders. A file that already contains it is stored as it is."""
_NAME_CONTINUES = rb"(?:[\w\x80-\xff-]|\.[\w\x80-\xff-])"
"""Text after a match that shows that it is only the beginning of another folder's name."""


class Relocator:
    """Replaces the folders of one workspace in bytes and strings by placeholders and back."""

    def __init__(self, root: Path, layout: Layout) -> None:
        self.root = str(root)
        self._home = f"{expand_home('~')}/"
        folders = (str(layout.install), str(layout.build))
        self.arrangement = tuple(folder.removeprefix(f"{root}/") for folder in folders)
        """The other folders: below the root, or elsewhere."""
        self.is_plain = all(re.fullmatch(r"[\w/.+-]*", path) for path in (self.root, *folders))
        """Whether paths can be written without quotes everywhere."""
        names = (b"@FORGE_INSTALL@", b"@FORGE_BUILD@", b"@FORGE_ROOT@")
        paths = (path.encode(errors="surrogateescape") for path in (*folders, self.root))
        self._path_of = dict(zip(names, paths, strict=True))
        self._name_of = {path: name for name, path in self._path_of.items()}
        # The longest first: install and build usually lie below the root.
        either = b"|".join(map(re.escape, sorted(self._name_of, key=len, reverse=True)))
        self._paths_regex = re.compile(rb"(?:" + either + rb")(?!" + _NAME_CONTINUES + rb")")
        self._names_regex = re.compile(b"|".join(names))

    def occur_in(self, content: bytes | mmap) -> bool:
        """Return True if a file contains a path of the workspace."""
        return self._paths_regex.search(content) is not None

    def relativize(self, content: bytes) -> bytes:
        """Return a file's bytes with placeholders for the workspace's paths; binary files stay unchanged."""
        if b"\0" in content or _MARK in content:
            return content
        return self._with_placeholders(content)

    def absolutize(self, content: bytes) -> bytes:
        """Replace the placeholders in the result of `relativize` by the paths of this workspace."""
        return self._names_regex.sub(lambda match: self._path_of[match[0]], content)

    def relativize_word(self, text: str) -> str:
        """Return an option or path with placeholders for the workspace's paths."""
        relative = self._with_placeholders(text.encode(errors="surrogateescape"))
        return relative.decode(errors="surrogateescape")

    def absolutize_word(self, text: str) -> str:
        """Replace the placeholders in the result of `relativize_word` by the paths of this workspace."""
        return self.absolutize(text.encode(errors="surrogateescape")).decode(errors="surrogateescape")

    def relativize_input(self, path: str) -> str:
        """Return the name that other users have for a file that a build read or looked for.

        Questions are unchanged. In the home folder, only missing files are renamed: a result may contain the
        path of an existing one.
        """
        word = self.relativize_word(path)
        is_others = word.startswith(self._home) and not os.path.lexists(word)
        return f"~/{word.removeprefix(self._home)}" if is_others else word

    def absolutize_input(self, word: str) -> str:
        """Return this user's path for the result of `relativize_input`."""
        return self._home + word[2:] if word.startswith("~/") else self.absolutize_word(word)

    def _with_placeholders(self, content: bytes) -> bytes:
        return self._paths_regex.sub(lambda match: self._name_of[match[0]], content)
