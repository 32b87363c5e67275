"""Terminal output of commands: lines, tables and progress, also on outputs that are closed or full."""
