"""Speed and accuracy of navfuse, other tools beside it: ``python -m benchmarks``."""
