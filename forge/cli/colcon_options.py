"""The options of colcon: only they end a list of arguments for another program, such as `--pytest-args`.

forge has more options than colcon, and other programs have options of the same names: in `forge test
--pytest-args --strict`, `--strict` is for pytest, as with colcon.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

PASSED_ON = frozenset(
    {"--ament-cmake-args", "--cargo-args", "--catkin-cmake-args", "--cmake-args", "--ctest-args"}
    | {"--pytest-args", "--unittest-args"}
)
"""Options that take all arguments up to the next option of colcon and pass them to another program."""

_COMMON = frozenset(
    """
    --base-paths --build-base --event-handlers --executor --help --ignore-user-meta --install-base
    --merge-install --metas --packages-above --packages-above-and-dependencies
    --packages-above-depth --packages-end --packages-ignore --packages-ignore-regex
    --packages-select --packages-select-build-failed --packages-select-by-dep
    --packages-select-regex --packages-select-test-failures --packages-skip
    --packages-skip-build-finished --packages-skip-by-dep --packages-skip-regex --packages-skip-test-passed
    --packages-skip-up-to --packages-start --packages-up-to --packages-up-to-regex --parallel-workers --paths
    --test-result-base -h
    """.split()
)
EXTRA_EXTENSIONS = frozenset({"--cargo-args", "--mixin", "--mixin-files"})
"""Options of colcon-cargo and colcon-mixin, which are not part of colcon-common-extensions."""

COLCON_OPTIONS = {
    "build": _COMMON.union(
        EXTRA_EXTENSIONS,
        """
        --ament-cmake-args --catkin-cmake-args --catkin-skip-building-tests --cmake-args --cmake-clean-cache
        --cmake-clean-first --cmake-force-configure --cmake-target --cmake-target-skip-unavailable
        --continue-on-error --symlink-install
        """.split(),
    ),
    "test": _COMMON.union(
        EXTRA_EXTENSIONS,
        """
        --abort-on-error --ctest-args --pytest-args --pytest-with-coverage --python-testing
        --retest-until-fail --retest-until-pass --return-code-on-test-failure --unittest-args
        """.split(),
    ),
}
"""The options of colcon for each command with options in PASSED_ON."""

NO_ABBREVIATIONS = frozenset({"--python"})
"""Options of forge that colcon would take for abbreviations of its own options."""


def classified(verb: str | None, arguments: Iterable[str]) -> Iterator[tuple[str, bool]]:
    """Yield each argument of a command, and whether it is passed on to another program.

    Abbreviations that colcon understands are completed: with forge's own options they may be ambiguous.
    """
    options = COLCON_OPTIONS.get(verb or "", frozenset())
    in_list = False
    for argument in arguments:
        name, equals, value = argument.partition("=")
        option = name if name in options else None
        if option is None and name[:2] == "--" and name not in NO_ABBREVIATIONS:
            matching = [each for each in options if each.startswith(name)]
            option = matching[0] if len(matching) == 1 else None
        if option:
            in_list = option in PASSED_ON and not equals
            yield f"{option}{equals}{value}", False
        else:
            yield argument, in_list
