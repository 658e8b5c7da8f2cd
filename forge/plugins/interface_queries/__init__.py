"""`forge interface proto` and `schema`: default values of messages, and definitions as in MCAP files."""
