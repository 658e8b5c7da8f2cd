"""`forge extensions`: lists the extension points, and what extends them."""
