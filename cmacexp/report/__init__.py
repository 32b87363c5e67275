"""Figures and tables over one run, a sweep or a study; they read what runs left, and never simulate."""
