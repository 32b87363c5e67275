"""What studies share: runs that are made once, work on all cores, the report and its command line."""
