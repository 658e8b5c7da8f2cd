"""The jobserver with real tools, and job pools in a separate process."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from forge.execution.jobserver import FIFO, PIPE, supported_styles
from tests.unit.execution.test_jobserver import BOTH, NONE, ONLY_PIPE


@pytest.mark.needs("make")
def test_jobserver_support_of_tools_is_detected(tmp_path: Path) -> None:
    """GNU make supports both styles since 4.4; programs that fail or know no jobserver support none."""
    make = shutil.which("make") or ""
    version = subprocess.run((make, "--version"), capture_output=True, text=True, check=True).stdout.split()[
        2
    ]
    expected = BOTH if tuple(map(int, version.split(".")[:2])) >= (4, 4) else ONLY_PIPE
    assert supported_styles("make", Path(make), os.environ) == expected
    assert supported_styles("ninja", Path(make), os.environ) == NONE
    assert supported_styles("make", tmp_path / "none", os.environ) == NONE


@pytest.mark.needs("ninja")
def test_the_version_of_ninja_determines_its_jobserver_style() -> None:
    ninja = shutil.which("ninja") or ""
    said = subprocess.run((ninja, "--version"), capture_output=True, text=True, check=True).stdout.strip()
    found = supported_styles("ninja", Path(ninja), os.environ)
    if tuple(map(int, said.split(".")[:2])) >= (1, 13):
        assert FIFO in found
        assert (PIPE in found) == ("pipe" in said)
    elif "jobserver" in said:
        assert found == ONLY_PIPE
    else:
        assert found == NONE


def test_an_unused_job_pool_closes_immediately() -> None:
    """So does one that joined another jobserver and waits for a token."""
    program = """if True:
        import threading
        from contextlib import closing
        from forge.execution.job_pool import JobPool
        from forge.execution.jobserver import create_pool, join_pool
        outer = create_pool("fifo")
        with closing(JobPool(2, create_pool("pipe"))):
            pass
        with closing(JobPool(2, join_pool(outer.auth))) as job_pool, job_pool.package():
            threading.Thread(target=lambda: job_pool.package().__enter__(), daemon=True).start()
            threading.Event().wait(0.1)
    """
    subprocess.run((sys.executable, "-W", "error", "-c", program), check=True, timeout=20)
