"""Records: channels of files and arrays mapped to the sensors of a model, checked and repaired."""
