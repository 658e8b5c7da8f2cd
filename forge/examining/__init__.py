"""What `forge doctor` looks at: the machine, its programs, what is sourced, and what packages say.

Nothing of the workspace is executed; programs of the machine are asked for their version, no more.
"""
