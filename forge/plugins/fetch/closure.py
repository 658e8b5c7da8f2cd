"""Computes the packages of a distribution that a workspace needs for building and running."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.plugins.fetch.index import Snapshot
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, DependencyKind, Manifest

MIDDLEWARES = {"cyclonedds": "rmw_cyclonedds_cpp", "fastrtps": "rmw_fastrtps_cpp", "zenoh": "rmw_zenoh_cpp"}
"""Values of `--rmw` besides names of packages."""

_MIDDLEWARE_GROUP = "rmw_implementation_packages"
_MIDDLEWARE_USER = "rmw_implementation"

_ICEORYX = ("iceoryx_binding_c", "iceoryx_hoofs", "iceoryx_posh")
_OPTIONAL = {
    "cyclonedds": _ICEORYX,
    "rmw_cyclonedds_cpp": _ICEORYX,
    "tracetools": ("liblttng-ust-dev", "lttng-tools"),
}
"""Optional dependencies: the shared memory transport of Cyclone DDS, and tracing, which underlays disable."""

_FOR_TESTS = {
    "ament_cmake_gmock": ("google-mock",),
    "ament_cmake_gtest": ("gtest",),
    "ament_cmake_pytest": ("python3-pytest",),
    "rosidl_generator_py": tuple(
        f"ament_cmake_{linter}" for linter in ("cppcheck", "cpplint", "flake8", "pep257", "uncrustify")
    ),
}
"""Dependencies that only tests of dependent packages use, which manifests cannot express."""


@frozen
class Needs:
    """The result of `resolve`: packages of the distribution, and dependencies on the system or Python.

    Both map a name to the packages that need it, including the workspace's own; sorted.
    """

    packages: Mapping[str, tuple[str, ...]]
    keys: Mapping[str, tuple[str, ...]]
    """Keys of rosdep."""


def middleware_package(name: str, snapshot: Snapshot) -> str:
    """Return the package of a middleware; raises SelectionError if the distribution lacks it."""
    package = MIDDLEWARES.get(name, name)
    available = middlewares(snapshot)
    if package not in available:
        short_names = [each for each, named in MIDDLEWARES.items() if named in available]
        hint = did_you_mean(name, [*short_names, *available]) or f"it has {', '.join(sorted(available))}"
        message = f"--rmw: ROS '{snapshot.distribution}' has no middleware '{name}'"
        raise SelectionError(Problem(message, hint=hint))
    return package


def middlewares(snapshot: Snapshot) -> frozenset[str]:
    return frozenset(
        name
        for name, release in snapshot.releases.items()
        if _MIDDLEWARE_GROUP in release.manifest and _MIDDLEWARE_GROUP in snapshot.manifest(name).groups
    )


def resolve(
    wanted: Mapping[str, tuple[str, ...]],
    snapshot: Snapshot,
    is_present: Callable[[str], bool],
    middleware: str,
    *,
    tests: bool = False,
) -> Needs:
    """Return the recursive dependencies of `wanted`, except those for which `is_present` is true.

    Only the dependencies of released packages are followed: unreleased names are keys of rosdep. Only the
    chosen middleware is included, and those that `wanted` names: `rmw_implementation` declares all of them,
    and uses at run time those that are installed. Other groups add nothing, because their members are those
    of the workspace (REP 149).
    """
    all_middlewares = middlewares(snapshot)
    unwanted = all_middlewares - {middleware} - wanted.keys()
    users: dict[str, set[str]] = {name: set(names) for name, names in wanted.items()}
    packages: set[str] = set()
    pending = list(wanted)
    while pending:
        name = pending.pop()
        if name in packages or name not in snapshot.releases or is_present(name):
            continue
        packages.add(name)
        manifest = snapshot.manifest(name)
        needed = {*needs_of(manifest, BUILD_KINDS | RUN_KINDS, all_middlewares, tests=tests)} - unwanted
        if name == _MIDDLEWARE_USER:
            needed.add(middleware)
        for other in needed:
            users.setdefault(other, set()).add(name)
            pending.append(other)
    keys = {name for name in users if name not in snapshot.releases and not is_present(name)}

    def sorted_users(names: Collection[str]) -> dict[str, tuple[str, ...]]:
        return {name: tuple(sorted(users[name])) for name in sorted(names)}

    return Needs(sorted_users(packages), sorted_users(keys))


def needs_of(
    manifest: Manifest, kinds: frozenset[DependencyKind], all_middlewares: frozenset[str], *, tests: bool
) -> frozenset[str]:
    """Return the dependencies of a package without the optional ones.

    With `tests`, they include those that only the tests of dependent packages use.
    """
    optional = all_middlewares if manifest.name == _MIDDLEWARE_USER else _OPTIONAL.get(manifest.name, ())
    for_tests = () if tests else _FOR_TESTS.get(manifest.name, ())
    return frozenset(manifest.names(kinds)).difference(optional, for_tests, {manifest.name})


def check_names(names: Collection[str], snapshot: Snapshot, others: Callable[[str], Collection[str]]) -> None:
    """Raise SelectionError for names that the distribution has not released.

    `others` returns the distributions that have.
    """
    problems = []
    for name in names:
        if name not in snapshot.releases:
            hint = did_you_mean(name, snapshot.releases, 0.75)
            if not hint and (distributions := others(name)):
                hint = f"it is in {', '.join(distributions)}; choose another distribution with '--rosdistro'"
            problems.append(Problem(f"ROS '{snapshot.distribution}' has no package '{name}'", hint=hint))
    raise_if_any(problems, SelectionError)
