"""The standard block FB41 CONT_C (SFB41 of the CPU 31xC); DIFFERENCES.md lists what is not documented."""
