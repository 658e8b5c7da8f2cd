"""Decide which packages must be built and why, and record what each build read and installed.

Start with `planning`, `up_to_date` and `recipes/`. Within a build folder, `inputs.fingerprints` lists the
inputs file by file, `inputs.native_graph` reads the dependency graphs of ninja and make, `reuse` decides
which outputs remain valid, and `build_dir` applies that decision. Imports nothing from `execution`, `cache`
or `cli`.
"""

__all__ = [
    "build_dir",
    "build_types",
    "cleaning",
    "copies",
    "events",
    "folder_marks",
    "inputs",
    "installation",
    "installed_lists",
    "journal",
    "model",
    "observed_writes",
    "recipes",
    "records",
    "reuse",
    "snapshot",
    "state",
    "tasks",
    "tests",
    "up_to_date",
    "wheels",
]
