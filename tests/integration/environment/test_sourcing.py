import itertools
import re
import subprocess
from pathlib import Path

import pytest

from forge.base.errors import HostError, WorkspaceError
from forge.environment.sourcing import build_environment
from tests.conftest import Tree
from tests.installs import dsv_package, make_install


@pytest.mark.needs("dash")
def test_hook_scripts_get_the_variables_of_ament_and_colcon(tmp_path: Path) -> None:
    hook = (
        "echo talk\n"
        'ament_prepend_unique_value PATHS "$AMENT_CURRENT_PREFIX/one"\n'
        'ament_append_unique_value PATHS "$COLCON_CURRENT_PREFIX/two"\n'
        'ament_append_unique_value PATHS "$COLCON_CURRENT_PREFIX/two"\n'
        "ament_append_value PATHS $FIRST\n"
        '_colcon_prepend_unique_value MULTI "a\nb"\n'
        "unset GOING\n"
    )
    lines = ("set;FIRST;1", "source;share/p/hook.sh")
    layout = make_install(tmp_path, [dsv_package("p", *lines, files={"share/p/hook.sh": hook, "bin/x": ""})])
    prefix = layout.prefix("p")
    given = {"PATH": "/bin", "PATHS": "/x", "GOING": "yes", "PWD": "/given"}
    assert build_environment([("p", prefix)], given) == {
        "PATH": f"{prefix}/bin:/bin",
        "PATHS": f"{prefix}/one:/x:{prefix}/two:1",
        "FIRST": "1",
        "MULTI": "a\nb",
        "PWD": "/given",
    }


def test_a_hook_that_exits_is_reported(tmp_path: Path) -> None:
    hook = {"share/p/hook.sh": "echo it does not suit me >&2\nexit 3\n", "share/q/hook.sh": "exit 3\n"}
    layout = make_install(tmp_path, [])
    for name, said in (("p", "it does not suit me"), ("q", "exit code 3")):
        path = f"share/{name}/hook.sh"
        prefix = layout.prefix(name)
        for file, text in ((path, hook[path]), (f"share/{name}/package.dsv", f"source;{path}\n")):
            (prefix / file).parent.mkdir(parents=True, exist_ok=True)
            (prefix / file).write_text(text)
        with pytest.raises(HostError) as caught:
            build_environment([(name, prefix)], {})
        assert str(caught.value) == f"error: the environment hook '{prefix}/{path}' failed: {said}"


@pytest.mark.parametrize(
    "shell", [pytest.param(name, marks=pytest.mark.needs(name)) for name in ("bash", "dash", "fish", "zsh")]
)
def test_scripts_for_other_shells_name_the_right_script(tmp_path: Path, shell: str) -> None:
    layout = make_install(tmp_path, [dsv_package("p", "prepend-non-duplicate;PATH;bin", files={"bin/x": ""})])
    for kind, name in itertools.product(("bash", "fish", "sh", "zsh"), ("setup", "local_setup", "package")):
        script = (layout.prefix("p") / "share/p" if name == "package" else layout.install) / f"{name}.{kind}"
        ran = subprocess.run(
            (shell, "-c", f". {script} && echo set $PATH"),
            cwd=tmp_path,
            env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        if kind == shell or (kind == "sh" and shell != "fish"):
            assert (ran.returncode, ran.stderr) == (0, "")
            assert ran.stdout.startswith(f"set {layout.prefix('p')}/bin")
        else:
            own = f"{name}.{'sh' if shell == 'dash' else shell}"
            assert (ran.returncode != 0, ran.stdout) == (True, "")
            assert re.search(rf"source .*\b{own}\b.* instead", ran.stderr)


def test_missing_scripts_and_those_of_other_shells_are_skipped(tree: Tree) -> None:
    root = tree({"share/p/package.dsv": "source;gone.sh\nsource;other.bash\n", "other.bash": "exit 1\n"})
    assert build_environment([("p", root)], {"A": "1"}) == {"A": "1"}


def test_an_invalid_dsv_file_is_reported_with_its_path(tree: Tree) -> None:
    root = tree({"share/p/package.dsv": "source;share/p/x.dsv\n", "share/p/x.dsv": "prepend;A\n"})
    with pytest.raises(WorkspaceError, match=r"share/p/x\.dsv:1: error: invalid environment hook"):
        build_environment([("p", root)], {})
