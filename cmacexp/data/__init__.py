"""A run on disk: signals, tables, manifest, atomic files, discovery, integrity."""
