"""Reports of `forge build` and `forge test` for GitHub Actions and GitLab CI: `--ci-output`.

`findings` collects errors with their locations; `github` and `gitlab` write them in the documented formats.
"""
