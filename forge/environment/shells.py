"""The shells that forge writes scripts for."""

from __future__ import annotations

import re
from collections.abc import Mapping

from forge.base.frozen import frozen


@frozen
class Shell:
    """A shell; `name` is the extension of its scripts, `family` the folder of their templates.

    Characters matching `special` are escaped with a backslash between double quotes. List entries start with
    `list_root`; if it is empty, functions of the script add the root, which is faster.
    """

    name: str
    family: str
    own: str
    special: re.Pattern[str]
    list_root: str = ""

    def quoted(self, text: str) -> str:
        """Escape `text` for double quotes."""
        return self.special.sub(lambda match: "\\" + match.group(), text)

    def runs_in_sh(self, path: str) -> bool:
        """Return whether sh must run a script, whose changes this shell then imports."""
        return self.family != "sh" and path.endswith(".sh")


_SH = re.compile(r'[\\"$`]')
_FISH = re.compile(r'[\\"$]')

SHELLS: Mapping[str, Shell] = {
    shell.name: shell
    for shell in (
        Shell("sh", "sh", ".sh", _SH, "$_forge_root/"),
        Shell("bash", "sh", ".bash", _SH),
        Shell("zsh", "sh", ".zsh", _SH),
        Shell("fish", "fish", "", _FISH),
    )
}
"""The supported shells by name."""
