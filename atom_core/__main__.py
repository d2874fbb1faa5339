"""What `python3 -m atom_core` meets beside this folder where the environment is not loaded."""

import sys

sys.stderr.write(
    "atom_core: the environment of this checkout is not loaded in this shell; run `make build` "
    "once, then `source env.bash`\n"
)
sys.exit(2)
