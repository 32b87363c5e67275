"""How studies summarise their runs: measures, verdicts and figures, one topic a file."""
