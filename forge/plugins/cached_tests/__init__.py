"""Replays the passes of tests whose inputs are unchanged, for `forge test --cached`."""
