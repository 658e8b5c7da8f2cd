"""Creates the README for package indexes: its links lead to the project's site, or become plain text."""

from __future__ import annotations

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

_LINK = re.compile(r"(!?)\[([^]\[]*)\]\((?!https?:|#)([^)]*)\)")
"""A link to a file of the repository; with '!', a picture."""


class Readme(MetadataHookInterface):
    """Sets the field `readme`."""

    def update(self, metadata: dict[str, object]) -> None:
        """Read the README with links below `project.urls.Documentation`, if the project has one."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        urls = metadata.get("urls", {})
        site = urls.get("Documentation", "") if isinstance(urls, dict) else ""
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(text, site)}


def absolute(text: str, site: str) -> str:
    """Return Markdown whose links to files lead below `site`.

    Without a site, links become text and pictures are removed.
    """
    if site:
        return _LINK.sub(rf"\1[\2]({site.rstrip('/')}/\3)", text)
    return _LINK.sub(lambda link: "" if link[1] else link[2], text)
