"""Parsed definitions to catalogs: look up referenced types, and reject conflicts and cycles."""

__all__ = ["resolution"]
