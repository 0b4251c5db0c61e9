"""Charts, drawn here because a plotting library takes longer to load than they take."""
