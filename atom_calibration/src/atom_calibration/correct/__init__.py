"""What a person corrects: labels, transforms, the first guess of the sensors."""
