"""`forge build --watch`: rebuild whenever source files change."""
