"""Flaky tests: `forge test --retest-until-pass` reports tests that failed and passed when repeated."""
