"""The PID of SIMATIC S7-300/400 application tip No. 2; what the document leaves open stands in DIFFERENCES.md."""
