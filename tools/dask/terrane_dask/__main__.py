"""`python -m terrane_dask` is `terrane-dask`."""

from terrane_dask.cli import main

if __name__ == "__main__":
    main()
