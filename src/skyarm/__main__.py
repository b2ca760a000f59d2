"""Entry point of ``python -m skyarm``: the command line."""

from skyarm.cli.main import main

if __name__ == "__main__":
    main()
