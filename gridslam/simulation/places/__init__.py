"""Large places made by seed: buildings, corridors and campuses of kilometres, as ordinary world documents."""
