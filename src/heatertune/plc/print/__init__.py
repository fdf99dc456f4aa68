"""Programs described once, in a subset of structured text, and printed as STL for the S5, S7-200 and S7-300."""
