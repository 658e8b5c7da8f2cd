"""From argv to a command, and from errors to exit codes; nothing else decides either.

Exit codes: 0 done, 1 a package failed, 2 the user must mend something, 70 our bug, 130 interrupted.
"""

from __future__ import annotations

import argparse
import errno
import importlib
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from forge import __version__
from forge.configuration import GENERAL, configured
from forge.errors import EXIT_INTERRUPTED, ForgeError, Problem, said_once
from forge.interrupts import caught, interrupt, is_writable
from forge.refusals import refusal
from forge.workspace_root import find_root, standing_in, typed_elsewhere

if TYPE_CHECKING:
    from collections.abc import Sequence

COMMANDS = {
    "build": "build the packages of a workspace",
    "test": "run the tests of the packages of a workspace",
    "test-result": "show what the tests came to",
    "clean": "remove what was built",
    "completion": "print a script that completes command lines",
    "list": "list the packages of a workspace",
    "graph": "show how packages depend on each other",
    "info": "show what is known about packages",
    "doctor": "say what is wrong with the machine, the shell or the workspace",
    "deps": "name what the workspace needs from the system",
    "extensions": "show what forge knows: build types, event handlers, shells",
    "mixin": "list and show named sets of options",
    "interface": "compile, list and show .msg, .srv and .action files",
    "pkg": "create a package; ask about installed ones",
    "run": "run an executable of an installed package",
    "env": "print what sourcing the workspace sets",
    "shell": "start a shell, or a command, that needs no sourcing",
    "cache": "look after what builds keep for others",
    "bundle": "pack what running needs into one archive",
}

_VALUED = frozenset({"--log-base", "--log-level", "-C"})

_IN_WORKSPACE = frozenset(
    {"build", "test", "test-result", "list", "graph", "info", "clean", "env", "shell", "bundle"}
    | {"doctor", "deps"}
)
"""The commands that run at the root of the workspace, wherever inside they are typed."""

EXIT_USER = 2
EXIT_BUG = 70


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        with caught(interrupt), standing_in(_folder(arguments)):
            code = _run(arguments)
        sys.stdout.flush()
    except ForgeError as error:
        for problem in said_once(error.problems):
            print(problem.render(), file=sys.stderr)
        return EXIT_USER
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has left, as `head` does: not an error, but the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _refused(error)
    except Exception as error:  # noqa: BLE001  (the last resort: say that it is our fault, and where to tell)
        return _no_memory() if isinstance(error, MemoryError) else _our_bug()
    return code


def _run(arguments: Sequence[str]) -> int:
    """Run the command where it belongs: at the root of the workspace, if it is about one."""
    origin = Path.cwd()
    root = find_root(origin, Path.home()) if _asked(arguments) in _IN_WORKSPACE else origin
    if root != origin:
        arguments = typed_elsewhere(arguments, origin, root)
    with standing_in(root):
        options = _options(arguments, os.path.relpath(origin, root))
        # A command that goes on for hours reads them again: they stand in files, too.
        options.read_again = partial(_options, arguments, options.origin)
        code: int = options.run(options)
    return code


def _options(arguments: Sequence[str], origin: str) -> argparse.Namespace:
    """Return what the command line and the files of options say; `origin` is where it was typed."""
    options = parser_of(arguments).parse_args(arguments)
    options.origin = origin
    for dest, value in getattr(options, "general", {}).items():
        if getattr(options, dest) is None:
            setattr(options, dest, value)
    return options


_NOT_GIVEN = object()
_MANY = 7
"""More options than these are listed below the usage, but not in it."""


class Parser(argparse.ArgumentParser):
    """argparse with our exit code, a hint instead of a page of usage, and colcon's greedy options.

    A greedy option takes every following word that is no option of the command, so that
    `--cmake-args -DX=1 -Wno-dev --symlink-install` means what it says.
    """

    greedy: frozenset[str] = frozenset()
    verb: str | None = None
    """The command whose options files may say, too."""
    asked: Parser | None = None
    """The parser of the command that was asked for."""

    def parse_known_args(  # type: ignore[override]  # (argparse has two overloads of the same meaning)
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse after shielding the values of greedy options with a blank, as colcon's users do."""
        shielded = self._shielded(args or ())
        if self.verb is None:
            try:
                return self._gathered(*super().parse_known_args(shielded, namespace))
            except UnicodeDecodeError:
                self.error("the file of words behind '@' is not UTF-8")
        actions = [action for action in self._actions if action.default is not argparse.SUPPRESS]
        namespace = argparse.Namespace(**dict.fromkeys((action.dest for action in actions), _NOT_GIVEN))
        options, rest = self._gathered(*super().parse_known_args(shielded, namespace))
        given = {dest: value for dest, value in vars(options).items() if value is not _NOT_GIVEN}
        said = configured(self.verb, self._actions, given, Path.cwd(), os.environ)
        # What may stand before the command, too, must not win over that.
        general = {dest: said.pop(dest) for dest in GENERAL if dest in said}
        defaults = {action.dest: self._default(action) for action in actions}
        values = {**defaults, **given, **said, "given": frozenset(given), "general": general}
        return argparse.Namespace(**values), rest

    def format_help(self) -> str:
        """Return the help; a usage that would have dozens of options only says that there are some."""
        stands = [action for action in self._actions if not action.option_strings or action.required]
        if self.usage is None and len(self._actions) - len(stands) > _MANY:
            formatter = self._get_formatter()
            formatter.add_usage(None, stands, [], prefix="")
            words = formatter.format_help().strip().removeprefix(self.prog)
            self.usage = f"{self.prog} [OPTION ...]{words}"
        return super().format_help()

    def _gathered(self, options: argparse.Namespace, rest: list[str]) -> tuple[argparse.Namespace, list[str]]:
        """Give names that stand after an option to the argument that takes any number of them.

        By itself argparse takes only those in front of the first option: 'clean packages -y P' has none.
        """
        takers = [action for action in self._actions if not action.option_strings and action.nargs == "*"]
        if not takers or not rest or any(word.startswith("-") for word in rest):
            return options, rest
        before = getattr(options, takers[-1].dest)
        setattr(options, takers[-1].dest, [*(before if isinstance(before, list) else ()), *rest])
        return options, []

    def _default(self, action: argparse.Action) -> object:
        """Return the value of an option that nobody gave; a text is converted as if typed."""
        default = action.default
        return self._get_value(action, default) if isinstance(default, str) else default

    def _shielded(self, arguments: Sequence[str]) -> list[str]:
        shielded: list[str] = []
        taking = False
        for argument in arguments:
            word = argument.split("=", 1)[0]
            if word in self._option_string_actions:
                taking = argument in self.greedy
            elif taking and argument.startswith("-"):
                argument = f" {argument}"  # noqa: PLW2901
            shielded.append(argument)
        return shielded

    def convert_arg_line_to_args(self, arg_line: str) -> list[str]:
        """Return the word on a line of an @FILE; one that names another such file might name itself."""
        if arg_line.startswith("@"):
            self.error(f"a file of words cannot name another: '{arg_line}'")
        return [arg_line]

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the command line, and what was meant or where help is."""
        from forge.mistyped import meant  # noqa: PLC0415  (most command lines are right)

        options = (self.asked or self)._option_string_actions  # noqa: SLF001  (argparse has no other list)
        message, hint = meant(message, COMMANDS, options)
        remedy = hint or f"'{self.prog} --help' lists what it takes"
        print(f"error: {message}\nhint: {remedy}", file=sys.stderr)
        raise SystemExit(EXIT_USER)


def parser_of(arguments: Sequence[str]) -> argparse.ArgumentParser:
    """Return a parser that knows every command, and the options of the one that is asked for."""
    # Abbreviations would be looked for in what `forge run` hands on, too: '--log' of a program is not ours.
    description = "Build ROS 2 workspaces and compile ROS 2 interfaces."
    parser = Parser(prog="forge", description=description, allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"forge {__version__}")
    parser.add_argument("-C", metavar="DIR", help="run as if typed in this folder")
    parser.add_argument("--log-base", metavar="DIR", help="where logs go; /dev/null for none (default: log)")
    parser.add_argument(
        "--log-level",
        metavar="LEVEL",
        help="how much forge says about itself: debug, info, warning, error, critical (default: warning)",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    asked = _asked(arguments)
    for word, summary in COMMANDS.items():
        command = commands.add_parser(word, help=summary, description=summary, fromfile_prefix_chars=None)
        if word == asked:
            # Only the asked command pays for its imports: `forge --help` answers at once.
            module = importlib.import_module(f"forge.commands.{word.replace('-', '_')}")
            module.register(command)
            command.set_defaults(run=module.run)
            parser.asked = command
            command.verb = word if word in _IN_WORKSPACE else None
    return parser


def _asked(arguments: Sequence[str]) -> str | None:
    """Return the first word that is neither a global option nor the value of one."""
    words = iter(arguments)
    for word in words:
        if not word.startswith("-"):
            return word
        if word in _VALUED:
            next(words, None)
    return None


def _folder(arguments: Sequence[str]) -> Path:
    """Return what -C says before the command; several lead from one to the next."""
    folder = Path()
    words = iter(arguments)
    for word in words:
        if not word.startswith("-"):
            break
        if word.startswith("-C"):
            folder /= word[2:] or next(words, "")
        elif word in _VALUED:
            next(words, None)
    return folder


def _refused(error: OSError) -> int:
    """Tell what the system refuses, unless it is a fault of ours."""
    problem = None if error.errno == errno.EBADF and is_writable(1) else refusal(error)
    if problem is None:
        return _our_bug()
    print(problem.render(), file=sys.stderr)
    return EXIT_USER


def _no_memory() -> int:
    hint = "is there a limit? 'ulimit -v' shows it; with fewer '--jobs' less is needed"
    print(Problem("there is not enough memory", hint=hint).render(), file=sys.stderr)
    return EXIT_USER


def _our_bug() -> int:
    """Print the traceback and where to report it."""
    import traceback  # noqa: PLC0415  (only a bug pays for it)

    traceback.print_exc()
    print(
        "this is a bug in forge, not in your workspace; please report it with the text above", file=sys.stderr
    )
    return EXIT_BUG
