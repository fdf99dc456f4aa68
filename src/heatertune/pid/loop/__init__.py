"""The sampled loop: its responses, its sensitivity and its margins."""
