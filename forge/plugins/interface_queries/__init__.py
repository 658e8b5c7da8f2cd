"""`forge interface proto`, `hash` and `schema`: defaults, type hashes, and definitions as in MCAP files."""
