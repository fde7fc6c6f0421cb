"""Which cut-offs to try, and the one whose estimate is predicted to be the best."""
