"""What packages installed, kept for other builds: in a folder of this machine, and on a server for many."""
