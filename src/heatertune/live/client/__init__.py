"""Address → a PLC that is asked: its blocks as bytes, over S7 or Modbus."""
