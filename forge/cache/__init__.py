"""The package cache: stores the installed files of packages by key, in a folder and optionally on a server.

Start with `package_cache` and `opening`.
"""

__all__ = ["folder_store", "maintenance", "model", "opening"]
