"""What commands print: one line at a time, tables, the state of work; outputs that can be closed."""
