"""`forge clean`: removes build, install and log files of a workspace, of packages or of stale ones."""
