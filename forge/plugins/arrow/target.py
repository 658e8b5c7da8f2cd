"""The target 'arrow': the module forge_arrow, which converts messages, and the comments of their fields."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from forge.interfaces.model import Catalog, File, Message, sections_of


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'forge_arrow.py', and 'PACKAGE.json' with the comments and units of all messages."""
    yield File("forge_arrow.py", Path(__file__).with_name("forge_arrow.py").read_text(encoding="utf-8"))
    messages = (part for interface in catalog.interfaces.values() for part in sections_of(interface))
    comments = {str(message.name): _comments(message) for message in messages}
    yield File(f"{catalog.package}.json", json.dumps(comments, indent=2, ensure_ascii=False) + "\n")


def _comments(message: Message) -> dict[str, dict[str, str]]:
    """Return the metadata of the fields of a message by name; the empty name has those of the message."""
    metadata = {"": {"comment": "\n".join(message.doc)}}
    for field in message.fields:
        metadata[field.name] = {"comment": "\n".join(field.doc), "unit": field.unit or ""}
    texts = {name: {key: text for key, text in each.items() if text} for name, each in metadata.items()}
    return {name: each for name, each in texts.items() if each}
