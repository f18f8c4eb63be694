"""Estimators, one file each, and the record they leave."""
