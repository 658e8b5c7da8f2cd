"""Reports of `forge build` and `forge test` for GitHub Actions and GitLab CI: `--ci-output`.

`findings` collects what went wrong and where; `github` and `gitlab` write it as the services document.
"""
