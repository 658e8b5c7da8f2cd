"""How much of ROS forge can stand in for: upstream's test suites and public repositories, counted.

`python -m tests.upstream` writes docs/compatibility.json from the test results of built workspaces.
`python -m tests.upstream.page` makes docs/reference/compatibility.md of it.
"""
