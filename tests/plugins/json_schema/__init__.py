"""Tests of the plugin json_schema."""
