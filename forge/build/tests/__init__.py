"""The steps that test the packages of each build type.

`unittests` is a separate program that runs unittest.
"""

__all__ = ["recipes"]
