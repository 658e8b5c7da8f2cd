"""Systems are named as in rosdep's files."""

import pytest

from forge.plugins.system_deps.system import System, system_of

JAMMY = System("ubuntu", "jammy", "apt")


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ('ID=ubuntu\nVERSION_ID="22.04"\nVERSION_CODENAME=jammy\n', JAMMY),
        ('ID=debian\nVERSION_ID="12"\nVERSION_CODENAME=bookworm\n', System("debian", "bookworm", "apt")),
        ("ID=linuxmint\nID_LIKE=ubuntu\nUBUNTU_CODENAME=jammy\nVERSION_CODENAME=vera\n", JAMMY),
        ('ID="openEuler"\nVERSION_ID="24.03"\n', System("openeuler", "24.03", "dnf")),
        ('ID=rocky\nID_LIKE="rhel centos fedora"\nVERSION_ID="9.3"\n', System("rhel", "9", "dnf")),
        ("ID=fedora\nVERSION_ID=40\n", System("fedora", "40", "dnf")),
        ('ID="opensuse-leap"\nID_LIKE="suse opensuse"\nVERSION_ID="15.6"\n', System("opensuse", "15.6", "")),
        ("ID=manjaro\nID_LIKE=arch\n", System("arch", "", "")),
        ("ID=void\n", System("void", "", "")),
    ],
)
def test_systems_are_named_as_in_rosdep(said: str, expected: System) -> None:
    pairs = (line.partition("=") for line in said.splitlines())
    assert system_of({name: value.strip('"') for name, _, value in pairs}) == expected


def test_another_system_can_be_selected() -> None:
    assert system_of({"ID": "debian"}, "ubuntu:jammy") == JAMMY
    assert system_of({"ID": "debian"}, "openEuler:24.03") == System("openeuler", "24.03", "dnf")
