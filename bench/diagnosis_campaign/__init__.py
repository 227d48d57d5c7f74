"""How often `diagnose` is right: a campaign over random laboratories of the simulator."""
