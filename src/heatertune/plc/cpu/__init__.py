"""The CPUs behind the controllers: what they read, hold and round, as emulators and tables; none is a controller."""
