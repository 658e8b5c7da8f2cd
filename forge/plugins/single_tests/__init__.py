"""Single tests on the command line: `forge test PACKAGE::TEST`, and `--last-failed`."""
