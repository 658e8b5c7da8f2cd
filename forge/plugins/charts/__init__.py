"""Charts of dependency graphs, for `forge graph`, and of build times, for `forge build --timings`.

Build times are read from the events in the log folder of a build.
"""
