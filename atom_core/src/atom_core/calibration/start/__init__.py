"""Where the solver starts: sensors from the description or the data, boards from the sensors."""
