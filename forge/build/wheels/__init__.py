"""Installing a Python package into a prefix."""

__all__ = ["backends", "install_wheel"]
