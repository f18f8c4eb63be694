"""Files to logs and results to files, one module per format."""
