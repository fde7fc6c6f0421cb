"""Arms described in URDF: XML of strangers -> joints and the values of their links."""
