"""The lines that tests execute, for `forge test --coverage`: reports of gcovr and coverage.py."""
