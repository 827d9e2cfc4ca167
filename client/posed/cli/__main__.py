"""`python -m posed.cli`."""

import sys

from posed.cli import main

sys.exit(main())
