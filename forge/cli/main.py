"""Command line dispatch: parse arguments, run the command, map errors to exit codes.

Exit codes: 0 success, 1 a package failed, 2 a problem the user has to fix, 70 a bug in forge, 130
interrupted.
"""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Container, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from forge import __version__
from forge.base.errors import (
    EXIT_INTERRUPTED,
    ForgeError,
    Problem,
    print_problem,
    problem_from_oserror,
    share_hints,
)
from forge.base.extensions import COMMANDS as PLUGINS
from forge.base.extensions import OWN, SUGGESTIONS, call, find, first_answer, installed
from forge.base.layout import docs_url, templates_folder
from forge.base.signals import handle_signals, interrupt, is_writable
from forge.cli.colcon_options import classified
from forge.workspace.root import find_root, rebase_paths, working_directory

COMMANDS = {
    "build": "build the packages of a workspace",
    "test": "test the packages of a workspace",
    "test-result": "summarize test results",
    "clean": "remove build, install and log files",
    "completion": "print a shell completion script",
    "list": "list the packages of a workspace",
    "graph": "show the dependency graph of the packages",
    "info": "show details of packages",
    "init": "write settings for the workspace, its editor, CI and containers",
    "ignore": "ignore packages of the workspace, and list ignored packages",
    "doctor": "diagnose problems of the machine, the shell and the workspace",
    "fetch": "lock and download the ROS packages that the workspace needs",
    "add": "add dependencies to a package",
    "deps": "list missing system dependencies of the workspace, and install them",
    "extensions": "list supported build types, event handlers, executors and shells",
    "mixin": "list, show and fetch mixins (named sets of options)",
    "interface": "compile, list and show .msg, .srv and .action files",
    "lsp": "start the language server for interface definitions and package.xml",
    "pkg": "create packages and query installed ones",
    "run": "run an executable of an installed package",
    "env": "print the environment variables that sourcing the workspace sets",
    "shell": "start a shell or a command in the environment of the workspace",
    "cache": "inspect, prune and verify cached data shared by all workspaces",
    "bundle": "pack the install folder into an archive for deployment",
    "help": "print the help of a command",
}

_IN_WORKSPACE = frozenset(
    {"build", "test", "test-result", "list", "graph", "info", "clean", "env", "shell", "bundle"}
    | {"doctor", "deps", "fetch", "add", "ignore", "init"}
)
"""Commands that run at the root of the enclosing workspace."""

EXIT_USER = 2
EXIT_BUG = 70


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        with handle_signals(interrupt), working_directory(_split(arguments)[0]):
            code = _run(arguments)
        sys.stdout.flush()
    except ForgeError as error:
        for problem in share_hints(error.problems):
            print_problem(problem)
        return EXIT_USER
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of stdout closed the pipe, as `head` does: end without an error.
        _discard_output()
        return 0
    except OSError as error:
        has_no_stdout = error.errno == errno.EBADF and is_writable(1)
        problem_of_system = None if has_no_stdout else problem_from_oserror(error)
        if problem_of_system is None:
            return _report_bug()
        print_problem(problem_of_system)
        if not error.filename:
            _discard_output()
        return EXIT_USER
    except MemoryError:
        hint = "use fewer '--jobs', or raise the memory limit if there is one ('ulimit -v' shows it)"
        print_problem(Problem("not enough memory", hint=hint))
        return EXIT_USER
    except Exception:
        return _report_bug()
    return code


def _discard_output() -> None:
    """Discard buffered output: Python would fail to write it at exit, and return 120."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _report_bug() -> int:
    import traceback

    traceback.print_exc()
    print(
        "this is a bug in forge, not in your workspace; please report it with the text above", file=sys.stderr
    )
    return EXIT_BUG


def _split(arguments: Sequence[str]) -> tuple[Path, list[str]]:
    """Return the folder of -C (several are resolved in sequence), and the words from the command on."""
    folder, words = Path(), iter(arguments)
    for word in words:
        if not word.startswith("-"):
            return folder, [word, *words]
        if word.startswith("-C"):
            folder /= word[2:] or next(words, "")
        elif word in {"--log-base", "--log-level"}:
            next(words, None)
    return folder, []


def _run(arguments: Sequence[str]) -> int:
    """Run the command, at the root of the workspace if it is one of `_IN_WORKSPACE`."""
    origin = Path.cwd()
    command = next(iter(_split(arguments)[1]), None)
    root = find_root(origin, Path.home()) if command in _IN_WORKSPACE else origin
    if root != origin:
        arguments = rebase_paths(classified(command, arguments), origin, root)
    with working_directory(root):
        options = _options(arguments, os.path.relpath(origin, root))
        # `forge build --watch` parses its options again, because option files may change.
        options.read_again = partial(_options, arguments, options.origin)
        code: int = options.run(options)
    return code


def _options(arguments: Sequence[str], origin: str) -> argparse.Namespace:
    """Return the options of the command line and of option files; `origin` is the caller's folder."""
    options = parser_of(arguments).parse_args(arguments)
    options.origin = origin
    for dest, value in getattr(options, "general", {}).items():
        if getattr(options, dest) is None:
            setattr(options, dest, value)
    return options


_NOT_GIVEN = object()
_MANY = 7
"""The usage line lists optional arguments only up to this number."""


class _Formatter(argparse.HelpFormatter):
    """Determines the terminal width without shutil, which takes 3 ms to import."""

    def __init__(self, prog: str, **more: Any) -> None:
        try:
            columns = int(os.environ.get("COLUMNS", 0)) or os.get_terminal_size(1).columns
        except (OSError, ValueError):
            columns = 0
        super().__init__(prog, width=(columns or 80) - 2, **more)


class Parser(argparse.ArgumentParser):
    """An ArgumentParser with forge's error format, option files and lists of arguments for other programs."""

    verb: str | None = None
    """The command whose options may also be set in option files, None if they may not."""
    words: Sequence[str] = ()
    """The arguments after the command."""

    def __init__(self, **more: Any) -> None:
        super().__init__(formatter_class=_Formatter, **more)

    def parse_known_args(  # type: ignore[override]  # (argparse has two overloads of the same meaning)
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse the arguments, and combine them with option files.

        Options of other programs are prefixed with a space, to hide them from argparse.
        """
        classes = classified(self.verb, args or ())
        words = [f" {word}" if passed and word.startswith("-") else word for word, passed in classes]
        actions = [action for action in self._actions if action.default is not argparse.SUPPRESS]
        if self.verb is not None:
            namespace = argparse.Namespace(**dict.fromkeys((action.dest for action in actions), _NOT_GIVEN))
        try:
            options, rest = super().parse_known_args(words, namespace)
        except UnicodeDecodeError:
            self.error("the argument file after '@' is not valid UTF-8")
        # argparse assigns only arguments before the first option: 'clean packages -y P' would lose P.
        lists = [action.dest for action in self._actions if not action.option_strings and action.nargs == "*"]
        if lists and rest and not any(word.startswith("-") for word in rest):
            before = getattr(options, lists[-1])
            setattr(options, lists[-1], [*(before if isinstance(before, list) else ()), *rest])
            rest = []
        if self.verb is not None:
            from forge.cli.config import GENERAL, configured, misspelt_tables

            for problem in misspelt_tables(Path.cwd(), COMMANDS):
                print_problem(problem, "warning")
            given = {dest: value for dest, value in vars(options).items() if value is not _NOT_GIVEN}
            from_files = configured(self.verb, self._actions, given, Path.cwd(), os.environ)
            # Values from files must not override global options given before the command.
            general = {dest: from_files.pop(dest) for dest in GENERAL if dest in from_files}
            # argparse converts defaults that are strings like values of the command line.
            defaults = {
                action.dest: self._get_value(action, action.default)
                if isinstance(action.default, str)
                else action.default
                for action in actions
            }
            values = {**defaults, **given, **from_files, "given": frozenset(given), "general": general}
            values["flags"] = frozenset(self._option_string_actions)
            options = argparse.Namespace(**values)
        if rest and " " in self.prog:
            self.error(f"unrecognized arguments: {' '.join(rest)}")
        return options, rest

    def format_help(self) -> str:
        """Return the help with examples at the end; shorten the usage line of commands with many options."""
        positionals = [action for action in self._actions if not action.option_strings or action.required]
        if self.usage is None and len(self._actions) - len(positionals) > _MANY:
            formatter = self._get_formatter()
            formatter.add_usage(None, positionals, [], prefix="")
            words = formatter.format_help().strip().removeprefix(self.prog)
            self.usage = f"{self.prog} [OPTION ...]{words}"
        examples, page = help_endings().get(self.prog, ("", ""))
        end = f"\nexamples:\n{examples}\n\ndocumentation: {docs_url(page)}\n" if page else ""
        return super().format_help() + end

    def convert_arg_line_to_args(self, arg_line: str) -> list[str]:
        """Return the argument on one line of an @FILE; nested argument files are an error."""
        if arg_line.startswith("@"):
            self.error(f"argument files cannot be nested: '{arg_line}'")
        return [arg_line]

    def error(self, message: str) -> NoReturn:
        """Print the error with a suggestion or a pointer to --help, and exit with code 2."""
        options = frozenset(self._option_string_actions)
        hint = first_answer(SUGGESTIONS, "source of suggestions", "suggestion", message, COMMANDS, options)
        _, quoted, rest = message.partition("argument COMMAND: invalid choice: '")
        if quoted:
            message = "unknown command '{}'".format(rest.partition("'")[0])
        kind = "commands" if "command '" in message else "verbs" if message.endswith(" VERB") else "options"
        print_problem(Problem(message, hint=hint or f"'{self.prog} --help' lists all {kind}"))
        raise SystemExit(EXIT_USER)


def help_endings() -> dict[str, tuple[str, str]]:
    """Return two examples and the page below docs/ for each command, such as 'forge pkg create'."""
    text = (templates_folder() / "help/examples.txt").read_text(encoding="utf-8")
    entries = (entry.split("\n", 1) for entry in text.strip().split("\n\n"))
    return {head.partition(": ")[0]: (lines, head.partition(": ")[2]) for head, lines in entries}


def parser_of(arguments: Sequence[str]) -> argparse.ArgumentParser:
    """Return a parser for all commands, with the options of the requested command."""
    # argparse would also expand abbreviations among the arguments that `forge run` passes on.
    description = "Build ROS 2 workspaces and compile ROS 2 interfaces."
    parser = Parser(prog="forge", description=description, allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"forge {__version__}")
    parser.add_argument("-C", metavar="DIR", help="change to this folder first")
    parser.add_argument(
        "--log-base", metavar="DIR", help="log folder; /dev/null disables logs (default: log)"
    )
    parser.add_argument(
        "--log-level",
        metavar="LEVEL",
        help="verbosity of forge's own messages: debug, info, warning, error, critical (default: warning)",
    )

    def print_help(_: argparse.Namespace) -> int:
        parser.print_help()
        return 0

    parser.set_defaults(run=print_help)
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    requested = _split(arguments)[1]
    asked = next(iter(requested), None)
    for word, summary in COMMANDS.items():
        command = commands.add_parser(word, help=summary, description=summary, add_help=word == asked)
        if word == asked:
            # Import only the requested command, so that `forge --help` starts quickly.
            in_plugin = word in OWN[PLUGINS]
            path = f"forge.cli.commands.{word.replace('-', '_')}"
            module = find(PLUGINS, word, "command") if in_plugin else import_module(path)
            command.words = requested[1:]
            _add_own(command, module)
            command.verb = word if word in _IN_WORKSPACE else None
    if asked is not None and asked not in COMMANDS:
        add_plugin(commands, PLUGINS, asked, "command")
    return parser


def add_plugin(commands: Any, group: str, word: str, kind: str) -> None:
    """Add the command or verb `word` of a plugin, if there is one; its docstring begins with the summary."""
    module = find(group, word, kind, ("register", "run"))
    if module is None:
        return
    summary = (module.__doc__ or "").strip().partition("\n")[0]
    command = commands.add_parser(word, help=summary, description=summary)
    if word in OWN[group]:
        _add_own(command, module)
    else:
        call(f"the {kind} '{word}'", module.register, command)
        command.set_defaults(run=partial(call, f"the {kind} '{word}'", module.run))


def add_verbs_of_plugins(parser: Parser, verbs: Any, group: str, own: Container[str], *words: str) -> None:
    """Add verbs of plugins, by default all others, unless the command line contains one of the core's `own`.

    Builds wait for 'forge interface generate', so this imports no plugins.
    """
    asked = next((word for word in parser.words if not word.startswith("-")), None)
    if asked not in own:
        present = {*installed(group), *((asked,) if asked else ())} - verbs.choices.keys()
        for word in sorted(present.intersection(words) if words else present):
            add_plugin(verbs, group, word, "verb")


def _add_own(command: Parser, module: Any) -> None:
    """Add the options and the function of a command or verb of forge; each verb has its own function."""
    if hasattr(module, "Options"):
        from forge.cli.options import set_command

        set_command(command, module.Options, module.run)
    else:
        module.register(command)
        command.set_defaults(run=getattr(module, "run", None))
