"""Single tests: `forge test PACKAGE::TEST`, `--last-failed`, and a table of failed tests with commands."""
