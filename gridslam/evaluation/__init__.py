"""Errors of a result against ground truth: trajectories, relations, maps, objects; and gates on the measures.

The modules with measures do not read files; those in `readers` do. `document` collects the measures.
"""
