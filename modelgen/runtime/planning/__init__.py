"""Before the experiment: predicted precision, sensor sets ranked, excitations designed."""
