"""The shells that forge writes scripts for: what their languages share, and where they part, pure."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping


@frozen
class Shell:
    """A shell; its name is the extension of its scripts, its family the folder of their templates.

    Each of `special` means something between double quotes, unless `escape` is before it. Lists begin
    each path with `list_root`; where that is nothing the script's functions do it, which is quicker.
    """

    name: str
    family: str
    own: str
    special: re.Pattern[str]
    escape: str
    list_root: str = ""

    def quoted(self, text: str) -> str:
        """Return `text` as it stands between double quotes."""
        return self.special.sub(lambda match: self.escape + match.group(), text)

    def literal(self, text: str) -> str:
        """Return `text` as it stands between single quotes, or in PowerShell between @' and '@."""
        return re.sub(r"\\(?=[\\']|$)|'", r"\\\g<0>", text) if self.family == "fish" else text

    def borrows(self, path: str) -> bool:
        """Tell if a script is not for this shell, which lets sh run it and takes over what came of it."""
        return self.family != "sh" and path.endswith(".sh")


_SH = re.compile(r'[\\"$`]')
_FISH = re.compile(r'[\\"$]')
_POWERSHELL = re.compile('["$`\u201c\u201d\u201e]')

SHELLS: Mapping[str, Shell] = {
    shell.name: shell
    for shell in (
        Shell("sh", "sh", ".sh", _SH, "\\", "$_forge_root/"),
        Shell("bash", "sh", ".bash", _SH, "\\"),
        Shell("zsh", "sh", ".zsh", _SH, "\\"),
        Shell("fish", "fish", "", _FISH, "\\"),
        Shell("ps1", "ps1", "", _POWERSHELL, "`"),
    )
}
"""By name."""
