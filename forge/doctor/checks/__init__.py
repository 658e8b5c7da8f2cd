"""The checks of `forge doctor`: machine, programs, environment and packages.

No code of the workspace is run; programs are only asked for their version.
"""
