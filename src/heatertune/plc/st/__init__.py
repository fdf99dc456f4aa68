"""What is in structured text the same for all blocks: the program around, its export, its execution, its way back."""
