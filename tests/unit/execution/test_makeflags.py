"""MAKEFLAGS as users, make and cargo write it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.execution.makeflags import MakeFlags, read_make_flags


@pytest.mark.parametrize(
    ("text", "flags"),
    [
        ("", MakeFlags()),
        ("-j4", MakeFlags(jobs=4)),
        ("j4", MakeFlags(jobs=4)),
        ("-j 4 -l 2.5", MakeFlags(jobs=4, load=2.5)),
        ("-j", MakeFlags()),
        ("--jobs=3 --load-average=2", MakeFlags(jobs=3, load=2)),
        ("--jobs 3 -k", MakeFlags(jobs=3, rest=("-k",))),
        ("-kj8", MakeFlags(jobs=8, rest=("-k",))),
        ("ks -j3 --jobserver-auth=3,4", MakeFlags(jobs=3, auth="3,4", rest=("ks",))),
        (" -j3 --jobserver-auth=fifo:/tmp/x", MakeFlags(jobs=3, auth="fifo:/tmp/x")),
        ("-j --jobserver-fds=5,6 --jobserver-auth=7,8", MakeFlags(auth="7,8")),
        ("-j2 -j5", MakeFlags(jobs=5)),
        ("k -- jobs=1 -j7", MakeFlags(rest=("k", "--", "jobs=1", "-j7"))),
        (" -- V=1", MakeFlags(rest=("--", "V=1"))),
        ("V=1", MakeFlags(rest=("V=1",))),
        ("--no-print-directory --jobserver-style=pipe", MakeFlags(
            rest=("--no-print-directory", "--jobserver-style=pipe")
        )),
    ],
)  # fmt: skip
def test_job_options_are_separated_from_other_flags(text: str, flags: MakeFlags) -> None:
    assert read_make_flags(text) == flags


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "-j2 --jobserver-auth=3,4"),
        ("ks -j9 -- V=1", "ks -j2 --jobserver-auth=3,4 -- V=1"),
        ("-k", "-j2 --jobserver-auth=3,4 -k"),
        ("V=1", "-j2 --jobserver-auth=3,4 V=1"),
    ],
)
def test_ours_come_after_makes_first_letters_and_before_variables(text: str, line: str) -> None:
    assert read_make_flags(text).line(2, "3,4") == line


words = st.sampled_from(["-k", "--silent", "-j3", "-l2", "--jobserver-auth=3,4", "-w"])


@given(st.sampled_from(["", "ks", "w"]), st.lists(words), st.lists(st.sampled_from(["V=1", "-x=2"])))
def test_a_line_says_again_what_was_read(letters: str, options: list[str], variables: list[str]) -> None:
    flags = read_make_flags(" ".join([letters, *options, *(["--", *variables] if variables else [])]))
    again = read_make_flags(flags.line(flags.jobs, flags.auth))
    assert (again.jobs, again.auth, again.rest) == (flags.jobs, flags.auth, flags.rest)
    assert read_make_flags(flags.line()).jobs is None
