"""`forge ignore`: leaves packages out of a workspace, and says which ones are left out and why."""
