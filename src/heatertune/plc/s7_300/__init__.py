"""The PID of SIMATIC S7-300/400 application tip No. 2; DIFFERENCES.md lists the open points of the document."""
