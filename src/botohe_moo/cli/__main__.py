"""``python -m botohe_moo.cli``."""

from botohe_moo.cli.app import main

if __name__ == "__main__":
    main()
