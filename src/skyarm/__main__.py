"""``python -m skyarm``."""

from skyarm.cli.main import main

if __name__ == "__main__":
    main()
