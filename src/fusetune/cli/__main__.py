"""`python -m fusetune.cli` is the command `fusetune`."""

import sys

from fusetune.cli import main

if __name__ == "__main__":
    sys.exit(main())
