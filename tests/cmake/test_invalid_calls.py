"""Calls of the embedded ament that cannot work stop CMake with a reason."""

import pytest

from .conftest import Ament

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]


@pytest.mark.parametrize(
    ("commands", "complaint"),
    [
        # ament_package() and exports
        ("ament_package()\nament_package()", "ament_package() was called before"),
        ("ament_package(EXTRAS a.cmake)", "does not accept 'EXTRAS' 'a.cmake'"),
        ("ament_package(CONFIG_EXTRAS none.cmake)", "none.cmake', which does not exist"),
        ("ament_package(CONFIG_EXTRAS package.xml)", "extras end in .cmake or .cmake.in"),
        ("ament_package_xml()\nament_package_xml()", "ament_package_xml() was called before"),
        ("ament_package()\nament_export_dependencies(x)", "must be called before ament_package()"),
        ("ament_package()\nament_export_libraries(x)", "must be called before ament_package()"),
        ("ament_package()\nament_export_targets(x)", "must be called before ament_package()"),
        ("ament_package()\nament_export_include_directories(x)", "must be called before ament_package()"),
        ("ament_package()\nament_export_definitions(x)", "must be called before ament_package()"),
        ("ament_package()\nament_export_link_flags(x)", "must be called before ament_package()"),
        ("ament_package()\nament_environment_hooks(package.xml)", "must be called before ament_package()"),
        ("ament_package()\nfind_package(ament_lint_auto)", "must be called before ament_package()"),
        # Exports
        ("ament_target_dependencies(none demo)", "'none', which is not a target"),
        ("ament_target_dependencies(t nowhere)", "uses the package 'nowhere', which was not found"),
        ("ament_target_dependencies(t ament_cmake PUBLIC)", "takes 'PUBLIC' only directly after the target"),
        ("ament_export_libraries(/no/such/lib.so)", "was given '/no/such/lib.so', which does not exist"),
        ("ament_export_interfaces(x UNKNOWN::y)\nament_package()", "UNKNOWN::y"),
        # Tests
        ("ament_add_test(one)", "needs the COMMAND of the test 'one'"),
        ("ament_add_test(one COMMAND x TIMEOUT 0)", "must be more than 0 seconds"),
        ("ament_add_test(one COMMAND_ x)", "does not accept 'COMMAND_' 'x'"),
        ("ament_add_pytest_test(one none.py)", "none.py', which does not exist"),
        ("find_package(ament_cmake_gtest)\nament_add_gtest(one)", "the test 'one' has no source files"),
        ("find_package(ament_cmake_catch2)\nament_add_catch2(one)", "the test 'one' has no source files"),
        # Python packages and version headers
        ("ament_python_install_package(none)", "contains no __init__.py"),
        ("ament_python_install_package(p)\nament_python_install_package(p)", "the Python package 'p' twice"),
        ("ament_python_install_module(none.py)", "none.py', which does not exist"),
        ("ament_generate_version_header(none)", "'none', which is not a target"),
        # Environment hooks
        ("ament_environment_hooks(none.sh)", "none.sh', which is not a file"),
        ("ament_environment_hooks(noextension)", "needs the extension of its shell"),
        # The ament index
        ("ament_index_register_resource(k CONTENT a CONTENT_FILE b)", "either CONTENT or CONTENT_FILE"),
        ("ament_index_register_resource(k CONTENT_FILE none)", "none', which does not exist"),
        ("ament_index_get_resource(x k none)", "no resource 'none' of the type 'k'"),
    ],
)
def test_invalid_calls_are_errors_with_a_reason(ament: Ament, commands: str, complaint: str) -> None:
    files = {"p/__init__.py": "", "noextension": ""}
    outcome = ament(f"add_library(t INTERFACE)\n{commands}", files=files).try_to_configure()
    assert outcome.code != 0
    assert complaint in outcome.flat
