"""Named worlds: the apparatus as its laboratory knows it, what is really true, and the trials."""
