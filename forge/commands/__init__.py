"""One module per word the user types: register(parser), run(options) -> int."""
