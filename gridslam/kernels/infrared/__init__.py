"""ir-scan: infrared beams into grids, and the straight walls under points."""
