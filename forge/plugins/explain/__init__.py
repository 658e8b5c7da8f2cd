"""What a build will do and why, for `forge build --explain`, `--dry-run` and `--log-level info`."""
