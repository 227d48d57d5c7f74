"""Bytes and CAN frames to samples, by the message set in `impid.dbc`."""
