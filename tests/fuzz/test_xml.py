"""Entities, external files and unusual encodings in XML are rejected."""

from __future__ import annotations

from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.xml import parse_xml

LAUGHS = "".join(f'<!ENTITY a{n} "&a{n - 1};&a{n - 1};">' for n in range(1, 40))


@pytest.mark.parametrize(
    "document",
    [
        f'<!DOCTYPE a [<!ENTITY a0 "ha">{LAUGHS}]><a>&a39;</a>',
        '<!DOCTYPE a SYSTEM "http://127.0.0.1:1/a.dtd"><a/>',
        '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>',
        '<!DOCTYPE a [<!ENTITY % b SYSTEM "file:///etc/passwd"> %b;]><a/>',
        "<!DOCTYPE a><a/>",
        '<!DOCTYPE a [<!ATTLIST a b CDATA "c">]><a/>',
    ],
)
def test_document_types_are_rejected(document: str) -> None:
    with pytest.raises(WorkspaceError, match="document type declarations are not allowed"):
        parse_xml(document.encode(), Path("package.xml"))


@pytest.mark.parametrize("content", [b"<a>&b;</a>", b"<a>\xff</a>", b"<a>\0</a>", b"<a>&#0;</a>"])
def test_entities_and_unusual_xml_are_rejected(content: bytes) -> None:
    with pytest.raises(WorkspaceError, match="not well-formed XML"):
        parse_xml(content, Path("package.xml"))


def test_nesting_depth_is_limited() -> None:
    assert parse_xml(b"<a>" * 100 + b"</a>" * 100, Path("package.xml")).tag == "a"
    with pytest.raises(WorkspaceError, match="nested more than 100 levels deep"):
        parse_xml(b"<a>" * 101 + b"</a>" * 101, Path("package.xml"))
