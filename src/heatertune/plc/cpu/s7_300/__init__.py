"""What the controllers of an S7-300/400 share: REAL as the CPU rounds it, a data block's bytes, the AWL source form."""
