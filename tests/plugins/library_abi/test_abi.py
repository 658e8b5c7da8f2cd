"""The interface of a shared library differs wherever a program that links it would."""

import subprocess
from pathlib import Path

import pytest

from forge.plugins.library_abi.relinking import abi_digest

pytestmark = pytest.mark.needs("gcc")

ASSEMBLY = """
    .data
    .globl v
    .p2align {align}
{label}v:
    .long {values}
    .size v, {size}
    .section .note.GNU-stack,"",@progbits
"""
CHANGES = {
    "the size of a symbol without a type": (
        ASSEMBLY.format(align=2, label="", values="1", size=4),
        ASSEMBLY.format(align=2, label="", values="1,2,3,4", size=16),
    ),
    "the alignment of a symbol without a type": (
        ASSEMBLY.format(align=2, label="", values="1", size=4),
        ASSEMBLY.format(align=6, label="", values="1", size=4),
    ),
    "the offset of a symbol without a type": (
        ASSEMBLY.format(align=6, label="", values="1", size=4),
        ASSEMBLY.format(align=6, label="    .long 0\n", values="1", size=4),
    ),
    "a constant pointer": ("static int q; int *v = &q;", "static int q; int *const v = &q;"),
    "a constant": ("int v = 1;", "const int v = 1;"),
    "two names of one variable": (
        'int v = 1; extern int w __attribute__((alias("v")));',
        "int v = 1; int w = 1;",
    ),
    "the size": ("int v[2] = {1};", "int v[3] = {1};"),
    "the alignment": ("int v = 1;", "_Alignas(128) int v = 1;"),
    "a variable of each thread": ("int v = 1;", "_Thread_local int v = 1;"),
    "a weak symbol": ("int v = 1;", "__attribute__((weak)) int v = 1;"),
    "a protected symbol": ("int v = 1;", '__attribute__((visibility("protected"))) int v = 1;'),
    "a function in place of a variable": ("int v = 1;", "int v(void) { return 1; }"),
    "a function chosen at run time": (
        "int v(void) { return 1; }",
        """static int f(void) { return 1; } static void *r(void) { return f; }
        int v(void) __attribute__((ifunc("r")));""",
    ),
    "another function": ("int v(void) { return 1; }", "int v(void) { return 1; } int w(void) { return 1; }"),
    "a function that is called": (
        "int v(void) { return 1; }",
        "int w(void); int v(void) { return w(); }",
    ),
}
SAME = {
    "the code of a function": ("int v(int a) { return a; }", "int v(int a) { return a * a + 7; }"),
    "the value of a variable": ("int v = 1;", "int v = 2;"),
    "a static function": (
        "int v(void) { return 1; }",
        "static int w(int a) { return a + 3; }\nint v(void) { return w(4); }",
    ),
}


def library(folder: Path, name: str, text: str, *flags: str) -> Path:
    """Return a shared library made of C or assembly."""
    source = folder / f"{name}.{'s' if '.globl' in text else 'c'}"
    source.write_text(text)
    path = folder / name / "libd.so"
    path.parent.mkdir()
    argv = ("gcc", "-shared", "-fPIC", "-O1", *flags, "-o", str(path), str(source))
    subprocess.run(argv, check=True, capture_output=True)
    return path


@pytest.mark.parametrize("change", CHANGES)
def test_visible_changes_change_the_interface(tmp_path: Path, change: str) -> None:
    one, other = (
        library(tmp_path, name, text) for name, text in zip(("one", "other"), CHANGES[change], strict=True)
    )
    assert abi_digest(str(one)) != abi_digest(str(other)) != ""


@pytest.mark.parametrize("change", SAME)
def test_internal_changes_keep_the_interface(tmp_path: Path, change: str) -> None:
    one, other = (
        library(tmp_path, name, text) for name, text in zip(("one", "other"), SAME[change], strict=True)
    )
    assert abi_digest(str(one)) == abi_digest(str(other)) != ""


@pytest.mark.parametrize(
    "flag",
    ["-Wl,-soname,libe.so", "-Wl,-rpath,/x", "-Wl,-z,norelro", "-Wl,-z,nodelete", "-Wl,-Bsymbolic", "-lm"],
)
def test_linker_options_visible_to_users_change_the_interface(tmp_path: Path, flag: str) -> None:
    text = "static int q; int *const v = &q; double w(double a) { return __builtin_sin(a); }"
    one, other = library(tmp_path, "one", text, "-Wl,--no-as-needed"), library(tmp_path, "other", text, flag)
    assert abi_digest(str(one)) != abi_digest(str(other)) != ""
