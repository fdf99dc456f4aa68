"""Address → a PLC that is asked: its blocks as bytes, over S7, Modbus, OPC UA or AS511."""
