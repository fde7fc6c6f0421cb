"""Arms with rigid joints in closed loop: dynamics from the module, references, laws, motion, records."""
