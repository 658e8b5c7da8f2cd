import pytest

from forge.environment.hooks import package_hooks

SITE = "lib/python3.11/site-packages"


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        (["share/p/package.xml"], {}),
        (["share/p/cmake/pConfig.cmake"], {"cmake_prefix_path": "CMAKE_PREFIX_PATH;"}),
        (["lib/cmake/p/p-config.cmake"], {"cmake_prefix_path": "CMAKE_PREFIX_PATH;"}),
        (["share/p/cmake/FindX.cmake"], {"cmake_module_path": "CMAKE_MODULE_PATH;share/p/cmake"}),
        (["share/other/cmake/FindX.cmake"], {}),
        (
            ["lib/p/FindX.cmake", "share/cmake/p/FindY.cmake"],
            {
                "cmake_module_path": "CMAKE_MODULE_PATH;lib/p",
                "cmake_module_path1": "CMAKE_MODULE_PATH;share/cmake/p",
            },
        ),
        (
            ["lib/libp.so", "lib64/libp.so", "lib/p/plugin.so", "libexec/x", "share/libp.so"],
            {"ld_library_path_lib": "LD_LIBRARY_PATH;lib", "ld_library_path_lib64": "LD_LIBRARY_PATH;lib64"},
        ),
        (["bin/p"], {"path": "PATH;bin"}),
        (["bin/below/p"], {}),
        (
            ["lib/pkgconfig/p.pc", "lib/x86_64-linux-gnu/pkgconfig/p.pc"],
            {
                "pkg_config_path": "PKG_CONFIG_PATH;lib/pkgconfig",
                "pkg_config_path1": "PKG_CONFIG_PATH;lib/x86_64-linux-gnu/pkgconfig",
            },
        ),
        (["share/pkgconfig/README", "opt/pkgconfig/p.pc"], {}),
        ([f"{SITE}/p/__init__.py"], {"pythonpath": f"PYTHONPATH;{SITE}"}),
        (
            [f"{SITE}/p.py", "lib64/python3.11/site-packages/p.so"],
            {"pythonpath": f"PYTHONPATH;{SITE}", "pythonpath1": "PYTHONPATH;lib64/python3.11/site-packages"},
        ),
        (["lib/python3.9/site-packages/p.py"], {}),
    ],
)
def test_hooks_follow_from_installed_files(files: list[str], expected: dict[str, str]) -> None:
    hooks = package_hooks("p", files, SITE, ament=False)
    assert hooks == {name: f"prepend-non-duplicate;{line}" for name, line in expected.items()}


def test_ament_prefix_path_is_the_last_hook() -> None:
    hooks = package_hooks("p", [f"{SITE}/p.py", "bin/p"], SITE, ament=True)
    assert list(hooks) == ["path", "pythonpath", "ament_prefix_path"]
    assert hooks["ament_prefix_path"] == "prepend-non-duplicate;AMENT_PREFIX_PATH;"
