"""`forge bundle`: packs the install folder into an archive for deployment."""
