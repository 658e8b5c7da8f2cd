"""MAKEFLAGS as users, make and cargo write it."""

import pytest

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
        ("nkt -j2 --question", MakeFlags(jobs=2, rest=("k",))),
        ("-t", MakeFlags()),
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
