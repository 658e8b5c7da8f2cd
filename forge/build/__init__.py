"""What a build folder was made from, and how much of it the next build may reuse.

`input_manifest` lists inputs file by file, `native_graph` reads what ninja and make know, `reuse` decides,
`build_dir` acts on the decision, `build_notes` keeps what the next build has to know. Imports nothing of
`execution`, `cache` or `cli`.
"""
