"""Speed and memory of everything that somebody waits for, each beside a peer of the same run (`make bench`)."""
