"""The commands that write one table of many cases."""
