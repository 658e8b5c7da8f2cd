"""`forge interface diff`: what changes between two versions of interface definitions break."""
