"""Tests of the plugin protobuf."""
