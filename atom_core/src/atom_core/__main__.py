"""Entry point of ``python3 -m atom_core``."""

import sys

from atom_core.cli import main

sys.exit(main())
