"""Every reader of foreign bytes as a harness, the bytes it is fed, and how its work grows with them."""
