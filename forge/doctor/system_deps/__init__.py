"""System dependencies of a workspace and their package managers, for `forge deps`."""
