"""New packages from templates, for `forge pkg create`."""
