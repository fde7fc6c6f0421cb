"""Records of one sensor set or of several: read for it, identified, and given as one answer."""
