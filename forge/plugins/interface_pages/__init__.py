"""Interfaces as pages: HTML by `forge interface docs`, Markdown by `forge interface generate --lang docs`."""
