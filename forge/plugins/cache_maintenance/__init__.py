"""`forge cache`: inspects, prunes and verifies the package cache and the files kept by plugins."""
