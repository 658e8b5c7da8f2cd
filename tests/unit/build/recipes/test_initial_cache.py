"""The initial cache that forge passes to CMake."""

from __future__ import annotations

from pathlib import Path

from forge import __version__
from forge.base.layout import Layout
from forge.build.recipes.context import BuildContext
from forge.build.recipes.initial_cache import initial_cache, manifest_variables
from forge.workspace.model import Dependency, DependencyKind, Export, Manifest, Person

CONTEXT = BuildContext(
    root=Path("/ws"),
    layout=Layout(Path("/ws/build"), Path("/ws/install"), None),
    python=Path("/opt/my python/bin/python3"),
    site_packages="lib/python3.11/site-packages",
    wheels=("/opt/my python/bin/python3", "-m", "forge.cli.install_wheel"),
    generator=("/opt/my python/bin/python3", "-m", "forge"),
)


def test_the_initial_cache_names_python_forge_and_the_manifest() -> None:
    text = initial_cache(CONTEXT, Path("/ws/build/p/.forge/manifest.cmake"))
    for line in (
        'set(Python3_EXECUTABLE "/opt/my python/bin/python3" CACHE FILEPATH',
        'set(PYTHON_INSTALL_DIR "lib/python3.11/site-packages" CACHE STRING',
        'set(FORGE_PYTHON_VERSION "3.11" CACHE STRING',
        'set(FORGE_COMMAND "/opt/my python/bin/python3;-m;forge" CACHE STRING',
        f'set(FORGE_VERSION "{__version__}" CACHE STRING',
        'set(FORGE_MANIFEST "/ws/build/p/.forge/manifest.cmake" CACHE FILEPATH',
    ):
        assert line in text


def test_a_manifest_becomes_its_variables() -> None:
    manifest = Manifest(
        name="demo",
        version="1.2.3",
        description="",
        build_type="ament_cmake",
        dependencies=(
            Dependency("a", frozenset({DependencyKind.BUILD, DependencyKind.EXEC}), (("gte", "1.0"),)),
            Dependency("b", frozenset({DependencyKind.TEST})),
        ),
        path=Path("package.xml"),
        maintainers=(Person("Some Body", "some@body.org"), Person("No Mail")),
        groups=("rosidl_interface_packages",),
        exports=(
            Export("deprecated", (), ""),
            Export("x", (("file", '${prefix}/"a"'),), "text; $more"),
        ),
    )
    text = manifest_variables(manifest)
    assert (
        text.splitlines()[0] == "# The package.xml of 'demo' as the variables that ament_package_xml() sets."
    )
    assert {
        'set(_AMENT_PACKAGE_NAME "demo")',
        'set(demo_VERSION "1.2.3")',
        'set(demo_MAINTAINER "Some Body <some@body.org>, No Mail")',
        'set(demo_DEPRECATED "TRUE")',
        'set(demo_BUILD_DEPENDS "a")',
        'set(demo_EXEC_DEPENDS "a")',
        'set(demo_TEST_DEPENDS "b")',
        'set(demo_GROUP_DEPENDS "")',
        'set(demo_MEMBER_OF_GROUPS "rosidl_interface_packages")',
        'set(demo_BUILD_DEPENDS_a_VERSION_GTE "1.0")',
        'set(demo_EXEC_DEPENDS_a_VERSION_GTE "1.0")',
        r'set(demo_EXPORT_TAGS "<deprecated/>" "<x file=\"&quot\;a&quot\;\">text\; \$more</x>")',
    } <= set(text.splitlines())
