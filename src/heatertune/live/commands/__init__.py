"""The commands of the live side, and `health`, which also records running loops."""
