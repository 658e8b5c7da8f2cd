"""The steps that build and install the packages of each build type: pure functions of a BuildContext."""

__all__ = ["cmake", "context", "python"]
