"""Errors of a result against ground truth: trajectories, relations, maps, objects; and gates on the measures.

The modules with measures do not read files. `files`, `object_files` and `run_files` read; `document` collects the measures.
"""
