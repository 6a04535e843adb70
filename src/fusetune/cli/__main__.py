"""`python -m fusetune.cli` is the command `fusetune`."""

import sys

from fusetune.cli import main

sys.exit(main())
