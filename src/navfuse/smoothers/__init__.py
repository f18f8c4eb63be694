"""Smoothers, one file each."""
