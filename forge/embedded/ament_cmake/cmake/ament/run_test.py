"""Run the command of a test, and make sure that a result file exists.

    run_test.py RESULT_FILE [--package-name P] [--output-file F] [--env K=V ...] [--append-env K=V ...]
                [--skip-test] [--skip-reason TEXT] [--skip-return-code N]
                [--generate-result-on-success] --command WORD ...

A failing result is written first, because a command that crashes leaves none, or an old one. If the command
does not replace it, this program does. Exits with the code of the command, or with 1 if the result file
contains failures. Uses only the standard library.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import escape, quoteattr

RESULT = """\
<?xml version="1.0" encoding="UTF-8"?>
<testsuite name={suite} tests="1" failures="{failures}" errors="0" skipped="{skipped}" time="0">
  <testcase classname={suite} name={name} time="0">
{outcome}  </testcase>
</testsuite>
"""
NOT_RUN = "The test did not leave a result file."
# Characters that XML 1.0 does not allow; terminal colour codes come first, because they are longer.
UNPRINTABLE = re.compile("\x1b\\[[0-9;]*m|[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def main(words: list[str]) -> int:
    """Run the command and return the exit code."""
    options = _parse(words)
    result = Path(options.result_file)
    name = result.name.split(".")[0]
    result.parent.mkdir(parents=True, exist_ok=True)
    result.unlink(missing_ok=True)
    if options.skip_test:
        _write(result, options.package_name, name, skipped=options.skip_reason)
        _say(f"-- {name}: skipped: {options.skip_reason}")
        return 0
    _write(result, options.package_name, name, failure=NOT_RUN)
    pristine = result.read_bytes()

    code, output = _run(options)
    if result.is_file() and result.read_bytes() == pristine:
        if options.skip_return_code is not None and code == options.skip_return_code:
            _write(
                result, options.package_name, name, skipped=f"The test requested it with exit code {code}."
            )
        elif code == 0 and options.generate_result_on_success:
            _write(result, options.package_name, name, output=output)
        else:
            _write(result, options.package_name, name, failure=f"{NOT_RUN}\n{output}")
    return _judge(result, options.package_name, code, options.skip_return_code)


def _parse(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Run a test and leave a result file.", allow_abbrev=False)
    parser.add_argument("result_file")
    parser.add_argument("--package-name", default="")
    parser.add_argument("--output-file")
    parser.add_argument("--env", nargs="+", default=[])
    parser.add_argument("--append-env", nargs="+", default=[])
    parser.add_argument("--skip-test", action="store_true")
    parser.add_argument("--skip-reason", default="The test is not run here.")
    parser.add_argument("--skip-return-code", type=int)
    parser.add_argument("--generate-result-on-success", action="store_true")
    own, command = words, []
    if "--command" in words:
        at = words.index("--command")
        own, command = words[:at], words[at + 1 :]
    options = parser.parse_args(own)
    options.command = command
    if not command and not options.skip_test:
        parser.error("nothing to run: --command is missing")
    return options


def _environment(options: argparse.Namespace) -> dict[str, str]:
    variables = dict(os.environ)
    variables.update(_pairs(options.env))
    for key, value in _pairs(options.append_env):
        variables[key] = os.pathsep.join(filter(None, [variables.get(key, ""), value]))
    return variables


def _pairs(words: list[str]) -> list[tuple[str, str]]:
    """Return keys and values; CMake splits at semicolons: a word without '=' continues the one before."""
    pairs: list[tuple[str, str]] = []
    for word in words:
        key, equals, value = word.partition("=")
        if equals:
            pairs.append((key, value))
        elif pairs:
            pairs[-1] = (pairs[-1][0], f"{pairs[-1][1]};{word}")
    return pairs


def _run(options: argparse.Namespace) -> tuple[int, str]:
    """Run the command; copy its output to stdout and to the output file."""
    _say(f"-- {' '.join(options.command)}")
    output = Path(options.output_file or os.devnull)
    output.parent.mkdir(parents=True, exist_ok=True)
    lines = []
    with output.open("wb") as sink:
        try:
            process = subprocess.Popen(
                options.command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=_environment(options)
            )
        except OSError as error:
            message = f"'{options.command[0]}' cannot be run: {error.strerror}"
            _say(f"-- {message}")
            return 1, message
        signal.signal(signal.SIGTERM, lambda *_: process.terminate())
        with process:
            for line in process.stdout or ():
                sys.stdout.buffer.write(line)
                sys.stdout.flush()
                sink.write(line)
                lines.append(line)
    _say(f"-- exit code {process.returncode}")
    return process.returncode, b"".join(lines).decode(errors="replace")


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _write(result: Path, package: str, name: str, **outcome: str) -> None:
    """Write a result with one case; `outcome` has failure, skipped, output, or nothing."""
    kind, text = next(iter(outcome.items()), ("output", ""))
    text = UNPRINTABLE.sub("", text)
    body = {
        "failure": f"    <failure message={quoteattr(text)}/>\n",
        "skipped": f"    <skipped message={quoteattr(text)}/>\n",
        "output": f"    <system-out>{escape(text)}</system-out>\n",
    }[kind]
    suite = quoteattr(package or name)
    result.write_text(
        RESULT.format(
            suite=suite,
            name=quoteattr(name),
            failures=int(kind == "failure"),
            skipped=int(kind == "skipped"),
            outcome=body,
        ),
        encoding="utf-8",
    )


def _judge(result: Path, package: str, code: int, skip_code: int | None) -> int:
    """Return the exit code; it is not 0 if the result file is missing, invalid or contains failures."""
    if not result.is_file():
        return code or 1
    try:
        tree = ET.parse(result)  # noqa: S314  (the test's own file)
    except ET.ParseError as error:
        problem = f"The result file is not XML: {error}"
        _say(f"-- {problem}")
        _write(result, package, result.name.split(".")[0], failure=problem)
        return code or 1
    if result.name.endswith(".gtest.xml") and package:
        for case in tree.iter("testcase"):
            if not case.get("classname", "").startswith(f"{package}."):
                case.set("classname", f"{package}.{case.get('classname', '')}")
        tree.write(result, encoding="utf-8", xml_declaration=True)
    if code in (0, skip_code):
        failed = any(
            int(suite.get(kind) or 0) for suite in tree.iter("testsuite") for kind in ("failures", "errors")
        )
        return 1 if failed else code
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
