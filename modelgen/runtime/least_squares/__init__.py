"""Fits of rows and their covariances: weights, delays, Huber, total least squares."""
