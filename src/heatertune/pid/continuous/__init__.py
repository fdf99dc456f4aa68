"""The loop in continuous time: its optimum with exact dead time."""
