"""Controllers of the SIMATIC S7-300/400 that compute in REAL: `tip`, the PID tip No. 2, and `fb41`, the standard block.

What both share: REAL as the CPU rounds it, a data block's bytes, and the AWL source form.
"""
