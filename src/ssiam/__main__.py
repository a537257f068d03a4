"""Entry point of ``python -m ssiam``."""

import sys

from ssiam.cli import main

sys.exit(main())
