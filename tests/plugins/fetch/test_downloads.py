"""What vendor packages download while they are built, and the libraries that they take instead."""

import os
from pathlib import Path

import pytest

from forge.plugins.fetch.downloads import announced, downloads
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from tests.packages import manifest_text, write_files
from tests.plugins.fetch.ros import depends

URL = "https://example.invalid/lib.tar.gz"
ADD = f"ExternalProject_Add(lib-1.0 URL {URL} URL_MD5 0)"
MACRO = f"macro(build_lib)\n{ADD}\nendmacro()\n"
FIND_ANY = "find_package(lib QUIET)\n"
FIND = "if(NOT FORCE_BUILD_VENDOR_PKG)\nfind_package(lib 1.0 QUIET)\nendif()\n"


@pytest.mark.parametrize(
    ("text", "library", "version"),
    [
        (f"{FIND}if(NOT lib_FOUND)\n{ADD}\nendif()", "lib", "1.0"),
        (f"{FIND}{MACRO}if(NOT lib_FOUND)\nbuild_lib()\nendif()", "lib", "1.0"),
        (
            f'{FIND}{MACRO}if(NOT lib_FOUND OR "${{lib_VERSION}}" VERSION_LESS 1.5)\nbuild_lib()\nendif()',
            "lib",
            "1.5",
        ),
        (
            f"{MACRO}{FIND_ANY}if(FORCE_BUILD_VENDOR_PKG OR NOT lib_FOUND)\nbuild_lib()\nendif()",
            "lib",
            "",
        ),
        (
            f"{FIND_ANY}ament_vendor(a SATISFIED ${{lib_FOUND}} VCS_TYPE zip VCS_URL {URL})",
            "lib",
            "",
        ),
        (
            f'set(WANTED "1.5")\n{FIND}{MACRO}'
            'if(NOT lib_FOUND OR "${lib_VERSION}" VERSION_LESS "${WANTED}")\nbuild_lib()\nendif()',
            "lib",
            "1.5",
        ),
        # The library is looked for, and does not prevent the download.
        (ADD, "", ""),
        (f"{FIND}{MACRO}build_lib()", "", ""),
        (f"{FIND}{MACRO}if(NOT lib_FOUND)\nbuild_lib()\nelseif(lib_FOUND)\nbuild_lib()\nendif()", "", ""),
        (f"{FIND}{MACRO}if(NOT lib_FOUND OR NOT SHARED)\nbuild_lib()\nendif()", "", ""),
        (f"{FIND}if(lib_FOUND)\n{ADD}\nendif()", "", ""),
        (f"if(NOT lib_FOUND)\n{ADD}\nendif()", "", ""),
        (f"find_package(lib REQUIRED)\nif(NOT lib_FOUND)\n{ADD}\nendif()", "", ""),
        (f"ament_vendor(a SATISFIED ${{OTHER}} VCS_TYPE tar VCS_URL {URL})", "", ""),
    ],
)
def test_a_system_library_is_used_if_every_download_path_checks_for_it(
    text: str, library: str, version: str
) -> None:
    (found,) = downloads(text)
    assert (found.url, found.library, found.oldest or found.requested) == (URL, library, version)


@pytest.mark.parametrize(
    "text",
    [
        "FetchContent_Declare(lib GIT_REPOSITORY https://example.invalid/lib.git GIT_TAG v1)",
        "ament_vendor(lib VCS_URL https://example.invalid/lib.git VCS_VERSION v1)",
        "ament_vendor(lib VCS_TYPE git VCS_URL https://example.invalid/lib.git VCS_VERSION v1)",
        "ExternalProject_Add(lib URL ${ADDRESS})",
        "# ExternalProject_Add(lib URL https://example.invalid/lib.tar.gz)",
        f"if(WIN32)\n{ADD}\nendif()",
        f"if(APPLE AND NOT lib_FOUND)\n{ADD}\nendif()",
        f"if(WIN32)\nset(LOCAL ON)\nelse()\nset(LOCAL OFF)\nendif()\nif(LOCAL)\n{ADD}\nendif()",
        f"{MACRO}set(LOCAL OFF)\nif(WIN32)\nbuild_lib()\nendif()\nif(LOCAL)\nbuild_lib()\nendif()",
    ],
)
def test_repositories_computed_urls_and_other_systems_are_not_reported_as_downloads(text: str) -> None:
    assert list(downloads(text)) == []


def test_urls_may_contain_variables_with_a_single_value() -> None:
    text = "set(V 1.2)\nset(NAME lib-${V})\nExternalProject_Add(lib URL https://example.invalid/${NAME}.zip)"
    assert [each.url for each in downloads(text)] == ["https://example.invalid/lib-1.2.zip"]


def vendor(folder: Path, *keys: str, cmake: str = f"{FIND}if(NOT lib_FOUND)\n{ADD}\nendif()") -> Package:
    """Write a package that downloads a library unless CMake finds it."""
    text = manifest_text("lib_vendor", *depends(*keys), *depends("git", tag="buildtool_depend"))
    path = write_files(folder, {"package.xml": text, "CMakeLists.txt": cmake})
    return Package(path, parse_manifest(text.encode(), path / "package.xml", {}))


@pytest.mark.parametrize(
    ("keys", "hint"),
    [
        (["liblib-dev"], "its rosdep key is 'liblib-dev'"),
        (["file", "liblib-dev"], "its rosdep key is one of 'file', 'liblib-dev'"),
    ],
)
def test_the_announcement_names_the_library_and_its_rosdep_key(
    keys: list[str], hint: str, tmp_path: Path
) -> None:
    package = vendor(tmp_path, "other", *keys)
    (problem,) = announced([package], ["git", *keys], {})
    message = f"'lib_vendor' downloads {URL} while it is built, unless CMake finds 'lib' 1.0 or newer"
    assert (problem.message, problem.hint) == (message, hint)


@pytest.mark.needs("cmake")
@pytest.mark.parametrize(("version", "announcements"), [("1.0", 0), ("0.9", 1)])
@pytest.mark.parametrize("kind", ["config", "module of the package"])
def test_an_installed_library_that_cmake_accepts_prevents_the_download(
    kind: str, version: str, announcements: int, tmp_path: Path
) -> None:
    package = vendor(tmp_path / "a vendor")
    if kind == "config":
        result = f'if("{version}" VERSION_LESS PACKAGE_FIND_VERSION)\nset(PACKAGE_VERSION_COMPATIBLE FALSE)\n'
        result += "else()\nset(PACKAGE_VERSION_COMPATIBLE TRUE)\nendif()\n"
        files = {
            "lib-config.cmake": "",
            "lib-config-version.cmake": f"set(PACKAGE_VERSION {version})\n{result}",
        }
        write_files(tmp_path / "lib", files)
    else:
        result = f"if(NOT {version} VERSION_LESS lib_FIND_VERSION)\nset(lib_FOUND TRUE)\nendif()\n"
        write_files(package.path, {"cmake/Findlib.cmake": result})
    variables = {"PATH": os.environ["PATH"], "lib_DIR": str(tmp_path / "lib")}
    assert len([*announced([package], [], variables)]) == announcements


@pytest.mark.needs("cmake")
@pytest.mark.parametrize(("version", "announcements"), [("5.1", 0), ("3.9", 1)])
def test_a_version_that_the_package_itself_checks_is_not_passed_to_find_package(
    version: str, announcements: int, tmp_path: Path
) -> None:
    condition = 'NOT lib_FOUND OR "${lib_VERSION}" VERSION_LESS 4.1'
    package = vendor(tmp_path / "vendor", cmake=f"{FIND_ANY}if({condition})\n{ADD}\nendif()")
    only_same = (
        "if(PACKAGE_FIND_VERSION VERSION_EQUAL PACKAGE_VERSION)\nset(PACKAGE_VERSION_COMPATIBLE 1)\nendif()"
    )
    files = {
        "lib-config.cmake": "",
        "lib-config-version.cmake": f"set(PACKAGE_VERSION {version})\n{only_same}\n",
    }
    variables = {"PATH": os.environ["PATH"], "lib_DIR": str(write_files(tmp_path / "lib", files))}
    assert len([*announced([package], [], variables)]) == announcements
