"""Scans to points with normals, maps of surface elements, and the registration of the one in the other."""
