"""The audit of a build: what its steps read, as strace saw it, against what forge tracks.

`opening` checks the options, `tracing` starts steps under strace, `accesses` reads its output, `tracked`
gathers what forge knows of a package, `comparison` says what remains, `untracked` is the table of what forge
leaves out on purpose. Imports nothing of `commands`.
"""
