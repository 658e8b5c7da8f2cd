"""Run tasks: the loop with its scheduler, the process runner, the job pool and the worker client.

`loop.execute` is the entry point. May import the packages above it in docs/explanation/architecture.md, up to
`cache`.
"""

__all__ = [
    "executor",
    "fork_server",
    "job_pool",
    "jobserver",
    "lock",
    "memory",
    "observer",
    "options",
    "runner",
    "started",
    "worker_client",
]
