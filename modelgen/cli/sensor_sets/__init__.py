"""Records of one sensor set or of several: read for it, identified, and told as one answer."""
