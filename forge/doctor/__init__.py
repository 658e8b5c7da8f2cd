"""`forge doctor` and `forge deps`: problems of the machine and the workspace.

`checks` contains the checks, `system_deps` finds missing system packages.
"""
