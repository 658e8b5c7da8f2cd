"""The names of platforms."""

import pytest

from forge.plugins.cross.targets import parse_target, similar_target


@pytest.mark.parametrize(
    ("word", "triple", "glibc", "cpu"),
    [
        ("aarch64-linux-gnu", "aarch64-linux-gnu", "", "aarch64"),
        ("aarch64-linux-gnu.2.35", "aarch64-linux-gnu", "2.35", "aarch64"),
        ("aarch64-unknown-linux-gnu", "aarch64-linux-gnu", "", "aarch64"),
        ("arm64", "aarch64-linux-gnu", "", "aarch64"),
        ("arm64.2.31", "aarch64-linux-gnu", "2.31", "aarch64"),
        ("armhf", "arm-linux-gnueabihf", "", "arm"),
        ("armv7l", "arm-linux-gnueabihf", "", "arm"),
        ("riscv64", "riscv64-linux-gnu", "", "riscv64"),
        ("amd64", "x86_64-linux-gnu", "", "x86_64"),
    ],
)
def test_platforms_have_the_names_used_by_debian_docker_and_rust(
    word: str, triple: str, glibc: str, cpu: str
) -> None:
    target = parse_target(word)
    assert (target.triple, target.glibc, target.cpu) == (triple, glibc, cpu)
    assert target.is_known
    assert target.with_glibc == (f"{triple}.{glibc}" if glibc else triple)


@pytest.mark.parametrize("word", ["aarch64-poky-linux", "mips64el-linux-gnuabi64", "aarch64-linux-musl"])
def test_unknown_platform_names_need_a_toolchain_file(word: str) -> None:
    target = parse_target(word)
    assert target.triple == word
    assert not target.is_known


@pytest.mark.parametrize("word", ["", "../x", "a b", "x/y"])
def test_platform_names_are_safe_folder_names(word: str) -> None:
    with pytest.raises(ValueError, match="is not the name of a platform"):
        parse_target(word)


@pytest.mark.parametrize(
    ("word", "version"), [("aarch64-linux-gnu.2", "2"), ("arm64.22.04.1", "22.04.1"), ("arm64.", "")]
)
def test_a_platform_name_may_have_a_glibc_version(word: str, version: str) -> None:
    with pytest.raises(ValueError, match=f"'{version}' is not a version of glibc, such as 2.35"):
        parse_target(word)


def test_cmake_processor_names_match_the_kernel() -> None:
    assert parse_target("armhf").cmake_processor == "armv7l"
    assert parse_target("arm64").cmake_processor == "aarch64"


@pytest.mark.parametrize(
    ("word", "near"),
    [
        ("arm46", "arm64"),
        ("arm46-linux-gnu", "aarch64-linux-gnu"),
        ("aarch46-linux-gnu", "aarch64-linux-gnu"),
        ("aarch64-linux-musl", "aarch64-linux-gnu"),
        ("risc64", "riscv64"),
        ("mips-linux-gnu", None),
    ],
)
def test_misspelled_platform_names_get_a_suggestion(word: str, near: str | None) -> None:
    assert similar_target(parse_target(word)) == near
