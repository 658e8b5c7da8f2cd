"""The audit of a build: compare the files that its steps read, according to strace, with the tracked inputs.

`tracing` runs steps under strace, `accesses` parses its output, `tracked` collects the tracked inputs of a
package, `comparison` reports the difference, `untracked` is the table of inputs that forge ignores on
purpose. Imports nothing from `cli`.
"""
