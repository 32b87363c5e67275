"""Figures and tables of a run, a sweep or a study, from the files of runs; nothing is simulated."""
