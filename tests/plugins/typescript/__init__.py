"""Tests of the plugin typescript."""
