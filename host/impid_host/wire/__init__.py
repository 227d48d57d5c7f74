"""Bytes and CAN frames to samples, by the message set of `impid.dbc`."""
