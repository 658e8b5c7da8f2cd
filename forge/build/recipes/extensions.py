"""Extensions of the recipes of CMake packages: more files, a launcher, processes that run during a build.

An extension is a module or another object with the fields of RecipeExtension, announced as an entry point of
the group 'forge.recipes'. forge's own extensions are always used, those of other distributions only if
`--recipes` names them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import cache
from typing import Any

from forge.base.errors import HostError, Problem
from forge.base.extensions import OWN, RECIPES, call, checked, find
from forge.base.frozen import Pairs, frozen
from forge.build.recipes.context import Addition, BuildContext
from forge.build.up_to_date import RECIPE
from forge.workspace.model import Package


@frozen
class RecipeExtension:
    """The interface of a recipe extension. Only `running` starts programs and writes files."""

    options: Callable[[Package, BuildContext], tuple[str, ...]]
    """Returns further inputs of a package, which is built again when one of them changes."""
    addition: Callable[[Package, BuildContext], Addition]
    """Returns the additions to the recipe of a package."""
    running: Callable[
        [Sequence[Package], BuildContext, Mapping[str, str], Pairs], AbstractContextManager[Mapping[str, str]]
    ]
    """Returns a context that is open while these packages are built; it yields variables for their steps.

    Variables whose names begin with FORGE_ are valid during this build only: printed commands and
    environment.sh leave them out. The mapping is the environment of the build, and the pairs are the inputs
    of every compilation. Not called for an audit, which observes each step.
    """


def active_extensions(context: BuildContext) -> Iterator[RecipeExtension]:
    """Yield the extensions of a build; raises ForgeError if one does not exist or cannot be loaded."""
    return map(_extension, context.recipes)


@cache
def _extension(name: str) -> RecipeExtension:
    module = find(RECIPES, name, "recipe", ("options", "addition", "running"))
    if module is None:
        hint = f"install it beside forge, source its workspace, or remove '{name}' from '--recipes'"
        raise HostError(Problem(f"no installed distribution provides the recipe '{name}'", hint=hint))
    if name in OWN[RECIPES]:
        return RecipeExtension(module.options, module.addition, module.running)
    return _checked(f"{RECIPE}'{name}'", module)


def _checked(what: str, module: Any) -> RecipeExtension:
    """Turn exceptions and wrong results of another distribution's extension into ForgeErrors."""
    from forge.build.inputs.fingerprints import code_digest

    options = checked(what, module.options, tuple)

    @contextmanager
    def running(*arguments: object) -> Iterator[Mapping[str, str]]:
        with ExitStack() as stack:
            yield call(what, lambda: stack.enter_context(module.running(*arguments)))

    return RecipeExtension(
        lambda *arguments: (*options(*arguments), f"{what} {code_digest(module)}"),
        checked(what, module.addition, Addition),
        running,
    )
