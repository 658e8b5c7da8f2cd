"""Prefixes and the effect of sourcing them: underlays, dsv files, hooks and setup scripts for all shells.

May import `base` and `interfaces`.
"""

__all__ = ["install_state", "installed", "prefixes", "shells", "sourcing"]
