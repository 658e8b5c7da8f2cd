"""`forge info`: shows the workspace, its interpreter and underlays, and details of packages."""
