"""What is to be solved: the measurements, what is estimated and held, whether it can be posed."""
