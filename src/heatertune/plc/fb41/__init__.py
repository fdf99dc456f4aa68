"""The standard block FB41 CONT_C (SFB41 of the CPU 31xC); what is not documented stands in DIFFERENCES.md."""
