"""A small ROS distribution for tests: an index, its cache, and git repositories with release tags, on disk.

Packages are of type cmake and compile nothing. Repositories have addresses at `example.invalid`, which a
configuration of git replaces by folders, as a mirror does.
"""

import os
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from tests.packages import manifest_text, write_files

SERVER = "https://example.invalid/"
GROUP = "rmw_implementation_packages"
_AUTHOR = {
    f"GIT_{who}_{what}": "tests@example.com" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")
}

CMAKE = """\
cmake_minimum_required(VERSION 3.22)
project({name} LANGUAGES NONE)
{lines}
file(WRITE ${{CMAKE_CURRENT_BINARY_DIR}}/{name}Config.cmake "set({name}_VERSION {version})\\n")
install(FILES ${{CMAKE_CURRENT_BINARY_DIR}}/{name}Config.cmake DESTINATION share/{name}/cmake)
install(FILES package.xml DESTINATION share/{name})
"""


def depends(*names: str, tag: str = "depend") -> tuple[str, ...]:
    return tuple(f"<{tag}>{name}</{tag}>" for name in names)


@dataclass
class Ros:
    """A distribution below a folder; `release` adds packages, `publish` writes the index."""

    root: Path
    name: str = "humble"
    repositories: dict[str, dict[str, object]] = field(default_factory=dict)
    manifests: dict[str, str] = field(default_factory=dict)

    def release(
        self, name: str, *lines: str, version: str = "1.0.0", cmake: str = "", manifest: bool = True
    ) -> str:
        """Release a version of a package in a repository of its own; return the commit."""
        text = manifest_text(name, *lines, build_type="cmake").replace("0.1.0", version)
        files = {"package.xml": text, "CMakeLists.txt": CMAKE.format(name=name, version=version, lines=cmake)}
        commit = self.commit(f"{name}-release", files, f"release/{self.name}/{name}/{version}-1")
        self.repositories[name] = {
            "release": {
                "packages": [name],
                "tags": {"release": f"release/{self.name}/{{package}}/{{version}}"},
                "url": f"{SERVER}{name}-release.git",
                "version": f"{version}-1",
            }
        }
        if manifest:
            self.manifests[name] = text
        return commit

    def commit(self, repository: str, files: Mapping[str, str], tag: str) -> str:
        """Commit files to a repository and set the tag, also if it exists; return the commit."""
        folder = self.root / "repositories" / f"{repository}.git"
        if not folder.exists():
            folder.mkdir(parents=True)
            _git(folder, "init", "--quiet", "--template=", "--initial-branch=main")
        write_files(folder, files)
        _git(folder, "add", "--all")
        _git(folder, "commit", "--quiet", "--allow-empty", "--message", tag)
        _git(folder, "tag", "--force", tag)
        return _git(folder, "rev-parse", "HEAD")

    def publish(self) -> str:
        distribution = {
            "type": "distribution",
            "version": 2,
            "release_platforms": {"debian": ["bookworm"]},
            "repositories": self.repositories,
        }
        cache = {
            "type": "cache",
            "version": 2,
            "name": self.name,
            "distribution_file": [distribution],
            "release_package_xmls": self.manifests,
        }
        entry = {
            "distribution": [f"{self.name}/distribution.yaml"],
            "distribution_cache": f"{self.name}-cache.yaml",
            "distribution_status": "active",
            "distribution_type": "ros2",
            "python_version": 3,
        }
        index = {"type": "index", "version": 4, "distributions": {self.name: entry}}
        files = {
            "index-v4.yaml": yaml.safe_dump(index),
            f"{self.name}/distribution.yaml": yaml.safe_dump(distribution),
            f"{self.name}-cache.yaml": yaml.safe_dump(cache),
        }
        return write_files(self.root / "index", files).as_uri() + "/index-v4.yaml"

    def variables(self, server: str | None = None) -> dict[str, str]:
        """Return the environment in which forge finds the distribution, with a cache of its own.

        The repositories are on disk, or at the URL of a server.
        """
        config = self.root / "gitconfig"
        mirror = server or (self.root / "repositories").as_uri()
        config.write_text(f'[url "{mirror}/"]\n\tinsteadOf = {SERVER}\n[protocol "file"]\n\tallow = always\n')
        return {
            "ROSDISTRO_INDEX_URL": self.publish(),
            "GIT_CONFIG_GLOBAL": str(config),
            "XDG_CACHE_HOME": str(self.root / "user cache"),
        }


def _git(folder: Path, *words: str) -> str:
    done = subprocess.run(
        ("git", "-C", str(folder), *words),
        env={**os.environ, **_AUTHOR},
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout.strip()


def small_ros(root: Path) -> Ros:
    """Release a client library over a middleware, of which there are two, and a vendored library."""
    ros = Ros(root)
    ros.commit("lib", {"lib.txt": "the library\n"}, "v1.2")
    ros.release("rmw_cyclonedds_cpp", f"<member_of_group>{GROUP}</member_of_group>")
    ros.release("rmw_fastrtps_cpp", f"<member_of_group>{GROUP}</member_of_group>", *depends("fastdds"))
    ros.release("fastdds")
    ros.release(
        "rmw_implementation",
        *depends("rmw_cyclonedds_cpp", "rmw_fastrtps_cpp"),
        f"<group_depend>{GROUP}</group_depend>",
    )
    clone = f"""\
include(FetchContent)
FetchContent_Declare(lib GIT_REPOSITORY {SERVER}lib.git GIT_TAG v1.2)
FetchContent_Populate(lib)
install(FILES ${{lib_SOURCE_DIR}}/lib.txt DESTINATION share/lib_vendor)"""
    ros.release("lib_vendor", *depends("libacl1-dev"), cmake=clone)
    ros.release("test_tools")
    ros.release(
        "rclmini", *depends("rmw_implementation", "lib_vendor"), *depends("test_tools", tag="test_depend")
    )
    ros.release("turtle", *depends("rclmini"))
    return ros
