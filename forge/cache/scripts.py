"""What makes results depend on their path, besides source code: build scripts, options and what they make.

If these are the same as for a result that was shown not to depend on its path, that of other source code does
not depend on it either.
"""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.build.inputs.native_graph import read_native_graph
from forge.build.records import read_record
from forge.engine.commands import NOT_OBSERVED

if TYPE_CHECKING:
    from forge.cache.relocation import Relocator
    from forge.cache.trees import Tree

_OPTIONS = re.compile(r"^  (?:DEFINES|FLAGS) = (.*)$", re.MULTILINE)
_MAP = re.compile(r"-f\w+-prefix-map=\S+")


def scripts_digest(build: Path, source: Path, tree: Tree, relocator: Relocator) -> str:
    """Return a digest of all that a build read but the code that compilers take and the files that it copied.

    It is '' if that is unknown, or if compilers could see a path of the workspace: in a definition, or in a
    file that is no source of the package. Then other code may depend on it, even if only on its length.
    """
    graph, record = read_native_graph(build), read_record(build)
    seen = record.commands if record else NOT_OBSERVED
    if graph.tool != "ninja" or graph.has_dyndeps or seen.configure is None or seen.rest is None:
        return ""
    edges = [(edge, seen.edges[edge.outputs[0]]) for edge in graph.edges if edge.outputs[0] in seen.edges]
    options = (_MAP.sub("", found) for edge in graph.edges for found in _OPTIONS.findall(edge.text))
    if any(each.blind for each in seen.all) or any(relocator.occur_in(os.fsencode(each)) for each in options):
        return ""
    compiling = [(each.read, frozenset(graph.inputs_of(edge))) for edge, each in edges if edge.compiles]
    others = (each.read for edge, each in edges if not edge.compiles and not edge.links_dynamically)
    scripts = seen.configure.read.union(*others, *(read - code for read, code in compiling))
    made = seen.rest.written.union(*(each.written for _, each in edges))
    generated = seen.configure.written | made
    compiled = frozenset[str]().union(*(read | code for read, code in compiling))
    copied = {leaf.hash for leaf in tree.leaves}
    lines = []
    for path in sorted(scripts | seen.rest.read | compiled):
        is_generated = path in compiled and path in generated
        is_script = (path in scripts or path in seen.rest.read) and path not in made
        word = relocator.relativize_word(path)
        is_foreign = path in compiled and word != path and not path.startswith(f"{source}/")
        if not (is_generated or is_script or is_foreign) or not os.path.isfile(path):  # noqa: PTH113
            continue
        content = Path(path).read_bytes()
        if (is_generated or is_foreign) and relocator.occur_in(content):
            return ""
        digest = hashlib.sha256(relocator.relativize(content)).hexdigest()
        if is_generated or (is_script and (path in scripts or digest not in copied)):
            lines.append(f"{word} {digest}")
    return hashlib.sha256("\n".join(lines).encode(errors="surrogateescape")).hexdigest()
