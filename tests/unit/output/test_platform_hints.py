"""Remedies for failures of builds for another platform."""

from __future__ import annotations

import pytest

from forge.output.platform_hints import remedy_for_platform


@pytest.mark.parametrize(
    ("output", "expected"),
    [
        (
            "qemu-aarch64: Could not open '/lib/ld-linux-aarch64.so.1': No such file",
            "'ld-linux-aarch64.so.1'",
        ),
        ("/bin/sh: 1: maker: not found", "compiled for another platform: install qemu-user"),
        ("sh: line 1: maker: command not found", "compiled for another platform: install qemu-user"),
        ("/bin/sh: 1: ./maker: Exec format error", "pass the target itself to add_custom_command"),
    ],
)
def test_a_program_for_another_platform_needs_an_emulator(output: str, expected: str) -> None:
    assert expected in (remedy_for_platform(output, {"maker"}) or "")


@pytest.mark.parametrize(
    ("output", "expected"),
    [
        (
            "/usr/bin/ld: /my ws/liba.so: error adding symbols: file in wrong format",
            "'liba.so' was built for another platform",
        ),
        (
            "ld.lld: error: /my ws/liba.so is incompatible with aarch64linux",
            "'liba.so' was built for another platform",
        ),
        (
            'error: unable to provide libc for target "aarch64-linux.5.10...7.2-gnu.2.10"',
            "zig has no glibc 2.10",
        ),
        (
            'error: unable to provide libc for target "arm-linux.5.10...7.2-gnueabihf.2.10"',
            "zig has no glibc 2.10",
        ),
    ],
)
def test_failures_of_another_platform_have_a_hint(output: str, expected: str) -> None:
    assert expected in (remedy_for_platform(output, ()) or "")


@pytest.mark.parametrize("output", ["", "/bin/sh: 1: bison: not found", "maker: not found"])
def test_other_failures_get_no_platform_hint(output: str) -> None:
    assert remedy_for_platform(output, {"maker"}) is None
