"""What vendor packages download while they are built, and the libraries that they take instead."""

from pathlib import Path

import pytest

from forge.plugins.fetch.downloads import Download, announced, downloads
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from tests.packages import manifest_text
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
    assert list(downloads(text)) == [Download(URL, library, version)]


@pytest.mark.parametrize(
    "text",
    [
        "FetchContent_Declare(lib GIT_REPOSITORY https://example.invalid/lib.git GIT_TAG v1)",
        "ament_vendor(lib VCS_URL https://example.invalid/lib.git VCS_VERSION v1)",
        "ament_vendor(lib VCS_TYPE git VCS_URL https://example.invalid/lib.git VCS_VERSION v1)",
        "ExternalProject_Add(lib URL ${ADDRESS})",
        "# ExternalProject_Add(lib URL https://example.invalid/lib.tar.gz)",
    ],
)
def test_repositories_and_computed_urls_are_not_known_downloads(text: str) -> None:
    assert list(downloads(text)) == []


def test_the_announcement_names_the_library_and_its_rosdep_key(tmp_path: Path) -> None:
    path = tmp_path / "package.xml"
    text = manifest_text(
        "lib_vendor", *depends("liblib-dev", "other"), *depends("git", tag="buildtool_depend")
    )
    path.write_text(text)
    (tmp_path / "CMakeLists.txt").write_text(f"{FIND}if(NOT lib_FOUND)\n{ADD}\nendif()")
    package = Package(tmp_path, parse_manifest(text.encode(), path, {}))
    (problem,) = announced([package], ["git", "liblib-dev"])
    message = f"'lib_vendor' downloads {URL} while it is built, unless CMake finds 'lib' 1.0 or newer"
    assert (problem.message, problem.hint) == (message, "its rosdep key is 'liblib-dev'")
