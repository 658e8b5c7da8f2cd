"""Errors in toolchains of other distributions are reported as theirs."""

from pathlib import Path

import pytest

from forge.base.errors import ForgeError
from forge.base.layout import Layout
from forge.toolchain.targets import CrossBuild, CrossOptions, Target

LAYOUT = Layout(Path("/ws/build/board"), Path("/ws/install/board"), None, target="board")


class Broken:
    """A toolchain with wrong results and exceptions."""

    def __init__(self, result: object) -> None:
        self.result = result

    def prepare(self, *_: object) -> CrossBuild:
        return self.result  # type: ignore[return-value]  # (the mistake)

    def has_emulator(self, _: Layout) -> bool:
        raise OSError("no SDK")


def test_a_toolchain_that_returns_a_wrong_type_is_an_error() -> None:
    target = Target("board", "board", Broken(("-DX=1",)))
    with pytest.raises(ForgeError, match="the toolchain of 'board' returned tuple instead of a CrossBuild"):
        target.prepare(LAYOUT, {}, CrossOptions())


def test_exceptions_of_a_toolchain_are_reported_with_their_location() -> None:
    def prepare_compilers(_packages: object) -> list[None]:
        raise KeyError("packages")

    build = CrossBuild(prepare_compilers=prepare_compilers)  # type: ignore[arg-type]  # (the mistake)
    target = Target("board", "board", Broken(build))
    with pytest.raises(ForgeError, match="toolchain of 'board' failed: KeyError: 'packages'") as caught:
        target.prepare(LAYOUT, {}, CrossOptions()).prepare_compilers(())
    assert caught.value.problems[0].location is not None
    with pytest.raises(ForgeError, match="toolchain of 'board' failed: OSError: no SDK"):
        target.has_emulator(LAYOUT)
