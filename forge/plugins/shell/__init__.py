"""`forge env` and `forge shell`: the environment of a workspace without sourcing it."""
