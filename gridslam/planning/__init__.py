"""Path planning: obstacles, paths of arcs and lines, paths over cost fields, tours, observation points, motion commands."""
