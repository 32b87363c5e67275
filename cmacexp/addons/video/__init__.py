"""Videos of runs, robots drawn with the meshes of their models, and a table of recordings."""
