"""What has changed over the estimates of one machine, and since when."""
