"""How studies tell of their runs: measures, verdicts and figures, one topic a file."""
