"""Files to model and back: datasets, images, clouds, configurations, descriptions."""
