"""The live side: a virtual PLC that answers on the network, with the heater behind it."""
