"""Tests of the plugin interface_versions."""
