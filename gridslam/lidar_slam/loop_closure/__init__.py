"""Loop closure over a whole trajectory: search by uncertainty, consistency, and a sparse pose graph."""
