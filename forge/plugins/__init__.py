"""The plugins of forge: optional features. The core imports none of them.

A plugin imports the modules of the core that `__all__` of each package lists, and no other plugin.
"""
