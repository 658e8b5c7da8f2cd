"""Runs colcon once per line of JSON on stdin, each in a fork of its own; started by colcon's interpreter.

A line holds {"argv": [...], "cwd": "..."}; the answer {"code": 0, "out": "...", "err": "..."}.
"""

import json
import os
import sys
import tempfile

from colcon_core.command import main


def run(argv: "list[str]", cwd: str) -> "dict[str, object]":
    """Run one command line in a child and return what it left behind."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if child == 0:
            os.chdir(cwd)
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            code: object = 70
            try:
                code = main(argv=argv)
            except SystemExit as leaving:
                code = leaving.code
                if isinstance(code, str):
                    sys.stderr.write(f"{code}\n")
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code if isinstance(code, int) else int(code is not None))
        _, status = os.waitpid(child, 0)
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode(errors="replace"))
        return {"code": os.waitstatus_to_exitcode(status), "out": texts[0], "err": texts[1]}


if __name__ == "__main__":
    for line in sys.stdin:
        sys.stdout.write(json.dumps(run(**json.loads(line))) + "\n")
        sys.stdout.flush()
