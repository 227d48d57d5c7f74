"""Single mistakes put into the firmware one by one, and what a board must do for all to notice."""
