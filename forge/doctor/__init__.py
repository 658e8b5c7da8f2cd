"""`forge doctor`: problems of the machine and the workspace."""
