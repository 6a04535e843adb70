"""`python -m benchmarks`: how fast everything is, see benchmarks/README.md."""

import sys

from benchmarks.speed.command import main

if __name__ == "__main__":
    sys.exit(main())
