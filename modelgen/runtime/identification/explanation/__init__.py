"""What the residual of a fit says of the model, and the fit with that taken into account."""
