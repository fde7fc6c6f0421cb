"""Forces at single samples that rows are made not to depend on."""
