"""`forge interface --strict`: reports definitions that are valid, but error-prone."""
