"""The recording file: MCAP with the raw wire bytes beside what was decoded from them."""
