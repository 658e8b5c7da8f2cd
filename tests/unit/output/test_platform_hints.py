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


@pytest.mark.parametrize("output", ["", "/bin/sh: 1: bison: not found", "maker: not found"])
def test_other_failures_get_no_such_remedy(output: str) -> None:
    assert remedy_for_platform(output, {"maker"}) is None
