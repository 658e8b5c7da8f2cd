"""Charts of dependency graphs and build times.

Build times are read from the events in the log folder of a build.
"""
