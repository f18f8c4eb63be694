"""All tables, one after the other."""

from __future__ import annotations

from benchmarks import accuracy, increments, run

if __name__ == "__main__":
    run.main()
    accuracy.main()
    increments.main()
