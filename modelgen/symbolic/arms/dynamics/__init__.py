"""What follows from the motion of links: poses, Jacobians, torques by two derivations, accelerations."""
