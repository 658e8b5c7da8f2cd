"""Tests of the plugin interface_diff."""
