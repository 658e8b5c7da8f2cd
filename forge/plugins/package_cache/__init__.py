"""`--cache` restores installed files of packages from a cache; `forge cache` maintains it."""
