"""`forge init`: writes settings for a workspace, its editor, its CI jobs and its development container."""
