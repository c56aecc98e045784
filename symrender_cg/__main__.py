"""`python -m symrender_cg`, and the script of the same name: the command line. Nothing is imported that is not used."""

from __future__ import annotations

import sys

from symrender_cg.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
