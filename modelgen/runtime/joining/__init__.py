"""One answer from records of different sensors: an estimate each sensor set, joined by their covariances."""
