"""Run tasks: the scheduler, the loop, the process runner, the job pool and the worker client.

`loop.execute` is the entry point. May import the packages above it in docs/explanation/architecture.md, up to
`cache`.
"""
