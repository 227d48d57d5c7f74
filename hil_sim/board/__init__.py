"""The sensor board: the real firmware core behind one protocol, and its wire format read back."""
