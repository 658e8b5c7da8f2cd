"""forge env, shell and run: the environment of a workspace without sourcing it."""

import json
import os
import pty
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from forge.base.layout import INSTALL_STATE_FILE, Layout
from forge.environment.sourcing import sourced_environment, workspace_environment
from tests.conftest import Forge
from tests.installs import Made, dsv_package, make_install

ODD = "a 'b' \"c\" $d `e` ö"
SITE = "lib/python3.11/site-packages"
MARK = "share/ament_index/resource_index/packages/walker"
WALKER = Made(
    "walker",
    build_type="ament_python",
    files={
        "bin/go": "",
        f"{SITE}/walker.py": "",
        MARK: "",
        "lib/walker/say": '#!/bin/sh\necho "$PYTHONPATH"\n',
    },
)


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    made = make_install(tmp_path / ODD, [WALKER])
    (made.prefix("walker") / "lib/walker/say").chmod(0o755)
    return made


def test_env_prints_what_sourcing_sets(forge: Forge, layout: Layout) -> None:
    (layout.install.parent / "src").mkdir()
    ran = forge("env", "--format", "json", cwd=layout.install.parent / "src", env={"PYTHONPATH": "/mine"})
    assert (ran.code, ran.err) == (0, "")
    told = json.loads(ran.out)
    assert told.keys() == {"AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "PATH", "PYTHONPATH"}
    assert told["PYTHONPATH"] == f"{layout.prefix('walker')}/{SITE}:/mine"


@pytest.mark.parametrize("seen", [True, False])
def test_env_of_a_sourced_shell_reports_no_changes(layout: Layout, *, seen: bool) -> None:
    sourced = sourced_environment(layout.install, os.environ)
    ours, theirs = pty.openpty()
    with os.fdopen(ours), os.fdopen(theirs) as terminal:
        ran = subprocess.run(
            (sys.executable, "-m", "forge", "env"),
            cwd=layout.install.parent,
            env=sourced,
            stdout=terminal if seen else subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            check=True,
        )
    assert ran.stderr == ("note: this shell has sourced the workspace: nothing changes\n" if seen else "")


@pytest.mark.needs("dash")
def test_the_output_can_be_evaluated_by_sh(forge: Forge, layout: Layout) -> None:
    text = forge("env", cwd=layout.install.parent).out
    before = {"PATH": os.environ["PATH"]}
    done = subprocess.run(
        ["dash", "-c", 'eval "$1"; exec env -0', "dash", text],
        env=before,
        capture_output=True,
        text=True,
        check=True,
    )
    after = dict(item.split("=", 1) for item in done.stdout.split("\0") if item)
    after.pop("PWD")
    assert after == workspace_environment([layout.install], before)


def test_dotenv_contains_the_module_path(forge: Forge, layout: Layout) -> None:
    found = f"{layout.prefix('walker')}/{SITE}"
    ran = forge(
        "env", "--format", "dotenv", "PYTHONPATH", cwd=layout.install.parent, env={"PYTHONPATH": found}
    )
    escaped = re.sub(r'([\\"$`])', r"\\\1", found)
    assert ran.out == f'PYTHONPATH="{escaped}"\n'


def test_variables_that_a_hook_unsets_are_unset(forge: Forge, tmp_path: Path) -> None:
    hook = {"share/hooked/hook.sh": "unset TAKEN\n"}
    make_install(tmp_path, [dsv_package("hooked", "source;share/hooked/hook.sh", files=hook)])
    told = json.loads(forge("env", "--format", "json", cwd=tmp_path, env={"TAKEN": "yes"}).out)
    assert told["TAKEN"] is None
    assert forge("env", cwd=tmp_path, env={"TAKEN": "yes"}).out.endswith("\nunset TAKEN\n")


def test_errors_are_reported_once(forge: Forge, layout: Layout, tmp_path: Path) -> None:
    ran = forge("env", "PYTONPATH", "ZZZ", cwd=layout.install.parent)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == (
        "error: variable 'PYTONPATH' is not set after sourcing\nhint: did you mean 'PYTHONPATH'?\n"
        "error: variable 'ZZZ' is not set after sourcing\n"
    )
    for word in ("env", "shell"):
        # An interrupted first build leaves an install folder without packages.
        (tmp_path / "install").mkdir(exist_ok=True)
        (tmp_path / "install/.colcon_install_layout").write_text("isolated\n")
        ran = forge(word, cwd=tmp_path)
        hint = (
            "hint: run 'forge build' with the same '--profile', or choose another folder with "
            "'--install-base'\n"
        )
        assert (ran.code, ran.err) == (
            2,
            f"error: '{tmp_path}/install' contains no installed packages\n{hint}",
        )


def shell(layout: Layout, *words: str, **variables: str) -> subprocess.CompletedProcess[str]:
    env = {"PATH": os.environ["PATH"], "PYTHONPATH": str(Path(__file__).parents[2]), **variables}
    argv = [sys.executable, "-m", "forge", "shell", *words]
    cwd = layout.install.parent
    return subprocess.run(argv, env=env, cwd=cwd, input="", capture_output=True, text=True, check=False)


def test_forge_shell_needs_no_sourcing(layout: Layout) -> None:
    mine = layout.install.parent / "mine"
    mine.write_text('#!/bin/sh\necho "$AMENT_PREFIX_PATH"\n')
    mine.chmod(0o755)
    assert shell(layout, SHELL=str(mine)).stdout == f"{layout.prefix('walker')}\n"
    done = shell(layout, "--", "sh", "-c", 'echo "$0 $PYTHONPATH"; exit 7', "--install-base")
    assert (done.returncode, done.stderr) == (7, "")
    assert done.stdout.startswith(f"--install-base {layout.prefix('walker')}/{SITE}:")


def test_forge_shell_uses_the_environment_of_the_workspace_unless_another_is_active(layout: Layout) -> None:
    python = layout.install.parent / ".venv/bin/python3"
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    (layout.install / INSTALL_STATE_FILE).write_text(json.dumps({"python": str(python), "underlays": []}))
    ask = ("--", "sh", "-c", 'command -v python3; echo "$VIRTUAL_ENV"')
    assert shell(layout, *ask).stdout == f"{python}\n{python.parents[1]}\n"
    assert shell(layout, *ask, VIRTUAL_ENV="/other").stdout.endswith("\n/other\n")
    assert str(python) not in shell(layout, *ask, CONDA_PREFIX="/other").stdout


PROMPTS = {
    "bash": (".bashrc", "PS1='mine> '\n"),
    "zsh": (".zshrc", "PROMPT='mine> '\n"),
    "fish": (".config/fish/config.fish", "function fish_prompt; echo -n 'mine> '; end\n"),
    "dash": (".profile", ""),
}


def typed(layout: Layout, home: Path, program: str, **variables: str) -> str:
    """Return what a terminal shows when `forge shell` starts this shell and 'exit' is typed at its prompt.

    Not before: zsh draws no prompt when input already waits for it.
    """
    ours, theirs = pty.openpty()
    env = {"PATH": os.environ["PATH"], "PYTHONPATH": str(Path(__file__).parents[2]), "HOME": str(home)}
    env |= {"SHELL": str(shutil.which(program)), "TERM": "dumb", "PS1": "mine> ", **variables}
    argv = ["setsid", "--ctty", "--wait", sys.executable, "-m", "forge", "shell"]
    cwd = layout.install.parent
    with subprocess.Popen(argv, cwd=cwd, env=env, stdin=theirs, stdout=theirs, stderr=theirs):
        os.close(theirs)
        shown = b""
        with suppress(OSError):  # the end of a terminal
            while chunk := os.read(ours, 4096):
                if b"> " not in shown and b"> " in shown + chunk:
                    os.write(ours, b"exit\n")
                shown += chunk
    os.close(ours)
    return shown.decode()


@pytest.mark.parametrize(
    "program", [pytest.param(program, marks=pytest.mark.needs(program)) for program in PROMPTS]
)
def test_the_shell_prompt_names_the_workspace(layout: Layout, tmp_path: Path, program: str) -> None:
    file, text = PROMPTS[program]
    (tmp_path / "home" / file).parent.mkdir(parents=True)
    (tmp_path / "home" / file).write_text(text)
    name = re.sub(r"[^\w.+-]", "_", layout.install.parent.name)
    assert f"({name}) mine> " in typed(layout, tmp_path / "home", program)
    if program == "bash":
        shown = typed(layout, tmp_path / "home", program, FORGE_DISABLE_PROMPT="1")
        assert "mine> " in shown
        assert f"({name})" not in shown


@pytest.mark.needs("zsh")
def test_zsh_reads_the_startup_files_of_the_user(layout: Layout, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home/.zshenv").write_text(f"ZDOTDIR={tmp_path}/other\n")
    (tmp_path / "other").mkdir()
    (tmp_path / "other/.zshrc").write_text('PROMPT="$ZDOTDIR> "\n')
    assert f") {tmp_path}/other> " in typed(layout, tmp_path / "home", "zsh")


def test_a_missing_command_is_reported(layout: Layout) -> None:
    done = shell(layout, "no-such-command")
    assert done.stderr == "error: cannot run 'no-such-command': no such file or directory\n"
    assert done.returncode == 2


def test_forge_run_needs_no_sourcing(forge: Forge, layout: Layout, tmp_path: Path) -> None:
    ran = forge("run", "walker", "say", cwd=layout.install.parent)
    assert (ran.code, ran.out) == (0, f"{layout.prefix('walker')}/{SITE}\n")
    other = make_install(tmp_path / "other", [WALKER])
    (other.prefix("walker") / "lib/walker/say").chmod(0o755)
    ran = forge(
        "run",
        "walker",
        "say",
        cwd=layout.install.parent,
        env={"AMENT_PREFIX_PATH": str(other.prefix("walker")), "PYTHONPATH": "other"},
    )
    assert ran.out == "other\n"


def test_underlays_are_sourced_by_their_scripts(tmp_path: Path) -> None:
    (tmp_path / "ros").mkdir()
    script = tmp_path / "ros/local_setup.sh"
    script.write_text('export SEEN="$COLCON_CURRENT_PREFIX"\n')
    below = make_install(tmp_path / "below", [WALKER])
    chain = (tmp_path / "gone", tmp_path / "ros", below.install)
    top = make_install(tmp_path / "top", [], underlays=chain)
    after = sourced_environment(top.install, {"PATH": "/bin"})
    assert after["SEEN"] == f"{tmp_path}/ros"
    assert after["COLCON_PREFIX_PATH"] == f"{top.install}:{below.install}"
