"""The prefixes to search, in order of precedence."""

from __future__ import annotations

import os
from pathlib import Path

from ament_index_python.constants import AMENT_PREFIX_PATH_ENV_VAR


def get_search_paths() -> list[str]:
    """Return the existing prefixes in AMENT_PREFIX_PATH.

    Raises OSError if the variable is not set or empty.
    """
    paths = os.environ.get(AMENT_PREFIX_PATH_ENV_VAR)
    if not paths:
        raise OSError(f"Environment variable '{AMENT_PREFIX_PATH_ENV_VAR}' is not set or empty")
    return [path for path in paths.split(os.pathsep) if path and Path(path).is_dir()]
