"""Warps the drawing onto the finished map: places of the map as a graph, their positions in the drawing, and a smooth warp."""
