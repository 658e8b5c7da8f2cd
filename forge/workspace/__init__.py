"""The packages of a workspace, their metadata, and package selection.

Start reading at `load`. May import `base`, `interfaces` and `environment`.
"""
