"""Pictures of maps: cells, paths and marks in windows, with axes, scale and legend around them."""
