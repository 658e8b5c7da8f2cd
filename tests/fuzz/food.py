"""Inputs of harnesses: valid files, words of their languages, and mutations of both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from tests.fuzz.harnesses import HARNESSES, PLAIN

if TYPE_CHECKING:
    import random

_DEFINITION: Final = b"""# What it is for
# [unit] second line

uint8 ONE=1   # first
string TEXT="a\\"b\\n"
float64 x 1.5e3  # metres [m]
string<=5[<=3] names ["a", 'b']
std_msgs/Header header
byte[3] data [1, 2, 0xff]
wstring w "\\u00e9"
"""
_IDL: Final = b"""// a comment
#include "std_msgs/msg/Header.idl"
module fuzzed { module msg {
  typedef double double__3[3];
  module X_Constants { const short ONE = 1; const string<5> T = "a" "b\\n"; };
  @verbatim (language="comment", text="what" "\\n" "it is")
  struct X {
    @default (value=1.5) @unit (value="m") double x;
    sequence<std_msgs::msg::Header, 3> headers;
    double__3 d; wstring w; @key long long a, b[2];
  };
}; };
"""
_MANIFEST: Final = b"""<?xml version="1.0"?>
<package format="3">
  <name>fuzzed</name><version compatibility="1.0.0">1.2.3</version>
  <description>What <b>it</b> is &amp; does</description>
  <maintainer email="a@example.com">A Person</maintainer><author>Another</author>
  <license file="LICENSE">Apache-2.0</license><url type="website">http://example.com</url>
  <depend version_gte="1.0.0" version_lt="2.0.0">rclcpp</depend>
  <build_depend condition="$ROS_VERSION == 2 and ('a' != b)">other</build_depend>
  <member_of_group>g</member_of_group><group_depend>h</group_depend>
  <export><build_type>ament_cmake</build_type><deprecated>old</deprecated><x y="z">t</x></export>
</package>
"""
_DEFAULTS: Final = b"""build:
  cmake-args: ["-DA=1", -DB=2]
  symlink-install: true
  jobs: 4
  mixin: [release]
base: &b {a: 1}
list: {<<: *b, when: 2001-12-14, none: ~, n: 0x1f, f: 1e3, t: !!str 5}
"""
_TOML: Final = b"""[build]
cmake-args = ["-DA=1"]
jobs = 4
[profiles.fast.build]
symlink-install = true
[packages.p]
cmake-args = ["-DB=2"]
when = 2001-12-14T10:00:00Z
"""
_METAS: Final = b"""names: {p: {dependencies: [q], hooks: [[a.dsv, b]], cmake-args: [-DA]}}
paths: {p: {type: ros.cmake, name: other}}
"""
_CMAKE: Final = b"""cmake_minimum_required(VERSION 3.10)  # project(no)
project( "fuzzed" VERSION 1.0 LANGUAGES CXX)
find_package(rclcpp 1.0 REQUIRED COMPONENTS a)
pkg_check_modules(X REQUIRED QUIET glib-2.0>=2.4 other)
"""
_SETUP_PY: Final = b'''"""What it is."""
from setuptools import find_packages, setup
name = "fuzzed"
setup(name=name, version="1.0", install_requires=["a>=1,<2", "b ~= 1.2 ; python_version > '3'"],
      maintainer="A, B", maintainer_email="a@b.cc, c@d.ee", extras_require={"test": ["pytest"]},
      packages=find_packages(), tests_require=["x", *name], **{})
'''
_SETUP_CFG: Final = b"""[metadata]
name = fuzzed
version = attr: x.y
maintainer = A
maintainer-email = a@b.cc
[options]
install_requires =
  a>=1
  b ; python_version > "3"
[options.extras_require]
test = pytest; x
[install]
install_scripts = $base/lib/fuzzed
"""
_PYPROJECT: Final = b"""[build-system]
requires = ["hatchling>=1"]
build-backend = "hatchling.build"
backend-path = ["."]
[project]
name = "fuzzed"
version = "1.0"
dependencies = ["a>=1"]
maintainers = [{name = "A", email = "a@b.cc"}]
[project.optional-dependencies]
test = ["pytest"]
[tool.poetry]
name = "other"
"""
_JOURNAL: Final = b"""{"forge_journal": 7}
{"ended": false}
{"externals": ["/usr/include/a.h", "/usr/include/b.h"]}
{"package": "p", "inputs": {"forge": "1", "options": ["a"], "tools": [["cmake", "1"]], \
"environment": [], "sources": "s", "needs": [["q", "d"]]}, "complete": true, \
"sources": {"stamp": "", "digest": "d", "names": "n"}, \
"installed": {"stamp": "", "digest": "d", "names": "n"}, \
"files": ["/ws/install/p/a"], "externals": [0, 1], "external": "e", "seconds": 1.5, "began": 2.5,
"saved": ["a.c"], "from_empty": true, "read_from": ["q"]}
{"stamp": "s"}
{"package": "q"}
{"ended": true}
"""
_TABLE: Final = b"""{"version": 2, "began": 12, "python": "/usr/bin/python3", "underlays": ["/a"],
"woken": {"a": 1},
"traces": {"base": "", "options": "", "shape": "", "moved": ""}, "files": {"a": ["1 2", "d"]},
"base": "b", "shape": "s", "stamp": "", "sources": {"/a": ["1 2", "d"]}, "externals": null,
"dropped": [],
"needs": ["a/msg/B"], "folders": {"a": "/a"}, "parts": {"python X": ["d", {"f": [1, 2]}]}}
"""
_DSV: Final = b"""# hooks
prepend-non-duplicate;PATH;bin
prepend-non-duplicate-if-exists;PYTHONPATH;lib/python3/site-packages;other
append-non-duplicate;X;/a:b
set;NAME;lib
set-if-unset;NAME2;"$(a)`b`"
source;share/p/hook/x.sh
source;share/p/hook/x.dsv
"""
_NINJA: Final = b"""build a.o: CXX_COMPILER /usr/include/a$ b.h /x.cpp || order
set(CMAKE_MAKEFILE_DEPENDS
  "/usr/share/x/a.cmake"
  )
all: /usr/lib/libx.so
CMAKE_GENERATOR:INTERNAL=Ninja
[{"directory": "/b", "file": "a.cpp"}]
"""
_RESULT: Final = b"""<?xml version="1.0"?>
<testsuites><testsuite name="s" tests="2" failures="1" errors="0" skipped="0">
<testcase name="a" classname="c" time="0"><failure message="m">text</failure></testcase>
<testcase name="b"><system-out>o</system-out><error message="e"/></testcase></testsuite></testsuites>
"""
_CTEST: Final = b"""<Site><Testing><Test Status="failed"><Name>a</Name><Results><Measurement>
<Value>out</Value></Measurement></Results></Test><Test Status="passed"><Name>b</Name></Test></Testing></Site>
"""
_FLAGS: Final = b"kw -j8 -l2.5 --jobserver-auth=3,4 --jobserver-fds=5,6 --no-print-directory -- A=b"
_TREE: Final = (
    b'{"forge_tree": 4, "seconds": 1.5, "has_tests": true, "folders": [["share/empty", 448]], '
    b'"pack": {"hash": "' + b"0" * 64 + b'", "size": 9}, "leaves": ['
    b'["lib/a", 420, 9, "' + b"1" * 64 + b'", 0, true, null, ""], '
    b'["lib/b", 0, 0, "", -1, false, "a", ""]]}'
)
_ACTION: Final = (
    b"\x12O\n\x04pack\x12E\n@"
    + b"0123456789abcdef" * 4
    + b"\x10\x80\x02 \x01*\x04note2\x08\n\x04some\x10\x05kl"
)
_SECTION: Final = b"=" * 80 + b"\n"

SEEDS: Final[dict[str, tuple[bytes, ...]]] = {
    "manifest": (_MANIFEST, PLAIN),
    "condition": (b"$ROS_VERSION == 2 and ('a' != \"b\" or (x<=y))",),
    "message": (_DEFINITION,),
    "service": (_DEFINITION + b"---\nbool ok true\n",),
    "action": (b"int32 a 5\n---\n" + _DEFINITION + b"---\nfloat32 f -1e-5\n",),
    "idl": (_IDL,),
    "schema": (
        _DEFINITION + _SECTION + b"MSG: std_msgs/Header\nint8 a\n",
        _SECTION + b"IDL: fuzzed/msg/X\n" + _IDL,
    ),
    "defaults": (_DEFAULTS, b'{"build": {"cmake-args": ["a"]}}'),
    "forge-toml": (_TOML,),
    "metas": (_METAS,),
    "colcon-pkg": (b"name: other\ntype: ros.cmake\nhooks: [a.dsv]\ncmake-args: [-DA]\n",),
    "mixin": (b"build:\n  a: {mixin: [b], cmake-args: [-DA]}\n  b: {jobs: 3}\n",),
    "cmake-lists": (_CMAKE,),
    "setup-py": (_SETUP_PY,),
    "setup-cfg": (_SETUP_CFG,),
    "pyproject": (_PYPROJECT,),
    "journal": (_JOURNAL,),
    "tables": (_TABLE, b'[2, {"a": ["b", "c"]}]', b"name\t12\t/path\n"),
    "dsv": (_DSV,),
    "install-index": (b"a:b:c", b"isolated\n"),
    "build-logs": (_NINJA, b"\x0c\0\0\0/a/b.h\0\0\xff\xff\xff\xff\x10\0\0\x80\0\0\0\0" + bytes(12)),
    "test-results": (_RESULT, _CTEST, b"20260101-0000\nNightly\n"),
    "make-flags": (_FLAGS,),
    "action-result": (_ACTION, b"*\x04note"),
    "stored-result": (b'{"files": [["index", "%s", 7]], "stdout": "note"}' % (b"0a" * 32),),
    "cached-tree": (_TREE,),
    "cached-inputs": (
        b'{"forge_inputs": 3, "lists": [["/usr/include/a.h", "plain", ""], ["spaced", "\'x\' has"]]}',
    ),
    "generator-arguments": (b"--package\np\n--include\nq=/x\n--file\n/src:msg/X.msg\n@other\n",),
}
"""Valid inputs of each harness."""

WORDS: Final = (
    *b"""
    <a> </a> <a/> <![CDATA[ ]]> <!-- --> <!DOCTYPE &lt; &#0; &#x10ffff; <?x ?> <depend> </depend> <export>
    condition= version_lt= [[[[ ]]]] {{{{ }}}} (((( )))) <<<< >>>> "" '' \"\"\" ''' \\ \\\\ \\u \\ud800
    \\x \\777
    // /* */ # --- === ; , : :: . .. ../ / // @ @@ ! !! & * && ** | > - -- + ~ ` $ $( ${ $$ % %% ? ?? ??/ = ==
    0 -0 1 -1 01 0x 0xffffffffffffffff 1e999 -1e999 nan inf 99999999999999999999 1_000 1.5 .5 5.
    true false null
    !!int !!float !!binary !!timestamp !!python/name:os.system &a *a <<: ~ 2001-99-99 1:99:99 ? | >-
    name version package parts files externals stamp ended complete seconds sources installed traces began
    uint8 string string<=0 wstring<=5[] byte[0] byte[-1] byte[18446744073709551616] fuzzed/X X[] char int
    module struct typedef const enum sequence< sequence<sequence< @default (value= @verbatim any union NaN
    project( find_package( pkg_check_modules( setup( setup() import lambda: {**{}} f"{x}" b"" -1 not
    source; set; set-if-unset; prepend-non-duplicate; PATH; --jobserver-auth= --jobserver-auth=fifo: -j -l @
    tests= failures= <testsuite <testcase Status= [a [a.b] = [[a]] a.b.c.d
    """.split(),
    b"\n",
    b"\r\n",
    b"\t",
    b" ",
    b"\0",
    b"\x1b",
    b"\x0c",
    b"\xff",
    b"\xc3\x28",
    b"\xed\xa0\x80",
    b"\xef\xbb\xbf",
    b"\xe2\x80\xae",
    b"\xe2\x80\xa8",
    b"\xc2\x85",
    b"\xff\xff\xff\x7f",
    b"\x04\0\0\x80",
    b"1" * 5000,
)
"""Words of all languages; each is inserted into inputs of any language."""


def mutated(name: str, chance: random.Random) -> bytes:
    """Return a valid input of a harness after some random changes."""
    data = bytearray(chance.choice(SEEDS[name]))
    for _ in range(chance.choice((1, 1, 2, 3, 8, 40))):
        at = chance.randrange(len(data) + 1)
        end = min(len(data), at + chance.choice((0, 1, 2, 5, 30)))
        match chance.randrange(6):
            case 0:
                data[at:end] = b""
            case 1:
                data[at:end] = data[at:end] * chance.choice((2, 3, 50))
            case 2:
                data[at:end] = chance.randbytes(chance.choice((1, 2, 8)))
            case 3:
                other = chance.choice(SEEDS[name])
                start = chance.randrange(len(other) + 1)
                data[at:end] = other[start : start + chance.randrange(60)]
            case _:
                data[at:end] = chance.choice(WORDS) * chance.choice((1, 1, 1, 2, 20))
        del data[20_000:]
    return bytes(data)


assert SEEDS.keys() == HARNESSES.keys(), SEEDS.keys() ^ HARNESSES.keys()
