"""Order, cut-off and decimation chosen from the spectra of the channels."""
