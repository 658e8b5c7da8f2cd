"""What a build does and did: status lines on terminals, charts of build times and of dependency graphs.

The charts are those of `forge build --timings` and `forge graph`. Build times are read from the events in
the log folder of a build.
"""
