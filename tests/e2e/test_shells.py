"""Real shells source what was written, and report the environment that was computed."""

import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forge.base.layout import Layout
from forge.environment.sourcing import (
    build_environment,
    packages_in_order,
    sourced_environment,
    workspace_environment,
)
from tests.installs import Made, dsv_package, make_install
from tests.strategies import graphs

SHELLS = {"sh": ("dash",), "bash": ("bash", "--norc"), "zsh": ("zsh", "-f"), "fish": ("fish", "--no-config")}
ODD = 'wörk space\'s "$HOME" `id` %n !x #y \\ *;&'
PLAIN = {"PATH": "/usr/bin:/bin", "HOME": "/", "LOGNAME": "someone"}
_SHELL_S_OWN = {"_", "SHLVL", "PWD", "OLDPWD", "USER"}  # fish says who we are

each_shell = pytest.mark.parametrize(
    "shell", [pytest.param(name, marks=pytest.mark.needs(argv[0])) for name, argv in SHELLS.items()]
)
each_posix_shell = pytest.mark.parametrize(
    "shell", [pytest.param(name, marks=pytest.mark.needs(SHELLS[name][0])) for name in ("sh", "bash", "zsh")]
)
each_layout = pytest.mark.parametrize("layout_word", ["isolated", "merged"])

SITE = "lib/python3.11/site-packages"
LIBRARY = Made("library", files={"lib/liblibrary.so": "", "share/library/cmake/libraryConfig.cmake": ""})
PROGRAMS = Made("programs", ("library",), "ament_python", {"bin/go": "", f"{SITE}/programs/__init__.py": ""})


def report(
    shell: str, body: str, variables: Mapping[str, str], *arguments: str, cwd: Path | None = None
) -> dict[str, str]:
    """Return the environment after `body`, which must say nothing and leave status 0."""
    done = run(shell, f"{body}\nexec /usr/bin/env -0", variables, *arguments, cwd=cwd)
    assert (done.returncode, done.stderr) == (0, "")
    pairs = (item.partition("=") for item in done.stdout.split("\0") if item)
    return {name: value for name, _, value in pairs if name not in _SHELL_S_OWN}


def run(
    shell: str, body: str, variables: Mapping[str, str], *arguments: str, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run `body` in a shell that read none of its user's files; $1 and on are the arguments."""
    name = () if shell == "fish" else (shell,)
    argv = [*SHELLS[shell], "-c", body, *name, *arguments]
    return subprocess.run(argv, env=dict(variables), cwd=cwd, capture_output=True, text=True, check=False)


def sourced(shell: str, *, times: int = 1) -> str:
    """Return a body that sources its first argument, strictly where a shell can be strict."""
    return "\n".join(['source "$argv[1]"'] * times if shell == "fish" else ["set -eu", *['. "$1"'] * times])


def setup(layout: Layout, shell: str) -> str:
    """Return the path of the script that a user sources."""
    return str(layout.install / f"setup.{shell}")


# --- laws

_TEXT = st.text("ab /.-$`\"'\\!*", max_size=6)
_ENTRY = st.one_of(
    st.sampled_from(["", "lib", "bin", "a/b", "/opt/x"]), _TEXT.filter(lambda text: ".." not in text)
)
_VARIABLES = st.sampled_from(["ONE", "TWO", "LD_LIBRARY_PATH"])
_LISTS = st.sampled_from(["prepend-non-duplicate", "prepend-non-duplicate-if-exists", "append-non-duplicate"])
_LINES = st.one_of(
    st.builds("{};{};{}".format, _LISTS, _VARIABLES, st.lists(_ENTRY, min_size=1, max_size=2).map(";".join)),
    st.builds("{};{};{}".format, st.sampled_from(["set", "set-if-unset"]), _VARIABLES, _ENTRY),
)
_HOOK = (
    'ament_prepend_unique_value ONE "$AMENT_CURRENT_PREFIX/hook"\nexport TWO="$TWO-$COLCON_CURRENT_PREFIX"\n'
)


@st.composite
def workspaces(draw: st.DrawFn) -> list[Made]:
    """Draw packages that need each other and do all that packages do to an environment."""
    made = []
    for name, needs in draw(graphs()).items():
        files = dict.fromkeys(draw(st.sets(st.sampled_from(["bin/x", "lib/x.so", f"{SITE}/{name}.py"]))), "")
        lines = draw(st.lists(_LINES, max_size=3))
        if draw(st.integers(0, 5)) == 0:
            lines.append(f"source;share/{name}/hook.sh")
            files[f"share/{name}/hook.sh"] = _HOOK
        made.append(dsv_package(name, *lines, needs=tuple(sorted(needs)), files=files))
    return made


_HELD = st.dictionaries(_VARIABLES, st.sampled_from(["", "/a", "/a:/b", ":/a", "/a:", "x::y"]))


@each_layout
@each_shell
@given(below=workspaces(), made=workspaces(), held=_HELD)
@settings(max_examples=10, deadline=None)
def test_sourcing_gives_the_computed_environment(
    shell: str,
    layout_word: str,
    below: list[Made],
    made: list[Made],
    held: dict[str, str],
) -> None:
    """Sourcing is computing: the same variables, the same entries, the same order; underlays included."""
    with tempfile.TemporaryDirectory() as folder:
        merged = layout_word == "merged"
        underlay = make_install(Path(folder) / "below" / ODD, below, merged=not merged).install
        layout = make_install(Path(folder) / ODD, made, merged=merged, underlays=(underlay,))
        before = {**PLAIN, **held}
        expected = workspace_environment([underlay, layout.install], before)
        assert expected == sourced_environment(layout.install, before)
        assert report(shell, sourced(shell), before, setup(layout, shell)) == expected


@each_shell
@given(made=workspaces(), held=_HELD)
@settings(max_examples=10, deadline=None)
def test_package_scripts_match_the_build_environment(
    shell: str, made: list[Made], held: dict[str, str]
) -> None:
    """The package scripts and the environment of a build agree."""
    with tempfile.TemporaryDirectory() as folder:
        layout = make_install(Path(folder) / ODD, made)
        before = {**PLAIN, **held}
        packages = [
            (package.name, layout.prefix(package.name)) for package in packages_in_order(layout.install)
        ]
        scripts = [str(prefix / f"share/{name}/package.{shell}") for name, prefix in packages]
        body = 'set -eu; for script do . "$script"; done'
        if shell == "fish":
            body = "for script in $argv; source $script; end"
        assert _sets_apart(report(shell, body, before, *scripts)) == _sets_apart(
            build_environment(packages, before)
        )


def _sets_apart(variables: dict[str, str]) -> dict[str, str]:
    return {name: value for name, value in variables.items() if name != "script"}


# --- cases


@each_layout
@each_shell
def test_sourcing_again_adds_new_packages(shell: str, layout_word: str, tmp_path: Path) -> None:
    """A terminal goes on with what it has; new packages come in front of all, others stay where they are."""
    merged = layout_word == "merged"
    layout = make_install(tmp_path, [LIBRARY, PROGRAMS], merged=merged)
    before = report(shell, sourced(shell), PLAIN, setup(layout, shell))
    between = Made("middle", ("library",), "ament_python", {"bin/walk": "", f"{SITE}/middle.py": ""})
    make_install(tmp_path, [LIBRARY, between, PROGRAMS], merged=merged)
    after = report(shell, sourced(shell), before, setup(layout, shell))
    assert after == workspace_environment([layout.install], before)
    if not merged:
        assert after["PATH"] == f"{layout.install}/middle/bin:{before['PATH']}"


@each_shell
@pytest.mark.parametrize(("cwd", "path"), [(".", "./install/setup"), ("install", "./setup"), ("/", None)])
def test_scripts_work_from_any_working_folder(shell: str, cwd: str, path: str | None, tmp_path: Path) -> None:
    """Relative paths, another folder, and a CDPATH that leads astray."""
    layout = make_install(tmp_path, [LIBRARY, PROGRAMS])
    (tmp_path / "astray" / "install").mkdir(parents=True)
    variables = PLAIN | {"CDPATH": str(tmp_path / "astray")}
    expected = report(shell, sourced(shell), variables, setup(layout, shell))
    argument = f"{path}.{shell}" if path else setup(layout, shell)
    assert report(shell, sourced(shell), variables, argument, cwd=tmp_path / cwd) == expected


@each_layout
@each_shell
def test_scripts_leave_no_variables_or_functions(shell: str, layout_word: str, tmp_path: Path) -> None:
    """No variable and no function of ours outlives the script, hooks and underlays included."""
    hook = {"share/hooked/hook.sh": "export HOOKED=yes\n"}
    hooked = dsv_package("hooked", "append-non-duplicate;LAST;x", "source;share/hooked/hook.sh", files=hook)
    below = make_install(tmp_path / "below", [LIBRARY])
    layout = make_install(
        tmp_path / "above", [hooked], merged=layout_word == "merged", underlays=(below.install,)
    )
    names = {
        "sh": "set | sed -n 's/^\\([A-Za-z_0-9]*\\)=.*/\\1/p'",
        "bash": "compgen -v; compgen -A function",
        "zsh": "print -l ${(k)parameters} ${(k)functions}",
        "fish": "set -n; functions -n -a | string split ,",
    }
    look = names[shell]
    body = f'before=$({look}); after=; . "$1"; after=$({look}); printf "%s--\\n%s" "$before" "$after"'
    if shell == "fish":
        body = f'{look}; source "$argv[1]"; echo --; {look}'
    done = run(shell, body, PLAIN, setup(layout, shell))
    before, _, after = done.stdout.partition("--\n")
    assert {name for name in set(after.split()) - set(before.split()) if "forge" in name or "_" in name} - {
        "AMENT_PREFIX_PATH",
        "BASH_SOURCE",
        "CMAKE_PREFIX_PATH",
        "COLCON_PREFIX_PATH",
        "LD_LIBRARY_PATH",
    } == set()


@each_posix_shell
def test_the_documented_function_stays_defined(shell: str, tmp_path: Path) -> None:
    """Hooks of colcon's packages call it."""
    layout = make_install(tmp_path, [LIBRARY])
    script = str(layout.prefix("library") / f"share/library/package.{shell}")
    body = 'set -eu; . "$1"; _colcon_prepend_unique_value X b; _colcon_prepend_unique_value X a; export X; '
    after = report(shell, body + "_colcon_prepend_unique_value X b", PLAIN, script)
    assert after["X"] == "b:a"


@each_posix_shell
def test_strict_shell_options_are_kept(shell: str, tmp_path: Path) -> None:
    """A hook that 'set -eu' would stop does not stop it, and the options are as before."""
    hook = {"share/sloppy/hook.sh": 'false\nexport SEEN="$NOBODY_SET_THIS+"\n'}
    layout = make_install(tmp_path, [dsv_package("sloppy", "source;share/sloppy/hook.sh", files=hook)])
    pipefail = "" if shell == "sh" else "-o pipefail"
    body = f'set -eu {pipefail}; . "$1"; case $- in *e*u*|*u*e*) export STRICT=yes ;; esac'
    after = report(shell, body, PLAIN, setup(layout, shell))
    assert (after["SEEN"], after["STRICT"]) == ("+", "yes")


@each_shell
def test_a_moved_install_tree_works(shell: str, tmp_path: Path) -> None:
    """Scripts for bash and zsh see where they are; sh is told."""
    layout = make_install(tmp_path / "old", [LIBRARY, PROGRAMS])
    shutil.move(layout.install, tmp_path / "new place")
    moved = tmp_path / "new place"
    telling = PLAIN | ({"COLCON_CURRENT_PREFIX": str(moved)} if shell == "sh" else {})
    after = report(shell, sourced(shell), telling, str(moved / f"setup.{shell}"))
    assert after == workspace_environment([moved], PLAIN)


@pytest.mark.needs("dash")
def test_sh_reports_a_moved_install_tree(tmp_path: Path) -> None:
    """Without a hint sh cannot know; it changes nothing and says what would help."""
    layout = make_install(tmp_path / "old", [LIBRARY])
    shutil.move(layout.install, tmp_path / "new")
    done = run(
        "sh", '. "$1"; echo $?; echo "${CMAKE_PREFIX_PATH-none}"', PLAIN, str(tmp_path / "new/setup.sh")
    )
    assert done.stdout == "1\nnone\n"
    assert done.stderr == (f"'{layout.install}' does not exist; set COLCON_CURRENT_PREFIX to its new path\n")


@each_layout
@each_shell
def test_removed_packages_are_left_out(shell: str, layout_word: str, tmp_path: Path) -> None:
    """A folder that was deleted by hand breaks nothing, and what it set is not set."""
    hook = {"share/gone/hook.sh": "export HOOKED=yes\n"}
    gone = dsv_package(
        "gone", "set;GONE;yes", "prepend-non-duplicate;X;x", "source;share/gone/hook.sh", files=hook
    )
    layout = make_install(tmp_path, [LIBRARY, gone, PROGRAMS], merged=layout_word == "merged")
    for path in (
        layout.prefix("gone") / "share/gone",
        layout.prefix("gone") / "share/colcon-core/packages/gone",
    ):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    done = run(shell, f"{sourced(shell)}\nexec /usr/bin/env", PLAIN, setup(layout, shell))
    assert done.returncode == 0
    assert "GONE=" not in done.stdout
    assert "HOOKED=" not in done.stdout
    assert "LD_LIBRARY_PATH=" in done.stdout
    assert done.stderr.startswith("warning: ")


@each_shell
def test_underlays_are_sourced_first_and_have_lower_precedence(shell: str, tmp_path: Path) -> None:
    """The chain is sourced lowest first, so that the overlay's entries stand before the others."""
    lowest = make_install(tmp_path / "lowest", [Made("base", files=LIBRARY.files)], merged=True)
    middle = make_install(tmp_path / "middle", [LIBRARY], underlays=(lowest.install,))
    chain = (lowest.install, middle.install)
    layout = make_install(tmp_path / "top", [PROGRAMS], underlays=chain)
    after = report(shell, sourced(shell), PLAIN, setup(layout, shell))
    assert after == workspace_environment([*chain, layout.install], PLAIN)
    assert after["COLCON_PREFIX_PATH"] == ":".join(map(str, [layout.install, middle.install, lowest.install]))
    assert after["CMAKE_PREFIX_PATH"] == f"{middle.install}/library:{lowest.install}"


@each_shell
def test_a_foreign_underlay_is_sourced_by_its_own_script(shell: str, tmp_path: Path) -> None:
    """A prefix with nothing but a sh script, which reads unset variables, and its own place."""
    (tmp_path / "ros").mkdir()
    (tmp_path / "ros/local_setup.sh").write_text(
        'export SEEN="$NOBODY:$COLCON_CURRENT_PREFIX"\n', encoding="utf-8"
    )
    layout = make_install(tmp_path / "top", [LIBRARY], underlays=(tmp_path / "ros",))
    assert report(shell, sourced(shell), PLAIN, setup(layout, shell))["SEEN"] == f":{tmp_path}/ros"


@each_shell
def test_a_missing_underlay_is_reported_in_one_line(shell: str, tmp_path: Path) -> None:
    """What is left of the workspace works, and the line says what is not there."""
    below = make_install(tmp_path / "below", [LIBRARY])
    layout = make_install(tmp_path / "top", [PROGRAMS], underlays=(below.install,))
    shutil.rmtree(below.install)
    done = run(shell, f'{sourced(shell)}\necho "$PATH"', PLAIN, setup(layout, shell))
    assert done.returncode == 0
    assert done.stdout.startswith(str(layout.prefix("programs") / "bin"))
    path = below.install / f"local_setup.{shell}"
    assert done.stderr == f"warning: '{path}' does not exist and is skipped\n"


@pytest.mark.needs("fish")
def test_fish_imports_the_effects_of_sh_hooks(tmp_path: Path) -> None:
    """Also variables that go away, odd values, and functions that ament and colcon promise to hooks."""
    hook = (
        "export ODD='a b'\\''\"$HOME\" `x` \\ ö\nsecond line'\nunset TAKEN\necho talk\n"
        'ament_append_unique_value ONE_PATH "/b c"\n_colcon_prepend_unique_value ONE_PATH /a\n'
    )
    hooked = dsv_package("hooked", "source;share/hooked/hook.sh", files={"share/hooked/hook.sh": hook})
    layout = make_install(tmp_path, [hooked])
    before = PLAIN | {"TAKEN": "yes", "ONE_PATH": "/a:/z"}
    done = run("fish", f"{sourced('fish')}\nexec /usr/bin/env -0", before, setup(layout, "fish"))
    after = dict(item.split("=", 1) for item in done.stdout.split("\0") if item)
    assert done.stderr == "talk\n"
    assert after["ODD"] == 'a b\'"$HOME" `x` \\ ö\nsecond line'
    assert (after["ONE_PATH"], "TAKEN" in after) == ("/a:/z:/b c", False)


@pytest.mark.needs("fish")
def test_fish_survives_hooks_that_exit(tmp_path: Path) -> None:
    """It says so, and goes on with the rest."""
    rude = dsv_package("rude", "source;share/rude/hook.sh", files={"share/rude/hook.sh": "exit 3\n"})
    layout = make_install(tmp_path, [rude, PROGRAMS])
    done = run("fish", f"{sourced('fish')}\necho $PATH[1]", PLAIN, setup(layout, "fish"))
    assert done.stdout == f"{layout.prefix('programs')}/bin\n"
    script = f"{layout.prefix('rude')}/share/rude/hook.sh"
    assert done.stderr == f"warning: '{script}' exits the shell and is skipped\n"


@each_shell
def test_shell_specific_hooks_take_precedence(shell: str, tmp_path: Path) -> None:
    """A hook that is there for bash too is sourced once, in bash's version by bash."""
    hooks = {f"share/multi/hook.{ext}": f"export SEEN=${{SEEN-}}{ext}\n" for ext in ("sh", "bash")}
    multi = dsv_package("multi", *(f"source;{path}" for path in hooks), files=hooks)
    layout = make_install(tmp_path, [multi])
    after = report(shell, sourced(shell), PLAIN, setup(layout, shell))
    assert after["SEEN"] == ("bash" if shell == "bash" else "sh")


@pytest.mark.parametrize(
    ("shell", "option"),
    [
        pytest.param(shell, option, marks=pytest.mark.needs(shell))
        for shell, options in {
            "bash": (
                "set -o posix",
                "set -f",
                "shopt -s extglob nullglob failglob",
                "IFS=/:",
                "cd() { false; }",
            ),
            "zsh": (
                "setopt ksh_arrays",
                "setopt no_function_argzero",
                "setopt sh_word_split glob_subst extended_glob null_glob",
                "setopt prompt_subst prompt_bang",
                "emulate sh",
                "emulate ksh",
                "IFS=/:",
            ),
        }.items()
        for option in options
    ],
)
def test_scripts_work_with_any_shell_options(shell: str, option: str, tmp_path: Path) -> None:
    """Whatever one has set for oneself, the environment is the same."""
    path = tmp_path / "here (it) is"
    hook = {"share/hooked/hook.sh": "export HOOKED=yes\n"}
    layout = make_install(path, [LIBRARY, PROGRAMS, dsv_package("hooked", *_MANY, files=hook)])
    expected = workspace_environment([layout.install], PLAIN)
    assert report(shell, f'{option}\n. "$1"; . "$1"', PLAIN, setup(layout, shell)) == expected


_MANY = (
    "append-non-duplicate;LAST;x;y",
    "set;ONE;a b",
    "set-if-unset;TWO;*",
    "source;share/hooked/hook.sh",
)


@each_shell
def test_tracing_prints_script_names(shell: str, tmp_path: Path) -> None:
    """COLCON_TRACE prints what is sourced, as comments."""
    layout = make_install(tmp_path, [LIBRARY])
    done = run(shell, sourced(shell), PLAIN | {"COLCON_TRACE": "1"}, setup(layout, shell))
    word = "source" if shell == "fish" else "."
    assert done.stdout == f'# {word} "{layout.install}/local_setup.{shell}"\n'
