"""Bytes in, bytes out: ports, and the command protocol over them."""
