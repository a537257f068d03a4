"""``python -m ssiam``: the command line."""

import sys

from ssiam.cli import main

sys.exit(main())
