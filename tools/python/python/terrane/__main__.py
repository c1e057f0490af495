"""The command line: `python -m terrane`."""

import sys

from terrane._terrane import command_line

if __name__ == "__main__":
    sys.exit(command_line(["terrane", *sys.argv[1:]]))
