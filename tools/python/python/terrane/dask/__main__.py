"""The command line: `python -m terrane.dask`."""

from terrane.dask.cli import main

if __name__ == "__main__":
    main()
