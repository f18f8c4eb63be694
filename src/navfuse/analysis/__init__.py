"""What a result is worth: errors against a truth, and consistency of the innovations with what was claimed."""
