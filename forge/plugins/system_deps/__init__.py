"""`forge deps`: lists and installs the missing system dependencies of a workspace."""
