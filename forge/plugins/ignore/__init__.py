"""`forge ignore`: leaves packages out of a workspace, and lists those that are left out, with reasons."""
