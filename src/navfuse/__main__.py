"""``python -m navfuse`` is the program ``navfuse``."""

from navfuse.cli.app import main

if __name__ == "__main__":
    main()
