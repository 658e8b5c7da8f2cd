"""What a build folder was made from, and how much of it the next build may reuse.

`input_manifest` lists inputs file by file, `native_graph` reads what ninja and make know, `reuse` decides,
`build_dir` acts on the decision. Imports nothing of `execution`, `cache` or `cli`.
"""
