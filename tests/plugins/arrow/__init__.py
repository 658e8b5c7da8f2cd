"""Tests of the plugin arrow."""
