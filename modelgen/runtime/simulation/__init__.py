"""The direct model in closed loop: plant, controller, drive, excitation, sensors."""
