"""The packages of a workspace, their metadata, and package selection.

Start reading at `load`. May import `base`, `interfaces` and `environment`.
"""

__all__ = [
    "cmake_text",
    "discovery",
    "forge_toml",
    "identification",
    "identity",
    "load",
    "manifest",
    "model",
    "plain_packages",
    "python_metadata",
    "resolve",
    "root",
    "selection",
    "source_names",
]
