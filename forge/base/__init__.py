"""Foundations of all other packages: errors, files, text formats, templates, graphs of names.

Knows nothing of ROS, packages or builds, and imports nothing else of forge.
"""
