"""Units of what people read and other programs write; inside everything is SI."""

MM_PER_M = 1000.0
