"""print a definition with all definitions it refers to, as stored in MCAP and rosbag2 files"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from forge.base.errors import InterfaceError, Location, Problem
from forge.base.frozen import frozen
from forge.base.options import option, options_of
from forge.cli.commands.interface.inputs import IncludeOptions, known_library
from forge.cli.options import profile_option
from forge.interfaces.idl import idl_text
from forge.interfaces.model import TypeName, nested_types, sections_of
from forge.interfaces.read.parsing import Parsed
from forge.interfaces.resolve.resolution import nested_messages, require
from forge.interfaces.schema import SEPARATOR
from forge.interfaces.show import parse_type_name
from forge.plugins.interface_queries.hash import unknown_type

ENCODINGS = ("ros2msg", "ros2idl")


@frozen
class Options:
    type: str = option("full name of the type", positional=True, metavar="TYPE")
    encoding: str = option(
        "format of the definitions (default: %(default)s)", default=ENCODINGS[0], choices=ENCODINGS
    )
    others: IncludeOptions = options_of(IncludeOptions)
    profile: str | None = profile_option()


def run(options: Options) -> int:
    library = known_library(options.others.rosdistro, options.others.folders, options.profile)
    name = parse_type_name(options.type)
    parsed = library.find(name) or unknown_type(name, library, options.profile)
    nested_messages(parsed, library)
    print(schema_text(parsed, lambda below: require(below, library), options.encoding), end="")
    return 0


def schema_text(parsed: Parsed, find: Callable[[TypeName], Parsed], encoding: str) -> str:
    """Return the definition of an interface, followed by those of nested messages, depth first.

    `find` returns the definition of a message. The encoding 'ros2msg' contains the original definitions and
    raises InterfaceError for one in IDL; 'ros2idl' converts them to IDL. Exceptions of `find` propagate.
    """
    own = _definition(parsed, encoding)
    start = f"{_heading(parsed, encoding)}\n" if encoding == "ros2idl" else ""
    nested = _below(parsed, find, set())
    texts = [f"{_heading(each, encoding)}\n{_definition(each, encoding)}" for each in nested]
    return "\n".join((start + own, *texts))


def _below(parsed: Parsed, find: Callable[[TypeName], Parsed], seen: set[TypeName]) -> Iterator[Parsed]:
    """Yield each nested message once, sorted by name on each level, depth first."""
    sections = sections_of(parsed.interface)
    for name in sorted(nested_types(sections) - {message.name for message in sections}):
        if name not in seen:
            seen.add(name)
            nested = find(name)
            yield nested
            yield from _below(nested, find, seen)


def _heading(parsed: Parsed, encoding: str) -> str:
    name = parsed.interface.name
    shown = f"IDL: {name}" if encoding == "ros2idl" else f"MSG: {name.package}/{name.name}"
    return f"{SEPARATOR}\n{shown}"


def _definition(parsed: Parsed, encoding: str) -> str:
    source = parsed.source
    is_idl = source.relative.endswith(".idl")
    if encoding == "ros2idl" and not is_idl:
        return idl_text(parsed.interface, f"{source.package}/{source.relative}")
    if encoding != "ros2idl" and is_idl:
        message = f"'{parsed.interface.name}' is written in IDL"
        raise InterfaceError(Problem(message, Location(source.path), "use --encoding ros2idl"))
    return source.text.removeprefix("\ufeff")
