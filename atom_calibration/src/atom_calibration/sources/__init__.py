"""Where data come from: bags, topics, transforms, and the sensors found in them."""
