"""Messages decoded and labeled: frames, seeds, predictions."""
