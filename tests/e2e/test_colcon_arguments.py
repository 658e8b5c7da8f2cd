"""Arguments for other programs, such as pytest, end where they end with colcon."""

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from forge.cli.colcon_options import COLCON_OPTIONS, EXTRA_EXTENSIONS, NO_ABBREVIATIONS, PASSED_ON
from forge.cli.main import parser_of

pytestmark = pytest.mark.needs("colcon")

PARSER = Path(__file__).parents[1] / "data" / "colcon_parser.py"
LISTS = {"build": ("cmake_args", "ament_cmake_args"), "test": ("ctest_args", "pytest_args", "unittest_args")}

WORDS = (
    *"""
    --log-level=DEBUG --log-level=VERBOSE --log-base=x --log-file=x --strict --json -j2 -j -k -x -v
    -vv -q -s -n4 -nauto -lf -rA -R -E -L -LE -V -VV --since=x --profile --profile=x --target=x
    --python=x --no-wait --cache --cache=x --timings --watch --force --explain --audit --jobs
    --jobs=4 --memory-limit=1G --coverage --rosdistro=x --dry-run --print-command=x --skip-keys
    --sysroot=x --packages-select-changed --packages-above-changed --no-fast-rosidl
    --compiler-launcher=x --co --cov=src --cov-report=term --collect-only --durations=3 --tb=short
    --lf --ff --maxfail=1 --basetemp=x --junit-xml=x --rootdir=x --ignore=x --deselect=x --pyargs
    --output-on-failure --output-junit --repeat --repeat-until-fail --rerun-failed --timeout=9
    --schedule-random --stop-on-failure --test-dir=x --build-config=x --parallel=3 --debug --fresh
    --trace --trace-expand --warn-uninitialized --graphviz=x --preset=x --toolchain=x -DX=1 -UX
    -Wno-dev -GNinja -G -1 -1.5 - a --config=--x -hx --packages --packages-select=a --packages-sel
    --symlink --event-handlers --merge-install --merge --return-code-on-test-failure --return-code
    --retest-until --python-test=pytest --abort-on-error --abort --continue-on-error --cont
    --test-result-base=x --test-res=x --build-base=x --install=x --exec=sequential --h --help -h --e
    --p --m --te=x --cmake-clean-cache --cmake-clean --cmake-target=x --ctest-args --pytest-with
    --catkin-skip --x=--packages-select
    """.split(),
    "-DX:STRING=a b",
    "--x --packages-select",
    "--packages-select=a b",
    "-- x",
    " --packages-select=a",
)
"""Words of all programs involved: of forge alone, of both tools, of neither, and abbreviations of them."""


DEFAULTS_DIFFER = {"metas", "executor", "parallel_workers"}


def colcon(lines: Sequence[Sequence[str]]) -> dict[str, object]:
    """Return the options of colcon's verbs, and the values of command lines."""
    script = Path(shutil.which("colcon") or "colcon")
    python = script.read_text(encoding="utf-8").splitlines()[0].removeprefix("#!").strip()
    done = subprocess.run(
        [python, str(PARSER)], input=json.dumps(lines), stdout=subprocess.PIPE, text=True, check=True
    )
    answer: dict[str, object] = json.loads(done.stdout)
    return answer


def test_the_table_lists_exactly_the_options_of_colcon() -> None:
    real = colcon([])["options"]
    assert isinstance(real, dict)
    assert {verb: set(words) | EXTRA_EXTENSIONS for verb, words in real.items()} == COLCON_OPTIONS


def test_forge_has_every_option_of_colcon() -> None:
    for verb, options in COLCON_OPTIONS.items():
        parser = parser_of([verb])
        commands = next(action for action in parser._actions if action.choices)
        assert isinstance(commands.choices, dict)
        own = frozenset(commands.choices[verb]._option_string_actions)
        assert options <= own
        lists = {word for word in own if word.endswith("-args")}
        assert lists == PASSED_ON & own
        shorter = {word for word in own - options if any(option.startswith(word) for option in options)}
        assert {word for word in shorter if word[:2] == "--"} <= NO_ABBREVIATIONS


def values(verb: str, argv: Sequence[str]) -> dict[str, object] | None:
    """Return what forge's parser gives to lists and to options that colcon has too; None if it refuses."""
    try:
        found = vars(parser_of(argv).parse_args(argv))
    except SystemExit:
        return None
    own = {option.lstrip("-").replace("-", "_") for option in COLCON_OPTIONS[verb]}
    return {name: value for name, value in found.items() if name in own}


def plain(value: object) -> object:
    """Return a value without the space that keeps argparse from reading it, and nothing for defaults."""
    if isinstance(value, list):
        return [word.lstrip() for word in value] or None
    return value or None


@pytest.mark.parametrize(("verb", "name"), [(verb, name) for verb, names in LISTS.items() for name in names])
def test_list_arguments_are_split_as_in_colcon(
    verb: str, name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A word with which colcon refuses the command line may be passed on."""
    monkeypatch.chdir(tmp_path)
    option = f"--{name.replace('_', '-')}"
    lines = [[verb, option, "first", word, "last"] for word in WORDS]
    theirs = colcon(lines)["parsed"]
    assert isinstance(theirs, list)
    differing = {}
    for argv, expected in zip(lines, theirs, strict=True):
        if expected is None:
            continue
        ours = values(verb, argv) or {}
        for key in ours.keys() & expected.keys():
            if key not in DEFAULTS_DIFFER and plain(ours[key]) != plain(expected[key]):
                differing[argv[3], key] = (ours[key], expected[key])
        if not ours:
            differing[argv[3], "refused"] = (None, None)
    assert differing == {}
    passed = [
        argv for argv, expected in zip(lines, theirs, strict=True) if expected and len(expected[name]) > 2
    ]
    assert len(passed) > 60


@pytest.mark.parametrize("name", ["cmake_args", "ament_cmake_args", "cargo_args", "catkin_cmake_args"])
def test_options_unknown_to_colcon_do_not_end_an_argument_list(name: str) -> None:
    option = f"--{name.replace('_', '-')}"
    words = ["--jobs", "4", "--log-level=VERBOSE", "--strict", "--", "--watch"]
    options = parser_of(["build"]).parse_args(["build", "--timings", option, *words, "--merge-install"])
    assert plain(getattr(options, name)) == words
    assert (options.timings, options.watch, options.merge_install) == ("page", False, True)


@pytest.mark.parametrize("name", ["pytest_args", "ctest_args", "unittest_args", "cargo_args"])
def test_abbreviated_options_resolve_as_in_colcon(name: str) -> None:
    option = f"--{name.replace('_', '-')}"
    options = parser_of(["test"]).parse_args(["test", option[:-2], "-x", "--return", "--exec", "sequential"])
    assert plain(getattr(options, name)) == ["-x"]
    assert (options.return_code_on_test_failure, options.executor) == (True, "sequential")
