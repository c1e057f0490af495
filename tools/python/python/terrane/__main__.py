"""The command line: `python -m terrane`."""

import signal
import sys

from terrane._terrane import command_line

if __name__ == "__main__":
    # The command line has its own signal handler; Python's would print after it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(command_line(["terrane", *sys.argv[1:]]))
