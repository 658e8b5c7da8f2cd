"""`forge doctor`: checks the machine, the shell and the workspace before a build."""
