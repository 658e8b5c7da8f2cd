"""Parses command lines as colcon does; started by colcon's interpreter.

Reads a JSON list of command lines from stdin. Prints {"options": {VERB: [...]}, "parsed": [...]}, where a
command line is {DESTINATION: VALUE}, or null if colcon refuses it.
"""

import contextlib
import json
import os
import sys
from pathlib import Path

from colcon_core import command
from colcon_core.location import set_default_config_path
from colcon_core.verb import get_verb_extensions

set_default_config_path(path=Path(os.devnull))


def parser_of(verb: str) -> "tuple[object, list[str]]":
    """Return the parser for all verbs with the options of one, and these options."""
    parser = command.create_parser("colcon_core.environment_variable")
    verbs = get_verb_extensions(group_name="colcon_core.verb")
    subparsers = command.create_subparser(parser, "colcon", verbs, attribute="verb_name")
    own = command.add_parsers_without_arguments(parser, subparsers, verbs, attribute="verb_name")[verb]
    command.add_parser_arguments(own, verbs[verb])
    while not hasattr(own, "_option_string_actions"):
        own = own._parser
    return parser, sorted(own._option_string_actions)


def parsed(parser: object, argv: "list[str]") -> "dict[str, object] | None":
    """Return the values of a command line."""
    with contextlib.suppress(SystemExit), open(os.devnull, "w") as nowhere:  # noqa: PTH123
        with contextlib.redirect_stderr(nowhere), contextlib.redirect_stdout(nowhere):
            values = vars(parser.parse_args(argv))
        return {name: value for name, value in values.items() if isinstance(value, (str, list, bool, int))}
    return None


parsers = {verb: parser_of(verb) for verb in ("build", "test")}
lines = json.load(sys.stdin)
results = [parsed(parsers[argv[0]][0], argv) for argv in lines]
json.dump({"options": {verb: words for verb, (_, words) in parsers.items()}, "parsed": results}, sys.stdout)
