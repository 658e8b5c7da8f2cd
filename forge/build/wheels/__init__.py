"""Installing a Python package into a prefix."""

__all__ = ["install_wheel"]
