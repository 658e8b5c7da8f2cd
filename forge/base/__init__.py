"""Foundations of all other packages: errors, files, text formats, templates, graphs of names.

Independent of ROS, packages and builds; imports no other package of forge.
"""

__all__ = [
    "ament_index",
    "cmake_syntax",
    "colours",
    "distributions",
    "env_vars",
    "errors",
    "extensions",
    "files",
    "formats",
    "frozen",
    "graph",
    "layout",
    "names",
    "options",
    "own_environment",
    "templating",
    "text",
    "xml",
]
