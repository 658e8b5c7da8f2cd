"""Tests of `forge fetch`."""
