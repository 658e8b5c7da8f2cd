"""What a workspace needs from outside, and what package managers call it: all that `forge deps` knows."""
