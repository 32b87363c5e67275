"""Figures and tables over one run, a sweep or a study; they read the files of runs, and never simulate."""
