"""The end of every help text: two examples and the page of the documentation that says more."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.layout import docs_url

if TYPE_CHECKING:
    from collections.abc import Mapping


@frozen
class Examples:
    """Two command lines, each with a comment, and a page below docs/."""

    first: tuple[str, str]
    second: tuple[str, str]
    page: str

    def render(self) -> str:
        """Return the text that follows the options."""
        shown = (f"  # {comment}\n  {command}\n" for command, comment in (self.first, self.second))
        return f"\nexamples:\n{''.join(shown)}\ndocumentation: {docs_url(self.page)}\n"


def examples(words: str) -> str:
    """Return the end of the help of a command such as 'pkg create', of forge itself for ''."""
    return EXAMPLES[words].render() if words in EXAMPLES else ""


_PAGE = "reference/commands.md"

EXAMPLES: Mapping[str, Examples] = {
    "": Examples(
        ("forge pkg create my_robot --node-name drive", "create a package with a program"),
        ("forge build", "build the workspace around the current folder"),
        "tutorial.md",
    ),
    "build": Examples(
        ("forge build --packages-up-to my_robot", "a package and its dependencies"),
        ("forge build --cmake-args -DCMAKE_BUILD_TYPE=Debug", "pass arguments to CMake"),
        f"{_PAGE}#forge-build",
    ),
    "test": Examples(
        ("forge test --packages-select my_robot", "the tests of one package"),
        ("forge test --packages-select-test-failures", "repeat the tests that failed"),
        "how-to/testing.md",
    ),
    "test-result": Examples(
        ("forge test-result --verbose", "with the message of each failed test"),
        ("forge test-result --json", "for scripts"),
        f"{_PAGE}#forge-test-result",
    ),
    "clean": Examples(
        ("forge clean packages my_robot", "build and install files of one package"),
        ("forge clean workspace -y", "everything that forge has written, without asking"),
        f"{_PAGE}#forge-clean",
    ),
    "completion": Examples(
        ('eval "$(forge completion bash)"', "add this line to ~/.bashrc"),
        ("forge completion fish > ~/.config/fish/completions/forge.fish", "for fish"),
        f"{_PAGE}#forge-completion",
    ),
    "list": Examples(
        ("forge list --topological-order", "in the order in which packages are built"),
        ("forge list --names-only --packages-above my_robot", "what depends on a package"),
        f"{_PAGE}#forge-list",
    ),
    "graph": Examples(
        ("forge graph --packages-up-to my_robot", "a package and its dependencies"),
        ("forge graph --html --output graph.html", "an interactive page"),
        "how-to/seeing-the-build.md",
    ),
    "info": Examples(
        ("forge info my_robot", "path, type and dependencies of a package"),
        ("forge info --json my_robot", "for scripts"),
        f"{_PAGE}#forge-info",
    ),
    "doctor": Examples(
        ("forge doctor", "problems only"),
        ("forge doctor --all", "also unused dependencies and hidden packages"),
        "how-to/when-it-does-not-build.md",
    ),
    "deps": Examples(
        ("forge deps", "missing dependencies, as commands that install them"),
        ("forge deps --install --rosdistro humble", "install them, ROS packages of Humble included"),
        "how-to/when-it-does-not-build.md#install-missing-dependencies",
    ),
    "extensions": Examples(
        ("forge extensions", "all that there are"),
        ("forge extensions | less", "one screen at a time"),
        f"{_PAGE}#forge-extensions",
    ),
    "lsp": Examples(
        ("forge lsp", "as an editor starts it"),
        ("forge lsp --rosdistro jazzy", "with the interfaces of Jazzy"),
        "how-to/vscode.md",
    ),
    "mixin": Examples(
        ("forge mixin show build", "all mixins of 'forge build' and their options"),
        ("forge mixin update", "fetch the mixins of all repositories"),
        "reference/configuration.md#mixins",
    ),
    "mixin add": Examples(
        ("forge mixin add team https://example.org/mixins/index.yaml", "from a server"),
        ("forge mixin add mine ~/mixins/index.yaml", "from a folder"),
        "reference/configuration.md#mixins",
    ),
    "mixin update": Examples(
        ("forge mixin update", "all repositories"),
        ("forge mixin update team", "one of them"),
        "reference/configuration.md#mixins",
    ),
    "mixin remove": Examples(
        ("forge mixin remove team", "its mixins can no longer be used"),
        ("forge mixin remove mine", "of a repository in a folder, that folder remains"),
        "reference/configuration.md#mixins",
    ),
    "mixin list": Examples(
        ("forge mixin list", "all repositories, files and mixins"),
        ("forge mixin list --mixin-files ci.mixin", "also those of a file"),
        "reference/configuration.md#mixins",
    ),
    "mixin show": Examples(
        ("forge mixin show build", "all mixins of 'forge build'"),
        ("forge mixin show build debug", "one of them"),
        "reference/configuration.md#mixins",
    ),
    "interface": Examples(
        ("forge interface show std_msgs/msg/Header", "print a definition"),
        ("forge interface package geometry_msgs", "list the types of a package"),
        f"{_PAGE}#forge-interface",
    ),
    "interface list": Examples(
        ("forge interface list", "all messages, services and actions"),
        ("forge interface list --only-srvs", "services only"),
        f"{_PAGE}#forge-interface",
    ),
    "interface package": Examples(
        ("forge interface package geometry_msgs", "all types of a package"),
        ("forge interface package std_srvs --only-srvs", "services only"),
        f"{_PAGE}#forge-interface",
    ),
    "interface packages": Examples(
        ("forge interface packages", "all packages with interfaces"),
        ("forge interface packages --only-actions", "those with actions"),
        f"{_PAGE}#forge-interface",
    ),
    "interface show": Examples(
        ("forge interface show geometry_msgs/msg/Pose", "with nested messages"),
        ("forge interface show --no-comments std_srvs/srv/SetBool", "fields and constants only"),
        f"{_PAGE}#forge-interface",
    ),
    "interface proto": Examples(
        ("forge interface proto geometry_msgs/msg/Pose", "default values, as one shell word"),
        ("forge interface proto --no-quotes std_msgs/msg/Header > header.yaml", "to edit in a file"),
        f"{_PAGE}#forge-interface",
    ),
    "interface generate": Examples(
        ("forge interface generate src/my_msgs --package my_msgs --output out", "Python and C++"),
        ("forge interface generate src/my_msgs --package my_msgs --output out --lang idl", "IDL"),
        "how-to/interfaces.md",
    ),
    "interface hash": Examples(
        ("forge interface hash std_msgs/msg/Header", "the hash of an installed type"),
        ("forge interface hash --package my_msgs src/my_msgs", "the hashes of definitions in a folder"),
        f"{_PAGE}#forge-interface",
    ),
    "interface schema": Examples(
        ("forge interface schema geometry_msgs/msg/Pose", "as .msg definitions"),
        ("forge interface schema --encoding ros2idl geometry_msgs/msg/Pose", "as IDL"),
        f"{_PAGE}#forge-interface",
    ),
    "interface docs": Examples(
        ("forge interface docs", "all interfaces of the workspace"),
        ("forge interface docs my_msgs --output site", "one package, into another folder"),
        "how-to/interface-docs.md",
    ),
    "pkg": Examples(
        ("forge pkg create my_robot --dependencies std_msgs", "create a package"),
        ("forge pkg prefix my_robot", "where a package is installed"),
        f"{_PAGE}#forge-pkg",
    ),
    "pkg create": Examples(
        ("forge pkg create my_robot --node-name drive", "C++, with a program"),
        ("forge pkg create my_msgs --interfaces Pose.msg GetMap.srv", "messages and services"),
        f"{_PAGE}#forge-pkg",
    ),
    "pkg list": Examples(
        ("forge pkg list", "all installed packages"),
        ("forge pkg list | grep robot", "some of them"),
        f"{_PAGE}#forge-pkg",
    ),
    "pkg executables": Examples(
        ("forge pkg executables my_robot", "what 'forge run' can start"),
        ("forge pkg executables --full-path my_robot", "with paths"),
        f"{_PAGE}#forge-pkg",
    ),
    "pkg prefix": Examples(
        ("forge pkg prefix my_robot", "the install prefix"),
        ("forge pkg prefix --share my_robot", "the folder of launch files and other data"),
        f"{_PAGE}#forge-pkg",
    ),
    "pkg xml": Examples(
        ("forge pkg xml my_robot", "the whole manifest"),
        ("forge pkg xml my_robot --tag version", "one element"),
        f"{_PAGE}#forge-pkg",
    ),
    "run": Examples(
        ("forge run my_robot drive --speed 2", "pass an argument to the program"),
        ("forge run --prefix 'gdb --args' my_robot drive", "run it in a debugger"),
        f"{_PAGE}#forge-run",
    ),
    "env": Examples(
        ("forge env", "assignments that a shell can evaluate"),
        ("forge env --format dotenv > .env", "for editors and containers"),
        f"{_PAGE}#forge-env",
    ),
    "shell": Examples(
        ("forge shell", "a shell with the workspace sourced"),
        ("forge shell -- python3 drive.py", "one command"),
        f"{_PAGE}#forge-shell",
    ),
    "cache": Examples(
        ("forge cache stats", "size and hit rate"),
        ("forge cache prune --size 5G", "remove the least recently used entries"),
        "explanation/package-cache.md",
    ),
    "cache stats": Examples(
        ("forge cache stats", "of your own cache"),
        ("forge cache stats --cache /srv/forge-cache", "of another folder"),
        f"{_PAGE}#forge-cache",
    ),
    "cache prune": Examples(
        ("forge cache prune --size 5G", "keep at most 5 GiB"),
        ("forge cache prune --size 0", "remove everything"),
        f"{_PAGE}#forge-cache",
    ),
    "cache verify": Examples(
        ("forge cache verify", "your own cache"),
        ("forge cache verify --cache /srv/forge-cache", "another folder"),
        f"{_PAGE}#forge-cache",
    ),
    "bundle": Examples(
        ("forge bundle --output robot.tar.gz", "what a robot needs at run time"),
        ("forge bundle --with-build-files", "also what other workspaces build on"),
        "how-to/shipping.md",
    ),
    "help": Examples(
        ("forge help build", "the same as 'forge build --help'"),
        ("forge help pkg create", "of a command with verbs"),
        _PAGE,
    ),
}
"""By the words of a command, as in `forge pkg create`."""
