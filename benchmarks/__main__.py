"""All tables, one after the other."""

from __future__ import annotations

from benchmarks import accuracy, campaign, increments, run, unscented

if __name__ == "__main__":
    run.main()
    campaign.main()
    accuracy.main()
    increments.main()
    unscented.main()
