"""HTML documentation: one page per interface, an index per package, and a search."""
