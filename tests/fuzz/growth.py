"""Inputs of any size for each harness: many items, deep nesting, long words.

A shape consists of a start, a repeated middle, a part that closes it as often, and an end. In the middle,
'%d' is replaced by the number of the repetition, which avoids duplicates, and '%e' by the previous number.
"""

from __future__ import annotations

from typing import Final

from forge.base.frozen import frozen


@frozen
class Shape:
    """An input that can have any size."""

    name: str
    middle: bytes
    before: bytes = b""
    closing: bytes = b""
    after: bytes = b""

    def of(self, size: int) -> bytes:
        """Return an input of about this size in bytes."""
        count = max(1, size // (len(self.middle) + len(self.closing)))
        if b"%d" in self.middle:
            middle = b"".join(
                self.middle.replace(b"%d", b"%d" % number).replace(b"%e", b"%d" % (number - 1))
                for number in range(count)
            )
        else:
            middle = self.middle * count
        return self.before + middle + self.closing * count + self.after


_HEAD: Final = b"""<package format="3"><name>p</name><version>1.0.0</version><description>d</description>
<maintainer email="a@b.cc">A</maintainer><license>L</license>"""
_TAIL: Final = b"</package>"
_IDL: Final = b"module fuzzed { module msg { "
_STRUCT: Final = _IDL + b"struct X { "
_END: Final = b" }; }; };"

_DOCUMENT: Final = (
    Shape("elements", b"<depend>p%d</depend>", _HEAD, after=_TAIL),
    Shape("twins", b"<depend>p</depend>", _HEAD, after=_TAIL),
    Shape("unknown elements", b"<x%d/>", _HEAD, after=_TAIL),
    Shape("unknown attributes", b' a%d="1"', _HEAD + b"<depend", after=b">p</depend>" + _TAIL),
    Shape("lines", b"<x%d/>\n", _HEAD, after=_TAIL),
    Shape("nested", b"<b>", _HEAD + b"<export>", b"</b>", b"</export>" + _TAIL),
    Shape("unclosed", b"<b>", _HEAD),
    Shape("mixed text", b"a<b/>", _HEAD + b"<export><x>", after=b"</x></export>" + _TAIL),
    Shape("entities", b"&amp;", _HEAD + b"<author>", after=b"</author>" + _TAIL),
    Shape("comments", b"<!-- -->a", _HEAD + b"<author>", after=b"</author>" + _TAIL),
    Shape("digits", b"1", _HEAD + b'<depend version_gte="1', after=b'">q</depend>' + _TAIL),
    Shape("mail", b"a.", _HEAD + b'<author email="', after=b'">A</author>' + _TAIL),
    Shape("conditions", b"a == b and ", _HEAD + b'<depend condition="', after=b'c == d">q</depend>' + _TAIL),
    Shape("parentheses", b"(", _HEAD + b'<depend condition="', after=b'">q</depend>' + _TAIL),
    Shape("namespaces", b"a:", _HEAD + b"<", after=b"/>" + _TAIL),
    Shape("blanks", b" ", _HEAD + b"<author>a", after=b"b</author>" + _TAIL),
)
_DECLARATIONS: Final = (
    Shape("fields", b"int8 a%d 5\n"),
    Shape("constants", b'string A%d = "x"\n'),
    Shape("headers", b"std_msgs/Header a%d\n"),
    Shape("unknown types", b"nobody/X a%d\n"),
    Shape("faults", b"!%d\n"),
    Shape("twins", b"int8 a\n"),
    Shape("comments", b"# a\n", after=b"int8 a\n"),
    Shape("comment behind", b"  # a\n", b"int8 a\n"),
    Shape("brackets in comments", b"[", b"int8 a  # ", after=b"\n"),
    Shape("blanks in comments", b" ", b"int8 a  # ", after=b"x\n"),
    Shape("units", b" [a]", b"int8 a  # ", after=b"\n"),
    Shape("many comments of blanks", b"#    \n", b"int8 b\n", after=b"int8 a\n"),
    Shape("a long name", b"a", b"int8 ", after=b"\n"),
    Shape("a long type", b"A", after=b" a\n"),
    Shape("a long number", b"1", b"int8 a ", after=b"\n"),
    Shape("dimensions", b"[]", b"int8", after=b" a\n"),
    Shape("slashes", b"a/", after=b"A a\n"),
    Shape("numbers", b"1, ", b"int8[] a [", after=b"1]\n"),
    Shape("bare texts", b"a, ", b"string[] a [", after=b"b]\n"),
    Shape("quoted texts", b'"a", ', b"string[] a [", after=b'"b"]\n'),
    Shape("open quotes", b'"', b"string[] a [", after=b"]\n"),
    Shape("backslashes", b"\\", b'string a "', after=b'"\n'),
    Shape("escaped quotes", b'\\"', b'string a "', after=b'"\n'),
    Shape("lone quotes", b"'\"", b"string[] a [", after=b"]\n"),
    Shape("blanks in texts", b"   ", b"string[] a [x", after=b"y]\n"),
    Shape("separators", b"---\n"),
    Shape("carriage returns", b"\r"),
)
_STRUCTURES: Final = (
    Shape("members", b"double a%d; ", _STRUCT, after=_END),
    Shape("declarators", b"a%d, ", _STRUCT + b"double ", after=b"z;" + _END),
    Shape("structs", b"struct X%d { double a; }; ", _IDL, after=b" }; };"),
    Shape(
        "constants",
        b"const short A%d = 1; ",
        _IDL + b"module X_Constants { ",
        after=b"}; struct X { double a; }; }; };",
    ),
    Shape("typedefs", b"typedef double d%d; ", _IDL, after=b"struct X { double a; }; }; };"),
    Shape("unknown types", b"d%d a%d;\n", _STRUCT, after=_END),
    Shape("modules", b"module a { ", closing=b"}; "),
    Shape("signs", b"-(", _STRUCT + b"@default (value=", b")", b"1) double a;" + _END),
    Shape("sequences", b"sequence<", _STRUCT, b">", b"a;" + _END),
    Shape("closed sequences", b"sequence<", _STRUCT + b"", b""),
    Shape("parentheses", b"(", _STRUCT + b"@default (value="),
    Shape("texts", b'"a" ', _STRUCT + b'@verbatim (language="comment", text=', after=b") double a;" + _END),
    Shape("annotations", b"@key ", _STRUCT, after=b"double a;" + _END),
    Shape("parameters", b"a%d=1, ", _STRUCT + b"@key (", after=b"z=1) double a;" + _END),
    Shape("sizes", b"[2]", _STRUCT + b"double a", after=b";" + _END),
    Shape("comments", b"/* */ ", _STRUCT, after=b"double a;" + _END),
    Shape("a long comment", b"*", b"/*", after=b"/"),
    Shape("an open comment", b"/*", b""),
    Shape("a tuple", b"(", _STRUCT + b'@default (value="', b",)", b'") double a[2];' + _END),
    Shape("a long tuple", b"1, ", _STRUCT + b'@default (value="(', after=b'1)") double a[2];' + _END),
    Shape(
        "minus signs in a tuple", b"-", _STRUCT + b'@default (value="(', after=b'1,)") double a[1];' + _END
    ),
    Shape("digits", b"1", _STRUCT + b"double a[", after=b"];" + _END),
)
_YAML: Final = (
    Shape("keys", b"k%d: 1\n"),
    Shape("lists", b"- a\n", b"build:\n"),
    Shape("nested in line", b"[", b"build: ", b"]"),
    Shape("nested mappings", b"{a: ", b"build: ", b"}"),
    Shape("open quote", b"a ", b'build: "'),
    Shape("unknown options", b"  k%d: 1\n", b"build:\n"),
)
_FLAT_YAML: Final = tuple(shape for shape in _YAML if shape.name != "nested in line")
"""The YAML parser takes seconds for deep nesting; once is enough."""
_TOML: Final = (
    Shape("keys", b"k%d = 1\n"),
    Shape("tables", b"[k%d]\n"),
    Shape("arrays", b"[", b"a = ", b"]"),
    Shape("inline tables", b"{a = ", b"a = ", b"}"),
    Shape("unknown options", b"k%d = 1\n", b"[build]\n"),
)
_JSON: Final = (
    Shape("nested", b"[", b"", b"]"),
    Shape("nested objects", b'{"a":', b"", b"}"),
    Shape("digits", b"1"),
    Shape("lines", b'{"a": 1}\n'),
)

_TREE: Final = (
    b'{"forge_tree": 4, "seconds": 1.5, "has_tests": true, "folders": [], "pack": {"hash": "'
    + b"0" * 64
    + b'", "size": 9}, "leaves": ['
)
_LINK: Final = b'["z", 0, 0, "", -1, false, "x", ""]]}'

SHAPES: Final[dict[str, tuple[Shape, ...]]] = {
    "manifest": _DOCUMENT,
    "condition": (
        Shape("and", b"a == b and ", after=b"c == d"),
        Shape("open", b"("),
        Shape("closed", b"(", b"", b")"),
    ),
    "message": _DECLARATIONS,
    "service": _DECLARATIONS[:3],
    "action": _DECLARATIONS[:3],
    "idl": _STRUCTURES,
    "schema": (
        Shape("sections", b"=" * 80 + b"\nMSG: a/X%d\nint8 a\n"),
        Shape("headings", b"=" * 80 + b"\n"),
    ),
    "defaults": _YAML,
    "forge-toml": _TOML,
    "metas": (*_FLAT_YAML, Shape("names", b"  n%d: {a: 1}\n", b"names:\n")),
    "colcon-pkg": _FLAT_YAML,
    "mixin": _FLAT_YAML,
    "cmake-lists": (
        Shape("open projects", b"project(a "),
        Shape("projects", b"project(a)\n"),
        Shape("open searches", b"find_package(a "),
        Shape("searches", b"find_package(a%d)\n"),
        Shape("open modules", b"pkg_check_modules(A B "),
        Shape("modules", b"pkg_check_modules(A b%d)\n"),
        Shape("required", b" REQUIRED", b"pkg_check_modules(A"),
        Shape("comments", b"# a\n"),
        Shape("quotes", b'"', b"#"),
        Shape("blanks", b" ", b"project", after=b"x"),
    ),
    "setup-py": (
        Shape("parentheses", b"("),
        Shape("lists", b"[", b"setup(name=", b"]", b")"),
        Shape("sums", b"1+", b"x = ", after=b"1"),
        Shape("calls", b"setup()\n"),
        Shape("names", b"a%d = 1\n"),
        Shape("attributes", b"a.", after=b"a"),
        Shape("lambdas", b"lambda: "),
        Shape("digits", b"1"),
        Shape("ifs", b"if 1: "),
        Shape("escapes", b"\\d", b'x = "', after=b'"'),
        Shape("requirements", b'"a%d", ', b"setup(name='a', install_requires=[", after=b"])"),
    ),
    "setup-cfg": (
        Shape("bad lines", b"x%d\n", b"[metadata]\n"),
        Shape("sections", b"[s%d]\n"),
        Shape("options", b"k%d = 1\n", b"[metadata]\n"),
        Shape("values", b" v\n", b"[metadata]\nname =\n"),
        Shape("percent", b"%%(x)s", b"[metadata]\nname = "),
        Shape("requirements", b" a%d>=1\n", b"[options]\ninstall_requires =\n"),
        Shape("digits", b"1", b"[options]\ninstall_requires = a~=1."),
    ),
    "pyproject": (
        *_TOML,
        Shape("requirements", b'"a%d", ', b'[project]\nname = "a"\ndependencies = [', after=b"]"),
    ),
    "journal": (
        *_JSON,
        *(
            Shape(
                f"{shape.name} in a line",
                shape.middle,
                b'{"forge_journal": 7}\n' + shape.before,
                shape.closing,
            )
            for shape in _JSON
        ),
        Shape("packages", b'{"package": "p%d"}\n', b'{"forge_journal": 7}\n'),
        Shape("externals", b'"/a%d", ', b'{"forge_journal": 7}\n{"externals": [', after=b'""]}\n'),
    ),
    "tables": _JSON,
    "dsv": (
        Shape("values", b";a%d", b"prepend-non-duplicate;PATH"),
        Shape("lines", b"set;A%d;b\n"),
        Shape("twins", b"prepend-non-duplicate;PATH;bin\n"),
        Shape("semicolons", b";", b"source"),
        Shape("sources", b"source;share/p/a%d.sh\n"),
        Shape("faults", b"x%d\n"),
        Shape("itself", b"source;share/p/package.dsv\n"),
        Shape("quotes", b"'\"", b"set;A;"),
        Shape("dollars", b"$(", b"set;A;"),
        Shape("appends", b"append-non-duplicate;A;b%d\n"),
    ),
    "install-index": (Shape("names", b"a%d:"),),
    "build-logs": (
        Shape("edges", b"build a: X /b%d\n"),
        Shape("open edges", b"build a"),
        Shape("dollars", b"$"),
        Shape("colons", b"build a: X"),
        Shape("paths", b" /a%d", b"build a: X"),
        Shape("records", b"\4\0\0\0a\0\0\0"),
        Shape("empty records", b"\0\0\0\0"),
        Shape("words", b"a \\\n"),
        Shape("quotes", b'  "/a'),
        Shape("backslashes", b"\\"),
        Shape("targets", b"a: /b%d\n"),
        Shape("open targets", b"a "),
    ),
    "test-results": (
        *(
            Shape(shape.name, shape.middle, b"<testsuite>" + shape.before, shape.closing, shape.after)
            for shape in _DOCUMENT
            if shape.name in {"nested", "unclosed", "lines"}
        ),
        Shape(
            "cases",
            b'<testcase name="a%d"><failure message="m"/></testcase>',
            b'<testsuite tests="1" failures="1">',
            after=b"</testsuite>",
        ),
        Shape("deep cases", b"<testsuite>", b"", b"</testsuite>"),
    ),
    "make-flags": (
        Shape("words", b" -k"),
        Shape("jobs", b" -j1"),
        Shape("digits", b"1", b"-j"),
        Shape("descriptors", b"1", b"--jobserver-auth="),
        Shape("dashes", b"-- "),
    ),
    "action-result": (
        Shape("files", b"\x12J\n\x02ab\x12D\n@" + b"0123456789abcdef" * 4 + b"\x10\x01"),
        Shape("unknown numbers", b"8\x01"),
        Shape("empty fields", b"2\x00"),
        Shape("open groups", b"k"),
        Shape("nested groups", b"k", b"", b"l"),
        Shape("long numbers", b"8" + b"\x80" * 9 + b"\x01"),
        Shape("numbers without end", b"\x80"),
        Shape("a long name", b"a", b"\x12\xff\xff\x7f\n\xfa\xff\x7f"),
    ),
    "stored-result": (
        *_JSON,
        Shape("files", b'["a", "' + b"1" * 64 + b'", 7], ', b'{"files": [', after=b'], "stdout": ""}'),
    ),
    "cached-tree": (
        *_JSON,
        Shape("links", b'["l%d", 0, 0, "", -1, false, "x", ""], ', _TREE, after=_LINK),
        Shape("files", b'["f%d", 420, 1, "' + b"1" * 64 + b'", 0, true, null, ""], ', _TREE, after=_LINK),
        Shape("twins", b'["l", 0, 0, "", -1, false, "x", ""], ', _TREE, after=_LINK),
        Shape("files below files", b'["a%e/a%d", 0, 0, "", -1, false, "x", ""], ', _TREE, after=_LINK),
        Shape("a deep file", b"a/", _TREE + b'["', after=_LINK[2:]),
        Shape(
            "folders",
            b'["f%d", 0], ',
            _TREE.partition(b"], ")[0],
            after=b'["f", 0]' + b"".join(_TREE.partition(b"], ")[1:]) + _LINK,
        ),
    ),
    "cached-inputs": (
        *_JSON,
        Shape("files", b'"/a%d", ', b'{"forge_inputs": 3, "lists": [[', after=b'"plain", ""]]}'),
        Shape("lists", b'["/a%d", "plain", ""], ', b'{"forge_inputs": 3, "lists": [', after=b"[]]}"),
    ),
    "generator-arguments": (Shape("words", b"--include\na=/b\n"), Shape("a long word", b"a", b"--package\n")),
}
