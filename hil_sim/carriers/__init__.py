"""What lies between the board and the host: serial lines (`Carrier`) and CAN buses (`CanCarrier`)."""
