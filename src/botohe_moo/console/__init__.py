"""What the command line and long runs need of a terminal: options, words, waiting, ending."""
